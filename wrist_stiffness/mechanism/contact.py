"""One-sided frictionless contact: the complementarity problem of the flanges.

    0 <= force  perpendicular to  opening = gap + A force >= 0,      A symmetric positive definite

has one solution.  Block principal pivoting (Judice and Pires 1994) finds it in a few small solves
from any guess of the active set; its fallback, one change at a time, always ends.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.compiled import NOT_DEFINITE, Flags, native
from wrist_stiffness.mechanism.components import Array

RELATIVE_TOLERANCE = 1e-12
"""An opening or force this small against the largest one counts as zero."""

PATIENCE = 5
"""Block exchanges without progress before changes are made one at a time."""

MAX_PIVOTS = 5000


def solve_contact(
    approach: Array, gap: Array, active: NDArray[np.bool_] | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Solve the contact problem of one pose.

    `approach` (m, m): A [m/N].  `gap` (m,): opening without contact forces; negative where the
    surfaces would overlap [m].  `active` (m,): first guess of the sectors in contact, usually those
    of the sample before; it leaves no trace.  Gives `force` (m,): not negative [N], and `active`
    (m,): sectors in contact.  Raises `InputError` if an input is not finite or the matrix is not
    positive definite.
    """
    if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(approach))):
        raise InputError("contact: a gap or a flexibility is not finite")
    gaps = gap.tolist()
    if min(gaps, default=0.0) >= 0.0:
        return np.zeros(len(gap)), np.zeros(len(gap), dtype=bool)
    closed = gap < 0.0 if active is None else active
    length_scale = max(max(gaps), -min(gaps))
    least_opening = -RELATIVE_TOLERANCE * length_scale
    fewest, patience = len(gap) + 1, PATIENCE
    for _ in range(MAX_PIVOTS):
        force = held_force(approach, gap, closed)
        opening = gap + approach.dot(force)
        # What is held is closed but for rounding, and what is open has no force.
        if min(force.tolist()) >= 0.0 and min(opening.tolist()) >= least_opening:
            return force, closed
        least_force = least_opening / max(approach.diagonal().tolist())
        wrong = np.where(closed, force < least_force, opening < least_opening)
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return np.maximum(force, 0.0), closed
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong[: -1 - int(np.argmax(wrong[::-1]))] = False
        closed = closed ^ wrong
    raise InputError(
        f"contact: no solution after {MAX_PIVOTS} exchanges; is the matrix positive definite?"
    )


def held_force(approach: Array, gap: Array, closed: NDArray[np.bool_]) -> Array:
    """Return the forces that close the given sectors of one pose, of either sign, (m,) [N].

    Raises `InputError` if the flexibility of these sectors is not positive definite.
    """
    force = np.zeros(len(gap))
    places, square = _places(closed.tobytes())
    if len(places):
        _, held, failed = dposv(approach.take(square), gap.take(places))
        if failed:
            raise InputError(NOT_DEFINITE)
        force[places] = -held
    return force


@lru_cache(maxsize=256)
def _places(closed: bytes) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where held sectors stand in a vector and in a raveled square matrix."""
    places = np.flatnonzero(np.frombuffer(closed, dtype=bool))
    return places, len(closed) * places[:, None] + places


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
