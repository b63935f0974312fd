"""Fast path: equilibrium at a pose, with contact and with laws that bend with the load.

The complementary energy of all parts is convex in the flange forces, so the equilibrium is unique:

    0 <= lambda  perpendicular to  gap + B'W + sum_k N_k delta_k(w_k) + A lambda >= 0
    w_k = wrench through component k = G_k'W + own weight + N_k' lambda

It is found by Newton's method over all samples of a block at once; each step is a contact problem
with the tangent flexibilities of the laws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import PASSIVE_JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contacts
from wrist_stiffness.mechanism.influence import Influence, influence
from wrist_stiffness.mechanism.statics import (
    ContactOperators,
    component_rotations,
    contact_operators,
    platform_twist,
    weight_wrench,
)
from wrist_stiffness.mechanism.vectors import block_diagonal

Bend = Callable[[Array], tuple[Array, Array]]
"""Law of one component: wrench (n, 6) to screw (n, 6) and its symmetric tangent (n, 6, 6)."""

MAX_STEPS = 60
FORCE_TOLERANCE = 1e-9
"""A change of the flange forces this small against the largest one ends the iteration."""

SMALL_FORCE = 1e-6
"""Flange forces below this do not count [N]."""

BISECTIONS = 12

FLAT = 0.3
"""A search along a line ends where its slope has fallen to this share of the one at its start."""


@dataclass(frozen=True)
class Equilibrium:
    """Solution of a block of n samples."""

    twist: Array  # (n, 6), of the platform at O in F [m, rad]
    through: Array  # (n, 8, 6), wrench through each component at O in F [N, N m]
    # (n, 3, 2), slide [m] and small turn [rad] of joint_2 to joint_4 besides the rigid motion
    slips: Array
    force: Array  # (n, m), of each flange sector [N]
    closed: NDArray[np.bool_]  # (n, m), sectors in contact


class Pose:
    """The elastic wrist at a block of poses, ready to be loaded.

    `configuration`: of n samples; `parts`: of the true wrist; `gravity` (3,): in F [m/s^2].
    """

    def __init__(
        self, configuration: Configuration, parts: ElasticComponents, gravity: Array
    ) -> None:
        self.projectors: Influence = influence(configuration)
        self.operators: ContactOperators = contact_operators(configuration, parts, gravity)
        self.rows = self.projectors.slides()
        self._carry = block_diagonal(np.swapaxes(self.projectors.of_components(), -1, -2))
        self._weight = weight_wrench(configuration, parts, gravity, self.projectors)
        rotation = block_diagonal(component_rotations(configuration))
        self.flexibility = rotation @ parts.flexibility @ np.swapaxes(rotation, -1, -2)
        own = parts.sectors.component
        self._own = own
        turned = rotation.take(own, axis=-3) @ parts.sectors.screw[..., None]
        self._sector_screw = turned[..., 0]

    def friction_wrench(self, friction: Array) -> Array:
        """Wrench through each component (n, 8, 6) of friction in joint_2 to joint_4.

        `friction` (n, 3, 2): force and torque along each axis, of the joint's outer body on the
        inner one's hub [N, N m]; they act on slide and turn.
        """
        halves = np.einsum("nkjx,njh->nkhx", self.rows, friction)
        return halves.reshape(*halves.shape[:2], 6)

    def give(self, state: Equilibrium, bends: Sequence[tuple[int, Bend]]) -> Array:
        """Return what unit friction of each passive joint moves there, (n, 3, 2, 2).

        `state`: whose touching flanges and slopes of the laws count; `bends`: as in `solve`.  Gives
        (n, 3, 2, 2): slide and turn by force and torque along the axis.
        """
        soft = self.flexibility.copy()
        for k, law in bends:
            soft[:, k] += law(state.through[:, k])[1]
        n_k, on = self.operators.screw_gap, state.closed
        tangent = self.operators.approach.copy()
        for k in {k for k, _ in bends}:
            down = n_k[:, :, k] @ (soft[:, k] - self.flexibility[:, k])
            tangent += down @ np.swapaxes(n_k[:, :, k], -1, -2)
        # Rows of flanges that do not touch are the identity's, and nothing pushes on them.
        tangent = np.where(on[:, :, None] & on[:, None, :], tangent, np.eye(on.shape[1]))
        out = np.empty((len(on), len(PASSIVE_JOINTS), 2, 2))
        for j in range(len(PASSIVE_JOINTS)):
            rows = self.rows[:, :, j]
            halves = np.zeros((*rows.shape[:2], 2, 6))
            halves[:, :, 0, :3] = halves[:, :, 1, 3:] = rows
            bent = halves @ soft
            out[:, j] = (bent @ np.swapaxes(halves, -1, -2)).sum(axis=1)
            opened = np.einsum("nkhi,nmki->nhm", bent, n_k)
            opened += np.einsum("nmhi,nmi->nhm", halves[:, self._own], self._sector_screw)
            opened *= on[:, None]
            pressed = np.linalg.solve(tangent, np.swapaxes(opened, -1, -2))
            out[:, j] -= opened @ pressed
        return out

    def solve(
        self,
        load: Array,
        screws: Array,
        bends: Sequence[tuple[int, Bend]] = (),
        extra: Array | None = None,
        near: Equilibrium | None = None,
    ) -> Equilibrium:
        """Find the equilibrium.

        `load` (n, 6): wrench on the platform at O in F; `screws` (n, 8, 6): screws at the
        components that no wrench changes [m, rad]; `bends`: number of a component and its law
        besides its elasticity; `extra` (n, 8, 6): wrench through the components from inside the
        wrist, friction for instance; `near`: where the iteration begins.  Raises `InputError` if
        Newton's method does not converge.
        """
        ops, n_k = self.operators, self.operators.screw_gap
        free = self._weight + (self._carry @ load[:, None, :, None])[..., 0]
        gap = ops.gap + _times(np.swapaxes(ops.force_twist, -1, -2), load)
        given = screws
        if extra is not None:
            free = free + extra
            given = given + (self.flexibility @ extra[..., None])[..., 0]
            gap = gap + np.einsum("nmi,nmi->nm", self._sector_screw, extra.take(self._own, axis=1))
        n, m = gap.shape
        flat = n_k.reshape(n, m, given[0].size)
        gap = gap + _times(flat, given.reshape(n, -1))
        force, closed = self._contact(gap, free, bends, near)
        through = free + _times(np.swapaxes(flat, -1, -2), force).reshape(free.shape)
        total = given.copy()
        for k, law in bends:
            total[:, k] += law(through[:, k])[0]
        twist = (
            ops.weight_twist
            + _times(ops.compliance, load)
            + _times(ops.force_twist, force)
            + platform_twist(self.projectors, total)
        )
        elastic = (self.flexibility @ (through - (0.0 if extra is None else extra))[..., None])[
            ..., 0
        ]
        belongs = np.eye(elastic.shape[1])[self._own]
        own = belongs.T @ (self._sector_screw * force[..., None])
        whole = total + elastic + own
        halves = whole.reshape(*whole.shape[:2], 2, 3)
        slips = np.einsum("nkji,nkhi->njh", self.rows, halves)
        return Equilibrium(twist, through, slips, force, closed)

    def _contact(
        self,
        gap: Array,
        free: Array,
        bends: Sequence[tuple[int, Bend]],
        near: Equilibrium | None,
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return forces and contact state for gaps (n, m) and wrenches (n, 8, 6) without them."""
        approach, n_k = self.operators.approach, self.operators.screw_gap
        force, closed = np.zeros_like(gap), np.zeros(gap.shape, dtype=bool)
        if near is not None:
            force, closed = near.force, near.closed.copy()
        if gap.shape[1] == 0:
            return force, closed

        def bent(at: Array) -> list[tuple[Array, Array, Array]]:
            return [
                (n_k[:, :, k], *law(free[:, k] + _times(np.swapaxes(n_k[:, :, k], -1, -2), at)))
                for k, law in bends
            ]

        def opening(at: Array) -> Array:
            out = gap + _times(approach, at)
            return out + sum(_times(rows, screw) for rows, screw, _ in bent(at))

        todo = np.arange(len(gap))
        for _ in range(MAX_STEPS):
            tangent_gap, tangent = gap[todo], approach[todo]
            for rows, screw, slope in bent(force):
                down = rows[todo] @ slope[todo]
                linear = screw[todo] - _times(np.swapaxes(down, -1, -2), force[todo])
                tangent_gap = tangent_gap + _times(rows[todo], linear)
                tangent = tangent + down @ np.swapaxes(rows[todo], -1, -2)
            new, closed[todo] = solve_contacts(tangent, tangent_gap, closed[todo])
            if not bends:
                return new, closed
            change = np.zeros_like(gap)
            change[todo] = new - force[todo]
            scale = np.max(np.abs(new), axis=1, initial=SMALL_FORCE)
            moves = np.any(np.abs(change[todo]) > FORCE_TOLERANCE * scale[:, None], axis=1)
            if not moves.any():
                force[todo] = new
                return force, closed
            force = force + _step_length(opening, force, change)[:, None] * change
            todo = todo[moves]
        worst = float(np.max(np.abs(change)))
        raise InputError(
            f"true wrist: no equilibrium after {MAX_STEPS} steps; "
            f"flange forces still change by {worst:.2e} N"
        )


def _times(matrix: Array, vector: Array) -> Array:
    """Return (n, i, j) times (n, j); a stack of products is several times as fast as einsum."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _step_length(opening: Callable[[Array], Array], force: Array, change: Array) -> Array:
    """Return how far to go from `force` by `change` (n, m) towards the least energy, (n,) to 1.

    The slope of the convex energy along the way is the opening times the change; where a full
    step would pass its zero, bisection comes near it.
    """

    def slope(share: Array | float) -> Array:
        return np.sum(opening(force + np.reshape(share, (-1, 1)) * change) * change, axis=1)

    low, middle, high = np.zeros(len(force)), np.ones(len(force)), np.ones(len(force))
    here = slope(1.0)
    if not (here > 0.0).any():
        return middle
    enough = np.where(here > 0.0, FLAT * np.abs(slope(0.0)), np.inf)
    for _ in range(BISECTIONS):
        search = np.abs(here) > enough
        if not search.any():
            break
        high = np.where(search & (here > 0.0), middle, high)
        low = np.where(search & (here <= 0.0), middle, low)
        middle = np.where(search, 0.5 * (low + high), middle)
        here = slope(middle)
    return middle
