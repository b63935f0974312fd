"""Exact path: equilibrium of all bodies at once, with finite rotations and without the influence G.

Unknown are the displacements of ten frames, the wrenches through eight components, the reactions of
three cylindrical pairs and the flange forces.  Forces balance on the displaced bodies, pairs close
exactly, flanges, play and friction are part of the same solution.  Slow: it judges the fast path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.statics import component_rotations, turned_flexibilities
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.laws.law import Bending, Law

GROUND = -1
FRAMES = (
    "pin_1",
    "pin_2",
    "wall_2",
    "pin_5",
    "pin_4",
    "wall_4",
    "hub_4",
    "pin_3",
    "wall_3",
    "platform",
)
ENDS = {
    "link_1": ("pin_1", "pin_2"),
    "link_2": ("pin_5", "pin_4"),
    "link_3": ("hub_4", "pin_3"),
    "joint_1": ("ground", "pin_1"),
    "joint_2": ("pin_2", "wall_2"),
    "joint_3": ("pin_3", "wall_3"),
    "joint_4": ("pin_4", "wall_4"),
    "joint_5": ("ground", "pin_5"),
}
"""Frame on the motor's side and on the platform's side of each component."""

PAIRS = {
    "joint_2": ("wall_2", "platform"),
    "joint_3": ("wall_3", "platform"),
    "joint_4": ("wall_4", "hub_4"),
}
"""Frames that a cylindrical pair joins."""

MICRO = 1e-6
"""Lengths and angles are counted in millionths, so that they are of the size of the forces."""

TOLERANCE = 1e-9
"""Largest change of an unknown at the end [N, um]."""

MAX_STEPS = 300
FULL_STEPS, SHORT_STEPS = 40, 100


@dataclass(frozen=True)
class ExactState:
    """Solution of one pose."""

    rotation: Array  # (3, 3), U -> F of the platform
    shift: Array  # (3,), position of the platform's point O in F [m]
    # (8, 6), wrench through each component, in the axes of its displaced motor side [N, N m]
    through: Array
    slip: Array  # (3, 2), slide [m] and small turn [rad] of each pair from the rigid pose
    force: Array  # (m,), flange forces [N]


def number(frame: str) -> int:
    """Return the number of a frame, `GROUND` for the ground."""
    return GROUND if frame == "ground" else FRAMES.index(frame)


class ExactWrist:
    """A wrist with hidden laws, pose by pose; friction remembers the pose before.

    `laws`: hidden; sensor laws, motor laws and creep are not looked at.
    """

    def __init__(self, table: Table, laws: Sequence[Law]) -> None:
        self._mechanism, self._laws = table.mechanism, laws
        self._parts, self._gravity = table.components, table.geometry.gravity
        for law in laws:
            self._parts, self._gravity = law.parts(self._parts), law.gravity(self._gravity)
        self._drags = {law.component: _Drag(law) for law in laws if isinstance(law, JointFriction)}

    def solve(self, theta: Array, load: Array, kelvin: Array | None = None) -> ExactState:
        """Find the equilibrium of the next pose.

        `theta` (2,): True motor angles [rad]; `load` (6,): wrench on the platform at O in F [N, N
        m]; `kelvin` (7,): temperatures of `HEATED` above the reference [K].  Raises `InputError` if
        the iteration does not end.
        """
        configuration = self._mechanism.forward(theta[None])
        warm = np.zeros((1, len(HEATED))) if kelvin is None else kelvin[None]
        flexibility = turned_flexibilities(configuration, self._parts)
        block = Block(np.zeros(1), configuration, load[None], flexibility, warm)
        system = _System(self._parts, self._gravity, block, self._laws, self._drags)
        return system.solve()


class _Drag:
    """Friction of one pair from pose to pose."""

    def __init__(self, law: JointFriction) -> None:
        self.law = law
        self.past: Array | None = None
        self.bristle = np.zeros(2)

    def force(self, path: Array, reaction: Array) -> tuple[Array, Array]:
        """Return friction (2,) on (slide, radius x turn) at `path` (2,), and minus its slope."""
        past = path if self.past is None else self.past
        stuck = -self.law.stiffness * (self.bristle + path - past)
        most, size = float(self.law.budget(reaction)), float(np.hypot(*stuck))
        if size <= most:
            return stuck, self.law.stiffness * np.eye(2)
        # Dragged along, the bristles only turn with the direction of slip.
        along = stuck / size
        return most * along, self.law.stiffness * most / size * (np.eye(2) - np.outer(along, along))

    def keep(self, path: Array, force: Array) -> None:
        """Remember the pose."""
        self.past, self.bristle = path, -force / self.law.stiffness


class _System:
    """Residual and tangent of one pose."""

    def __init__(
        self,
        parts: ElasticComponents,
        gravity: Array,
        block: Block,
        laws: Sequence[Law],
        drags: dict[str, _Drag],
    ) -> None:
        self._block, self._drags = block, drags
        configuration = block.configuration
        self._flexibility = block.flexibility[0]
        turns = component_rotations(configuration)[0]
        wide = block_diagonal(turns)
        axes = (configuration.b[0], configuration.c[0], configuration.d[0])
        self._axes = dict(zip(PAIRS, axes, strict=True))
        self._across = {}
        for joint, axis in self._axes.items():
            self._across[joint] = np.kron(np.eye(2), np.linalg.svd(axis[None])[2][1:])
        sectors = parts.sectors
        self._own, self._slide = sectors.component, sectors.slide
        self._sector_screw = (wide[self._own] @ sectors.screw[..., None])[..., 0]
        self._approach = sectors.approach
        self._gap = sectors.gap + np.einsum(
            "mi,mji,j->m", sectors.weight_approach, turns[self._own], gravity
        )
        self._gravity = gravity
        self._weights = [
            (number(frame), _turned(weights[k], turns[k]))
            for k, name in enumerate(ELASTIC)
            for frame, weights in zip(
                ENDS[name],
                (parts.weight_motor_side, parts.weight_platform_side),
                strict=True,
            )
            if frame != "ground"
        ]
        platform = configuration.platform[0]
        self._weights.append((number("platform"), _turned(parts.platform_weight, platform)))
        self._load = block.load[0] + sum((law.wrench(block)[0] for law in laws), np.zeros(6))
        self._screws = sum((law.screws(block)[0] for law in laws), np.zeros((len(ELASTIC), 6)))
        self._bends = [
            (ELASTIC.index(law.component), partial(law.bend, block))
            for law in laws
            if isinstance(law, Bending)
        ]

    def solve(self) -> ExactState:
        """Newton's method; each step is a contact problem of the linear wrist at hand.

        The tangent leaves out what finite rotations add, so the last digits come linearly.
        """
        z = np.zeros(_SIZE)
        force, closed = np.zeros(len(self._gap)), None
        push, pull = self._contact_coupling()
        for step in range(MAX_STEPS):
            rest, tangent, gap = self._residual(z, force)
            if len(force):
                solved = np.linalg.solve(tangent, np.column_stack([rest, push]))
                lopsided = self._approach / MICRO - pull @ solved[:, 1:]
                approach = np.asarray(0.5 * (lopsided + lopsided.T))
                offset = gap - pull @ solved[:, 0] - approach @ force
                new, closed = solve_contact(approach, offset, closed)
                change = np.asarray(-solved[:, 0] - solved[:, 1:] @ (new - force))
            else:
                new, change = force, np.asarray(-np.linalg.solve(tangent, rest))
            # Kinked laws can make full steps jump to and fro.
            share = 1.0 if step < FULL_STEPS else 0.3 if step < SHORT_STEPS else 0.1
            jump = new - force
            z, force = z + share * change, force + share * jump
            if max(np.max(np.abs(change)), np.max(np.abs(jump), initial=0.0)) < TOLERANCE:
                return self._state(z, force)
        raise InputError(
            f"exact wrist: no equilibrium after {MAX_STEPS} steps, "
            f"the last changed by {np.max(np.abs(change)):.1e}"
        )

    def _residual(self, z: Array, force: Array) -> tuple[Array, Array, Array]:
        """Return residual, tangent over z, and the gaps; lengths in micrometres."""
        screw, through, reaction = _split(z)
        motion = exp_twist(MICRO * screw)
        balance = np.zeros((len(FRAMES) + 1, 6))
        bent = np.zeros((len(ELASTIC), 6))
        tangent = self._linear_tangent()
        balance[number("platform")] += self._load
        for frame, weight in self._weights:
            balance[frame] += _carried(motion, frame, weight @ (motion[0][frame].T @ self._gravity))
        given = self._screws + np.einsum("kij,kj->ki", self._flexibility, through)
        np.add.at(given, self._own, self._sector_screw * force[:, None])
        for k, law in self._bends:
            extra, slope = law(through[None, k])
            given[k] += extra[0]
            rows = _THROUGH.start + 6 * k + np.arange(6)
            tangent[np.ix_(rows, rows)] -= slope[0] / MICRO
        for k, name in enumerate(ELASTIC):
            near, far = map(number, ENDS[name])
            wrench = _carried(motion, near, through[k])
            # The component resists: what stretches it pulls its platform side back.
            balance[far] -= wrench
            balance[near] += wrench
            bent[k] = (_relative(motion, near, far) - given[k]) / MICRO
        gap = self._gap + self._approach @ force
        gap = gap + np.einsum("mi,mi->m", self._sector_screw, through[self._own])
        closure = np.zeros((len(PAIRS), 4))
        for j, (joint, (wall, hub)) in enumerate(PAIRS.items()):
            relative = _relative(motion, number(wall), number(hub))
            closure[j] = self._across[joint] @ relative / MICRO
            along = self._axes[joint]
            slip = np.array([along @ relative[:3], along @ relative[3:]])
            gap = gap + self._slide[:, j] * slip[0]
            pushed = np.concatenate([(self._slide[:, j] @ force) * along, np.zeros(3)])
            pushed = pushed + self._across[joint].T @ reaction[j]
            if joint in self._drags:
                pushed = pushed + self._drag(joint, slip, through, tangent)
            wrench = _carried(motion, number(wall), pushed)
            balance[number(hub)] += wrench
            balance[number(wall)] -= wrench
        rest = np.concatenate([balance[:-1].ravel(), bent.ravel(), closure.ravel()])
        return rest, tangent, gap / MICRO

    def _drag(self, joint: str, slip: Array, through: Array, tangent: Array) -> Array:
        """Return the wrench of friction on the hub and enter its slope into the tangent."""
        drag = self._drags[joint]
        arm = np.array([1.0, drag.law.seat.radius])
        friction, slope = drag.force(self._path(joint, slip), self._reaction(joint, through))
        along = np.zeros((2, 6))
        along[0, :3] = along[1, 3:] = self._axes[joint]
        pull = (along.T * arm) @ slope @ (arm[:, None] * along) * MICRO
        wall, hub = (6 * number(frame) + np.arange(6) for frame in PAIRS[joint])
        for rows, sign in ((hub, -1.0), (wall, 1.0)):
            tangent[np.ix_(rows, hub)] += sign * pull
            tangent[np.ix_(rows, wall)] -= sign * pull
        return (arm * friction) @ along

    def _path(self, joint: str, slip: Array) -> Array:
        """Return slide and radius times whole turn of a joint, (2,) [m]."""
        law = self._drags[joint].law
        return np.array([slip[0], law.seat.radius * (law.turn_of(self._block)[0] + slip[1])])

    def _reaction(self, joint: str, through: Array) -> Array:
        law = self._drags[joint].law
        return law.reaction(self._block, through[None, ELASTIC.index(joint)])[0]

    def _linear_tangent(self) -> Array:
        """Return the tangent without finite rotations, bending laws and friction."""
        out = np.zeros((_SIZE, _SIZE))
        for k, name in enumerate(ELASTIC):
            rows = _THROUGH.start + 6 * k + np.arange(6)
            out[np.ix_(rows, rows)] = -self._flexibility[k] / MICRO
            for frame, sign in zip(map(number, ENDS[name]), (-1.0, 1.0), strict=True):
                if frame != GROUND:
                    moved = 6 * frame + np.arange(6)
                    out[rows, moved] = sign
                    out[moved, rows] = -sign
        for j, (joint, frames) in enumerate(PAIRS.items()):
            rows = _REACTION.start + 4 * j + np.arange(4)
            for frame, sign in zip(map(number, frames), (-1.0, 1.0), strict=True):
                moved = 6 * frame + np.arange(6)
                out[np.ix_(rows, moved)] = sign * self._across[joint]
                out[np.ix_(moved, rows)] = sign * self._across[joint].T
        return out

    def _contact_coupling(self) -> tuple[Array, Array]:
        """Return how forces enter the residual (size, m), and how z opens the gaps (m, size)."""
        m = len(self._gap)
        push, pull = np.zeros((_SIZE, m)), np.zeros((m, _SIZE))
        for i, k in enumerate(self._own):
            rows = _THROUGH.start + 6 * k + np.arange(6)
            push[rows, i] = -self._sector_screw[i] / MICRO
            pull[i, rows] = self._sector_screw[i] / MICRO
        for j, (joint, frames) in enumerate(PAIRS.items()):
            for frame, sign in zip(map(number, frames), (-1.0, 1.0), strict=True):
                moved = 6 * frame + np.arange(3)
                push[moved] += sign * np.outer(self._axes[joint], self._slide[:, j])
                pull[:, moved] += sign * np.outer(self._slide[:, j], self._axes[joint])
        return push, pull

    def _state(self, z: Array, force: Array) -> ExactState:
        screw, through, _ = _split(z)
        motion = exp_twist(MICRO * screw)
        slip = np.zeros((len(PASSIVE_JOINTS), 2))
        for j, (joint, frames) in enumerate(PAIRS.items()):
            relative = _relative(motion, *map(number, frames))
            slip[j] = self._axes[joint] @ relative[:3], self._axes[joint] @ relative[3:]
            if joint in self._drags:
                path = self._path(joint, slip[j])
                drag = self._drags[joint]
                drag.keep(path, drag.force(path, self._reaction(joint, through))[0])
        platform = number("platform")
        rotation = motion[0][platform] @ self._block.configuration.platform[0]
        return ExactState(rotation, motion[1][platform], through, slip, force)


_SCREW = slice(0, 6 * len(FRAMES))
_THROUGH = slice(_SCREW.stop, _SCREW.stop + 6 * len(ELASTIC))
_REACTION = slice(_THROUGH.stop, _THROUGH.stop + 4 * len(PAIRS))
_SIZE = _REACTION.stop


def _split(z: Array) -> tuple[Array, Array, Array]:
    """Return screws (11, 6) with the ground's last, wrenches (8, 6) and reactions (3, 4)."""
    screw = np.concatenate([z[_SCREW].reshape(-1, 6), np.zeros((1, 6))])
    return screw, z[_THROUGH].reshape(-1, 6), z[_REACTION].reshape(-1, 4)


Motion = tuple[Array, Array]
"""Displacement of every frame: rotations (11, 3, 3) and shifts (11, 3)."""


def _carried(motion: Motion, frame: int, wrench: Array) -> Array:
    """Return at O in F a wrench (6,) that is fixed in a displaced frame."""
    rotation, shift = motion[0][frame], motion[1][frame]
    force = rotation @ wrench[:3]
    return np.concatenate([force, rotation @ wrench[3:] + np.cross(shift, force)])


def _relative(motion: Motion, near: int, far: int) -> Array:
    """Return the twist (6,) of one frame's displacement against another's, in the latter's axes."""
    back = motion[0][near].T
    return log_motion(back @ motion[0][far], back @ (motion[1][far] - motion[1][near]))


def _turned(weights: Array, turn: Array) -> Array:
    """Return weights (6, 3) of a body that was turned (3, 3), for fields in F."""
    return block_diagonal(turn) @ weights @ turn.T
