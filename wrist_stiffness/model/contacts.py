"""Flange contact of many samples at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import RELATIVE_TOLERANCE, solve_contact

FEW = 4
"""Up to this many samples are solved one by one."""

STRIDE = 8

MAX_EXCHANGES = 12
"""Block exchanges of the whole stack; samples that are not done then are solved one by one."""


def solve_contacts(
    approach: Array, gap: Array, active: NDArray[np.bool_] | None
) -> tuple[Array, NDArray[np.bool_]]:
    """Solve the contact problem of n samples.

    Samples that share a contact state are solved together; their solutions are unique, so the way
    there does not show beyond rounding.

    Parameters
    ----------
    approach : (n, m, m) float
        A [m/N].
    gap : (n, m) float
        Openings without contact forces [m].
    active : (m,) or (n, m) bool or None
        First guess for all or for each.

    Returns
    -------
    force : (n, m) float
        Not negative [N].
    active : (n, m) bool
        Sectors in contact.

    Raises
    ------
    InputError
        If an input is not finite or a matrix is not positive definite.
    """
    n, m = gap.shape
    force = np.zeros((n, m))
    closed = np.zeros((n, m), dtype=bool)
    if n > STRIDE * FEW and (active is None or active.ndim == 1):
        # Neighbours in time share most of their contact state: every eighth sample guesses for all.
        active = np.repeat(solve_contacts(approach[::STRIDE], gap[::STRIDE], active)[1], STRIDE, 0)
        active = active[:n]
    if active is not None:
        closed[:] = active
    open_rows = np.arange(n)
    if n > FEW and m:
        size = np.max(np.abs(gap), axis=1)
        force_size = size / np.max(np.diagonal(approach, axis1=1, axis2=2), axis=1)
        for _ in range(MAX_EXCHANGES):
            force[open_rows] = forces_of(approach[open_rows], gap[open_rows], closed[open_rows])
            opening = gap[open_rows] + (approach[open_rows] @ force[open_rows][..., None])[..., 0]
            wrong = np.where(
                closed[open_rows],
                force[open_rows] < -RELATIVE_TOLERANCE * force_size[open_rows, None],
                opening < -RELATIVE_TOLERANCE * size[open_rows, None],
            )
            closed[open_rows] ^= wrong
            open_rows = open_rows[wrong.any(axis=1)]
            if len(open_rows) == 0:
                return np.maximum(force, 0.0), closed
    for row in open_rows:
        force[row], closed[row] = solve_contact(approach[row], gap[row], closed[row].copy())
    return force, closed


def forces_of(approach: Array, gap: Array, closed: NDArray[np.bool_]) -> Array:
    """Return the forces that close the given sectors, of either sign: the tangent of contact.

    Parameters
    ----------
    approach : (n, m, m) float
        A [m/N].
    gap : (n, m) float
        Openings without contact forces [m].
    closed : (n, m) bool
        Sectors held closed.

    Returns
    -------
    (n, m) float
        Forces, linear in `gap`; zero where not held [N].
    """
    force = np.zeros_like(gap)
    patterns, which = np.unique(np.packbits(closed, axis=1), axis=0, return_inverse=True)
    for number in range(len(patterns)):
        rows = np.flatnonzero(which.ravel() == number)
        held = np.flatnonzero(closed[rows[0]])
        if len(held):
            own = np.ix_(rows, held)
            matrix = approach[np.ix_(rows, held, held)]
            force[own] = np.linalg.solve(matrix, -gap[own][..., None])[..., 0]
    return force
