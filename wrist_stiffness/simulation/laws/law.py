"""What every hidden law offers; a hook that is not overridden leaves the base as it is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.vectors import block_diagonal, cross
from wrist_stiffness.simulation.block import Block

if TYPE_CHECKING:
    from wrist_stiffness.simulation.equilibrium import Equilibrium
    from wrist_stiffness.simulation.program import Program


class Law:
    """One departure of the true wrist from its base.

    Hooks are called once for each block, in the order of time and in the order in which they stand
    here.  A law with a history advances it in the hook that ends with "and remember"; a copy of the
    law has a history of its own (so a function that remembers is a `partial` of its memory).  What
    hangs on the forces inside the wrist is found together with them: `Bending`, `Flowing`,
    `Rubbing`.
    """

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


class Bending(Law, ABC):
    """A component with a law of its own between wrench and screw."""

    component: str

    @abstractmethod
    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Return the screw (n, 6) and its tangent (n, 6, 6) under the wrench (n, 6) through it."""


class Flowing(Law, ABC):
    """A component whose screw follows the history of its wrench."""

    component: str

    @abstractmethod
    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Return the screw (n, 6) after the history of the wrench (n, 6) through it."""


class Rubbing(Law, ABC):
    """A passive joint with friction."""

    component: str

    @abstractmethod
    def rub(
        self, block: Block, give: Array, state: Equilibrium, acting: Array, remember: bool
    ) -> Array:
        """Return force and torque of friction along the joint's axis, (n, 2) [N, N m].

        `state` was found with the friction `acting` (n, 2) in this joint; `give` (n, 3, 2, 2) is
        what a little more of it moves there.
        """


@dataclass(frozen=True)
class LoadReading(Law):
    """A load sensor that reads another wrench."""

    said: Callable[[Block, Array], Array]  # what it says instead of a wrench, (n, 6)

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Read it."""
        return self.said(block, wrench)


@dataclass(frozen=True)
class BodyScrew(Law):
    """A screw at a component, fixed in the body that carries it."""

    component: str
    screw: Array  # (6,), at O with the wrist at home [m, rad]
    share: Callable[[Block], Array] | None = None  # of it at each sample (n,); None for all

    def screws(self, block: Block) -> Array:
        """Turn it with its body."""
        turned = block_diagonal(block.rotation(self.component)) @ self.screw
        if self.share is not None:
            turned = self.share(block)[:, None] * turned
        return at_component(block, self.component, np.asarray(turned))


@dataclass(frozen=True)
class PlatformMotion(Law):
    """A motion of the whole platform besides what the limbs let it do."""

    moved: Callable[[Block, Equilibrium], Array]  # its twist, (n, 6) at O in F [m, rad]

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Move the platform."""
        return self.moved(block, state)


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
