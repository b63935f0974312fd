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
from scipy.linalg import block_diag

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.statics import component_rotations, turned_flexibilities
from wrist_stiffness.mechanism.vectors import block_diagonal, both_halves, cross
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.laws.joint_friction import JointFriction
from wrist_stiffness.simulation.laws.law import Bending, Law

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

_JOINED = (*ENDS.values(), *PAIRS.values())
FRAMES = tuple(dict.fromkeys(frame for two in _JOINED for frame in two if frame != "ground"))
_NUMBER = {frame: i for i, frame in enumerate((*FRAMES, "ground"))}
_NEAR, _FAR = np.array([[_NUMBER[frame] for frame in two] for two in _JOINED]).T
"""Number of the near and of the far frame of each component, then of each pair, (11,)."""

_HEAVY = np.concatenate([_NEAR[: len(ELASTIC)], _FAR[: len(ELASTIC)], [_NUMBER["platform"]]])
"""Frames that carry weights: both sides of each component, and the platform, (17,)."""

_INCIDENCE = np.eye(len(_NUMBER))[_FAR] - np.eye(len(_NUMBER))[_NEAR]
_APART = np.kron(_INCIDENCE[:, : len(FRAMES)], np.eye(6))
"""From small screws of all frames to those of the far frames against the near ones, (66, 60)."""

_PAIRS_APART = _APART[6 * len(ELASTIC) :].reshape(len(PAIRS), 6, -1)

_SCREW = slice(0, 6 * len(FRAMES))
_THROUGH = slice(_SCREW.stop, _SCREW.stop + 6 * len(ELASTIC))
_REACTION = slice(_THROUGH.stop, _THROUGH.stop + 4 * len(PAIRS))
_SIZE = _REACTION.stop
"""Of the unknowns: displacements, wrenches through components, reactions of pairs."""

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
    slip: Array  # (3, 2), slide [m] and small turn [rad] of each pair from the rigid pose
    force: Array  # (m,), flange forces [N]


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
        self._block, self._drags, self._gravity = block, drags, gravity
        configuration = block.configuration
        self._flexibility = block.flexibility[0]
        turns = component_rotations(configuration)[0]
        axes = [axis[0] for axis in (configuration.b, configuration.c, configuration.d)]
        # Rows of each pair: slide and turn (3, 2, 6), and what it locks (3, 4, 6).
        self._along = np.stack([np.kron(np.eye(2), axis) for axis in axes])
        self._across = np.stack(
            [np.kron(np.eye(2), np.linalg.svd(axis[None])[2][1:]) for axis in axes]
        )
        sectors = parts.sectors
        self._own, self._slide, self._approach = sectors.component, sectors.slide, sectors.approach
        self._sector_screw = both_halves(turns[self._own], sectors.screw)
        self._gap = sectors.gap + np.einsum(
            "mi,mji,j->m", sectors.weight_approach, turns[self._own], gravity
        )
        weights = np.concatenate(
            [parts.weight_motor_side, parts.weight_platform_side, parts.platform_weight[None]]
        )
        turned = np.concatenate([turns, turns, configuration.platform])
        self._weights = block_diagonal(turned) @ weights @ np.swapaxes(turned, -1, -2)
        self._load = block.load[0] + sum((law.wrench(block)[0] for law in laws), np.zeros(6))
        self._screws = sum((law.screws(block)[0] for law in laws), np.zeros((len(ELASTIC), 6)))
        self._bends = [
            (ELASTIC.index(law.component), partial(law.bend, block))
            for law in laws
            if isinstance(law, Bending)
        ]
        self._linear = self._linear_tangent()

    def solve(self) -> ExactState:
        """Newton's method; each step is a contact problem of the linear wrist at hand.

        The tangent leaves out what finite rotations add, so the last digits come linearly.
        """
        z = np.zeros(_SIZE)
        force, closed = np.zeros(len(self._gap)), None
        # How z opens the gaps (m, size), and how forces enter the residual (size, m).
        pull = np.zeros((len(self._gap), _SIZE))
        pull[:, _SCREW] = np.einsum("mj,jx,jxz->mz", self._slide, self._along[:, 0], _PAIRS_APART)
        rows = _THROUGH.start + 6 * self._own[:, None] + np.arange(6)
        np.put_along_axis(pull, rows, self._sector_screw / MICRO, axis=1)
        push = pull.T.copy()
        push[_THROUGH] *= -1.0
        for step in range(MAX_STEPS):
            rest, tangent, gap = self._residual(z, force)
            solved = np.linalg.solve(tangent, np.column_stack([rest, push]))
            lopsided = self._approach / MICRO - pull @ solved[:, 1:]
            approach = np.asarray(0.5 * (lopsided + lopsided.T))
            offset = gap - pull @ solved[:, 0] - approach @ force
            new, closed = solve_contact(approach, offset, closed)
            change = np.asarray(-solved[:, 0] - solved[:, 1:] @ (new - force))
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
        through, reaction = z[_THROUGH].reshape(-1, 6), z[_REACTION].reshape(-1, 4)
        motion, apart, slips = self._moved(z)
        tangent = self._linear.copy()
        given = self._screws + np.einsum("kij,kj->ki", self._flexibility, through)
        np.add.at(given, self._own, self._sector_screw * force[:, None])
        for k, law in self._bends:
            extra, slope = law(through[None, k])
            given[k] += extra[0]
            rows = _THROUGH.start + 6 * k + np.arange(6)
            tangent[np.ix_(rows, rows)] -= slope[0] / MICRO
        bent = apart[: len(ELASTIC)] - given
        closure = np.einsum("jax,jx->ja", self._across, apart[len(ELASTIC) :])
        gap = self._gap + self._approach @ force + self._slide @ slips[:, 0]
        gap += np.einsum("mi,mi->m", self._sector_screw, through[self._own])
        # Components and pairs resist: what moves the far side away is pulled back.
        locked = np.einsum("jax,ja->jx", self._across, reaction)
        locked -= (self._slide.T @ force)[:, None] * self._along[:, 0]
        for j, joint in enumerate(PAIRS):
            if joint in self._drags:
                locked[j] -= self._drag(j, slips[j], through, tangent)
        wrench = _carried(motion, _NEAR, np.concatenate([through, locked]))
        balance = np.zeros((len(FRAMES) + 1, 6))
        balance[_NUMBER["platform"]] += self._load
        np.add.at(balance, _FAR, -wrench)
        np.add.at(balance, _NEAR, wrench)
        felt = np.swapaxes(motion[0][_HEAVY], -1, -2) @ self._gravity
        weight = (self._weights @ felt[..., None])[..., 0]
        np.add.at(balance, _HEAVY, _carried(motion, _HEAVY, weight))
        lengths = np.concatenate([bent.ravel(), closure.ravel()])
        return np.concatenate([balance[:-1].ravel(), lengths / MICRO]), tangent, gap / MICRO

    def _moved(self, z: Array) -> tuple[Motion, Array, Array]:
        """Return the motion, the twists (11, 6) of far frames in near ones, and slips (3, 2)."""
        screw = np.concatenate([z[_SCREW].reshape(-1, 6), np.zeros((1, 6))])
        turn, shift = exp_twist(MICRO * screw)
        back = np.swapaxes(turn[_NEAR], -1, -2)
        between = (back @ (shift[_FAR] - shift[_NEAR])[..., None])[..., 0]
        apart = log_motion(back @ turn[_FAR], between)
        return (turn, shift), apart, np.einsum("jhx,jx->jh", self._along, apart[len(ELASTIC) :])

    def _friction(self, joint: str, slip: Array, through: Array) -> tuple[Array, Array, Array]:
        """Return slide and radius times whole turn (2,) [m], friction on them, minus its slope."""
        drag = self._drags[joint]
        turn = drag.law.turn_of(self._block)[0] + slip[1]
        path = np.array([slip[0], drag.law.seat.radius * turn])
        reaction = drag.law.reaction(self._block, through[None, ELASTIC.index(joint)])[0]
        return path, *drag.force(path, reaction)

    def _drag(self, j: int, slip: Array, through: Array, tangent: Array) -> Array:
        """Return the wrench of friction on the hub and enter its slope into the tangent."""
        joint = PASSIVE_JOINTS[j]
        _, friction, slope = self._friction(joint, slip, through)
        along = np.array([[1.0], [self._drags[joint].law.seat.radius]]) * self._along[j]
        to_path = along @ _PAIRS_APART[j]
        tangent[_SCREW, _SCREW] -= MICRO * to_path.T @ slope @ to_path
        return friction @ along

    def _linear_tangent(self) -> Array:
        """Return the tangent without finite rotations, bending laws and friction."""
        out = np.zeros((_SIZE, _SIZE))
        pairs = np.concatenate(self._across @ _PAIRS_APART)
        out[_SCREW.stop :, _SCREW] = np.concatenate([_APART[: _THROUGH.stop - _SCREW.stop], pairs])
        out[_SCREW, _SCREW.stop :] = -out[_SCREW.stop :, _SCREW].T
        out[_THROUGH, _THROUGH] = -block_diag(*self._flexibility) / MICRO
        return out

    def _state(self, z: Array, force: Array) -> ExactState:
        (turn, shift), _, slips = self._moved(z)
        through = z[_THROUGH].reshape(-1, 6)
        for j, joint in enumerate(PAIRS):
            if joint in self._drags:
                path, friction, _ = self._friction(joint, slips[j], through)
                self._drags[joint].keep(path, friction)
        platform = _NUMBER["platform"]
        rotation = turn[platform] @ self._block.configuration.platform[0]
        return ExactState(rotation, shift[platform], slips, force)


Motion = tuple[Array, Array]
"""Displacement of every frame, the ground's last: rotations (11, 3, 3) and shifts (11, 3)."""


def _carried(motion: Motion, frames: Array, wrench: Array) -> Array:
    """Return at O in F wrenches (n, 6) that are fixed in displaced frames (n,)."""
    turned = both_halves(motion[0][frames], wrench)
    turned[:, 3:] += cross(motion[1][frames], turned[:, :3])
    return turned
