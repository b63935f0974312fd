"""Exact path: equilibrium of all bodies at once, with finite rotations and without the influence G.

Unknown are the displacements of ten frames, the wrenches through eight components, the reactions of
three cylindrical pairs and the flange forces.  Forces balance on the displaced bodies, pairs close
exactly, flanges are part of the same solution.  Slow: it judges the fast paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.statics import component_rotations, turned_flexibilities
from wrist_stiffness.mechanism.vectors import block_diagonal, both_halves, cross

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
NEAR, FAR = np.array([[_NUMBER[frame] for frame in two] for two in _JOINED]).T
"""Number of the near and of the far frame of each component, then of each pair, (11,)."""

_HEAVY = np.concatenate([NEAR[: len(ELASTIC)], FAR[: len(ELASTIC)], [_NUMBER["platform"]]])
"""Frames that carry weights: both sides of each component, and the platform, (17,)."""

_INCIDENCE = np.eye(len(_NUMBER))[FAR] - np.eye(len(_NUMBER))[NEAR]
_APART = np.kron(_INCIDENCE[:, : len(FRAMES)], np.eye(6))
"""From small screws of all frames to those of the far frames against the near ones, (66, 60)."""

PAIRS_APART = _APART[6 * len(ELASTIC) :].reshape(len(PAIRS), 6, -1)

SCREW = slice(0, 6 * len(FRAMES))
THROUGH = slice(SCREW.stop, SCREW.stop + 6 * len(ELASTIC))
_REACTION = slice(THROUGH.stop, THROUGH.stop + 4 * len(PAIRS))
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


def exact_equilibrium(table: Table, theta: Array, load: Array) -> ExactState:
    """Find the equilibrium of a table's wrist at a pose.

    `theta` (2,): True motor angles [rad]; `load` (6,): wrench on the platform at O in F [N, N m].
    Raises `InputError` if the iteration does not end.
    """
    configuration = table.mechanism.forward(theta[None])
    return Equations(configuration, table.components, table.geometry.gravity, load).solve()


class Equations:
    """Residual and tangent of one pose, of a configuration of shape (1,)."""

    def __init__(
        self, configuration: Configuration, parts: ElasticComponents, gravity: Array, load: Array
    ) -> None:
        self._rigid, self._gravity, self._load = configuration.platform[0], gravity, load
        self._flexibility = turned_flexibilities(configuration, parts)[0]
        turns = component_rotations(configuration)[0]
        axes = [axis[0] for axis in (configuration.b, configuration.c, configuration.d)]
        # Rows of each pair: slide and turn (3, 2, 6), and what it locks (3, 4, 6).
        self.along = np.stack([np.kron(np.eye(2), axis) for axis in axes])
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
        self._linear = self._linear_tangent()

    def solve(self) -> ExactState:
        """Newton's method; each step is a contact problem of the linear wrist at hand.

        The tangent leaves out what finite rotations add, so the last digits come linearly.
        """
        z = np.zeros(_SIZE)
        force, closed = np.zeros(len(self._gap)), None
        # How z opens the gaps (m, size), and how forces enter the residual (size, m).
        pull = np.zeros((len(self._gap), _SIZE))
        pull[:, SCREW] = np.einsum("mj,jx,jxz->mz", self._slide, self.along[:, 0], PAIRS_APART)
        rows = THROUGH.start + 6 * self._own[:, None] + np.arange(6)
        np.put_along_axis(pull, rows, self._sector_screw / MICRO, axis=1)
        push = pull.T.copy()
        push[THROUGH] *= -1.0
        for step in range(MAX_STEPS):
            rest, tangent, gap = self.residual(z, force)
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
                return self.state(z, force)
        raise InputError(
            f"exact wrist: no equilibrium after {MAX_STEPS} steps, "
            f"the last changed by {np.max(np.abs(change)):.1e}"
        )

    def residual(self, z: Array, force: Array) -> tuple[Array, Array, Array]:
        """Return residual, tangent over z, and the gaps; lengths in micrometres."""
        through, reaction = z[THROUGH].reshape(-1, 6), z[_REACTION].reshape(-1, 4)
        motion, apart, slips = self.moved(z)
        given = np.einsum("kij,kj->ki", self._flexibility, through)
        np.add.at(given, self._own, self._sector_screw * force[:, None])
        bent = apart[: len(ELASTIC)] - given
        closure = np.einsum("jax,jx->ja", self._across, apart[len(ELASTIC) :])
        gap = self._gap + self._approach @ force + self._slide @ slips[:, 0]
        gap += np.einsum("mi,mi->m", self._sector_screw, through[self._own])
        # Components and pairs resist: what moves the far side away is pulled back.
        locked = np.einsum("jax,ja->jx", self._across, reaction)
        locked -= (self._slide.T @ force)[:, None] * self.along[:, 0]
        wrench = carried(motion, NEAR, np.concatenate([through, locked]))
        balance = np.zeros((len(FRAMES) + 1, 6))
        balance[_NUMBER["platform"]] += self._load
        np.add.at(balance, FAR, -wrench)
        np.add.at(balance, NEAR, wrench)
        felt = np.swapaxes(motion[0][_HEAVY], -1, -2) @ self._gravity
        weight = (self._weights @ felt[..., None])[..., 0]
        np.add.at(balance, _HEAVY, carried(motion, _HEAVY, weight))
        lengths = np.concatenate([bent.ravel(), closure.ravel()])
        whole = np.concatenate([balance[:-1].ravel(), lengths / MICRO])
        return whole, self._linear.copy(), gap / MICRO

    def moved(self, z: Array) -> tuple[Motion, Array, Array]:
        """Return the motion, the twists (11, 6) of far frames in near ones, and slips (3, 2)."""
        screw = np.concatenate([z[SCREW].reshape(-1, 6), np.zeros((1, 6))])
        turn, shift = exp_twist(MICRO * screw)
        back = np.swapaxes(turn[NEAR], -1, -2)
        between = (back @ (shift[FAR] - shift[NEAR])[..., None])[..., 0]
        apart = log_motion(back @ turn[FAR], between)
        return (turn, shift), apart, np.einsum("jhx,jx->jh", self.along, apart[len(ELASTIC) :])

    def _linear_tangent(self) -> Array:
        """Return the tangent without finite rotations."""
        out = np.zeros((_SIZE, _SIZE))
        pairs = np.concatenate(self._across @ PAIRS_APART)
        out[SCREW.stop :, SCREW] = np.concatenate([_APART[: THROUGH.stop - SCREW.stop], pairs])
        out[SCREW, SCREW.stop :] = -out[SCREW.stop :, SCREW].T
        out[THROUGH, THROUGH] = -block_diag(*self._flexibility) / MICRO
        return out

    def state(self, z: Array, force: Array) -> ExactState:
        """Return what the unknowns are for the platform and its pairs."""
        (turn, shift), _, slips = self.moved(z)
        platform = _NUMBER["platform"]
        return ExactState(turn[platform] @ self._rigid, shift[platform], slips, force)


Motion = tuple[Array, Array]
"""Displacement of every frame, the ground's last: rotations (11, 3, 3) and shifts (11, 3)."""


def carried(motion: Motion, frames: Array, wrench: Array) -> Array:
    """Return at O in F wrenches (n, 6) that are fixed in displaced frames (n,)."""
    turned = both_halves(motion[0][frames], wrench)
    turned[:, 3:] += cross(motion[1][frames], turned[:, :3])
    return turned
