"""What every hidden law offers, and those laws of which there are many.

A hook that is not given leaves the base as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wrist_stiffness.errors import InputError, meant
from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import block_diagonal, cross
from wrist_stiffness.simulation.block import Block

if TYPE_CHECKING:
    from wrist_stiffness.simulation.equilibrium import Equilibrium
    from wrist_stiffness.simulation.program import Program


class Law:
    """One departure of the true wrist from its base: a subclass, or made of its hooks.

    Hooks are called once for each block, in the order of time and in the order in which they stand
    here.  A law with a history advances it in the hook that ends with "and remember"; a copy of the
    law has a history of its own (so a function that remembers is a `partial` of its memory).  What
    hangs on the forces inside the wrist is found together with them: `Bending`, `Flowing`,
    `Rubbing`.

    Raises `InputError` if a hook has no such name.
    """

    component: str

    def __init__(self, component: str = "", **hooks: Callable[..., Any]) -> None:
        own = {*dir(type(self)), *type(self).__annotations__}
        known = {name for name in own if not name.startswith("_")}
        for name in hooks.keys() - known:
            raise InputError(f"{type(self).__name__}: no hook {name!r}{meant(name, known)}")
        self.component = component
        vars(self).update(hooks)

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Return other elastic parts, once before the start."""
        return parts

    def gravity(self, gravity: Array) -> Array:
        """Return another gravity (3,) in F, once before the start [m/s^2]."""
        return gravity

    def told(self, program: Program) -> None:
        """Hear what motors and load are told to do, once before the start."""

    def turn(self, time_s: Array, shaft: Array) -> Array:
        """Return by how much the driven links are ahead of the encoders, (n, 2) [rad]; remember."""
        return np.zeros_like(shaft)

    def wrench(self, block: Block) -> Array:
        """Return a wrench on the platform at O in F, (n, 6) [N, N m]; remember."""
        return np.zeros_like(block.load)

    def screws(self, block: Block) -> Array:
        """Return screws at the components, (n, 8, 6) at O in F [m, rad]; remember."""
        return no_screws(block)

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Return a twist of the whole platform, (n, 6) at O in F [m, rad]; remember."""
        return np.zeros_like(block.load)

    def read_shaft(self, time_s: Array, shaft: Array) -> Array:
        """Return the shaft angles that the encoders count instead, (n, 2) [rad]; remember."""
        return shaft

    def read_speed(self, time_s: Array, speed: Array) -> Array:
        """Return the motor speeds that the drives see instead, (n, 2) [rad/s]; remember."""
        return speed

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Return what the load sensor says instead of a wrench (n, 6); remember."""
        return wrench

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Return what the pose sensor sees instead of (n, 3, 3) and (n, 3); remember."""
        return rotation, shift


class Bending(Law):
    """A component with a law of its own between wrench and screw."""

    bend: Callable[[Block, Array], tuple[Array, Array]]
    """Return the screw (n, 6) and its tangent (n, 6, 6) under the wrench (n, 6) through it."""


class Flowing(Law):
    """A component whose screw follows the history of its wrench."""

    flow: Callable[[Block, Array, bool], Array]
    """Return the screw (n, 6) after the history of the wrench (n, 6) through it; true: remember."""


class Rubbing(Law):
    """A passive joint with friction."""

    rub: Callable[[Block, Array, Equilibrium, Array, bool], Array]
    """Return force and torque of friction along the joint's axis, (n, 2) [N, N m].

    Of (block, give, state, acting, remember): `state` was found with the friction `acting` (n, 2)
    in this joint; `give` (n, 3, 2, 2) is what a little more of it moves there.
    """


@dataclass(frozen=True)
class UniformSoftness(Law):
    """Another modulus: all of a part's flexibility, its flanges included, grows alike."""

    component: str  # link or joint
    fraction: float  # extra flexibility over that of the base, > -1 [-]

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Scale flexibility and flanges."""
        scale = 1.0 + self.fraction
        flexibility = parts.flexibility.copy()
        flexibility[ELASTIC.index(self.component)] *= scale
        contact = dict(parts.contact)
        if self.component in contact:
            flange = contact[self.component]
            contact[self.component] = replace(
                flange,
                screw=scale * flange.screw,
                approach=scale * flange.approach,
                weight_approach=scale * flange.weight_approach,
            )
        return replace(parts, flexibility=flexibility, contact=contact)


def in_series(component: str, added: Callable[[Array], Array]) -> Law:
    """Add to the flexibility of a component what it says of that, both (6, 6) at O in F."""

    def softer(parts: ElasticComponents) -> ElasticComponents:
        flexibility, k = parts.flexibility.copy(), ELASTIC.index(component)
        flexibility[k] += added(flexibility[k])
        return replace(parts, flexibility=flexibility)

    return Law(component, parts=softer)


def flange_gap(joint: str, change: float) -> Law:
    """Change the axial gap at the flanges of a passive joint [m]; negative presses them on.

    Its hook raises `InputError` if the joint has no flange in this table.
    """

    def moved(parts: ElasticComponents) -> ElasticComponents:
        if joint not in parts.contact:
            raise InputError(f"flange_contact: {joint} has no flange in this table")
        flange = parts.contact[joint]
        flange = replace(flange, gap=flange.gap + change)
        return replace(parts, contact={**parts.contact, joint: flange})

    return Law(joint, parts=moved)


@dataclass(frozen=True)
class BodyScrew(Law):
    """A screw at a component, fixed in the body that carries it."""

    component: str
    screw: Array  # (6,), at O with the wrist at home [m, rad]
    share: Callable[[Block], Array] | None = None  # of it at each sample (n,); None for all

    def screws(self, block: Block) -> Array:
        """Turn it with its body."""
        at = block_diagonal(block.rotation(self.component)) @ self.screw
        if self.share is not None:
            at = self.share(block)[:, None] * at
        return at_component(block, self.component, at)


@dataclass(frozen=True)
class PlatformForce(Law):
    """A force at a point of the platform."""

    place: Array  # (3,), point in U [m]
    force: Callable[[Block, Array], Array]  # force (n, 3) [N] where the point is, (n, 3), in F [m]

    def wrench(self, block: Block) -> Array:
        """Move it to O."""
        at = block.configuration.platform @ self.place
        force = self.force(block, at)
        return np.concatenate([force, cross(at, force)], axis=-1)


@dataclass(frozen=True)
class SensorMotion(Law):
    """The sensor's frame is not F: T_seen = exp(share X) T."""

    motion: Array  # (6,), X [m, rad]
    # of samples and of what was to be seen (n, 3, 3), how much of X is there (n,); None for all
    share: Callable[[Block, Array], Array] | None = None

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move everything by it."""
        motion = self.motion
        if self.share is not None:
            motion = self.share(block, rotation)[:, None] * motion
        turn, move = exp_twist(motion)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move


def target_motion(motion: Array) -> Law:
    """See a target in another place on the platform: T_seen = T exp(Y), `motion` (6,) Y in U."""
    turn, move = exp_twist(motion)
    return Law(
        "pose_sensor",
        read_pose=lambda block, rotation, shift: (rotation @ turn, shift + rotation @ move),
    )


def no_screws(block: Block) -> Array:
    """Return zeros (n, 8, 6)."""
    return np.zeros((len(block.time_s), len(ELASTIC), 6))


def at_component(block: Block, component: str, screw: Array) -> Array:
    """Return screws (n, 8, 6) with `screw` (n, 6) at one component."""
    out = no_screws(block)
    out[:, ELASTIC.index(component)] = screw
    return out


DRIVEN = {"motor_1": "joint_1", "motor_2": "joint_5"}
"""The joint that a motor turns."""

MOTOR = {"motor_1": 0, "motor_2": 1}
"""Number of a motor among the motor angles."""

JOINED = {
    "joint_1": ("frame", "link_1"),
    "joint_2": ("link_1", "platform"),
    "joint_3": ("link_3", "platform"),
    "joint_4": ("link_2", "link_3"),
    "joint_5": ("frame", "link_2"),
}
"""Bodies that a joint joins."""
