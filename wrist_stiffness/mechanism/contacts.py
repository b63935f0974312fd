"""One-sided contact of many samples: the problem of `contact`, again and again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.compiled import Flags, native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import NOT_DEFINITE, held_force, solve_contact


def solve_contacts(
    approach: Array, gap: Array, guess: NDArray[np.bool_] | None = None
) -> tuple[Array, Flags]:
    """Solve t contact problems of each of n samples.

    `approach` (n, m, m): A of each sample [m/N].  `gap` (n, m) or (n, t, m): openings without
    contact forces [m].  `guess`: sectors in contact to begin with, as `gap` or spread to its shape;
    leaves no trace in the result.  Gives `force`: not negative [N].  Raises `InputError` if an
    input is not finite or a matrix is not positive definite.
    """
    n, m = len(approach), approach.shape[-1]
    active = np.zeros(gap.shape, dtype=bool)
    if not gap.size:
        return np.zeros(gap.shape), active
    if guess is not None:
        active[...] = guess
    flat = np.ascontiguousarray(gap, float).reshape(-1, m)
    each = len(flat) // n
    state, force = active.reshape(-1, m), np.empty(flat.shape)
    done = 0
    if _served(m):
        matrices = np.ascontiguousarray(approach, float)
        done = native.settle(matrices, flat, state, force, n, each, m)
    for place in range(done, len(flat)):
        given = None if guess is None else state[place]
        force[place], state[place] = solve_contact(approach[place // each], flat[place], given)
    return force.reshape(gap.shape), active


def forces_of(approach: Array, gap: Array, closed: Flags) -> Array:
    """Return the forces that close the given sectors, of either sign: the tangent of contact.

    `approach` (n, m, m): A [m/N]; `gap` (n, m) or (n, t, m): openings without contact forces [m];
    `closed` (n, m): sectors held closed.  Gives forces, linear in it; zero where not held [N].
    Raises `InputError` if a matrix is not positive definite.
    """
    n, m = closed.shape
    if not gap.size:
        return np.zeros(gap.shape)
    columns = np.ascontiguousarray(gap, float).reshape(n, -1, m)
    force = np.zeros(columns.shape)
    if _served(m):
        own = np.ascontiguousarray(approach, float), columns, np.ascontiguousarray(closed), force
        if native.hold(*own, n, columns.shape[1], m) < n:
            raise InputError(NOT_DEFINITE)
        return force.reshape(gap.shape)
    for row in range(n):
        for column, own_gap in enumerate(columns[row]):
            force[row, column] = held_force(approach[row], own_gap, closed[row])
    return force.reshape(gap.shape)


def _served(sectors: int) -> bool:
    """Tell whether the compiled formulas serve so many sectors."""
    return native is not None and sectors <= native.MOST_SECTORS
