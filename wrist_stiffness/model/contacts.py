"""Flange contact of many samples at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import RELATIVE_TOLERANCE, solve_contact

FEW = 4
"""Up to this many samples are solved one by one."""

STRIDE = 8
"""Neighbours in time share most of their contact state: one in so many guesses for all."""

WIDTH = 8
"""Samples whose numbers of held sectors round up to the same multiple are solved together."""

MANY = 64
"""Fewer samples than that are one stack: a call costs more than the larger matrices."""

MAX_EXCHANGES = 12
"""Block exchanges of the whole stack; samples that are not done then are solved one by one."""


@dataclass(frozen=True)
class Held:
    """A contact state of n samples with the forces that hold it: the guess for a like problem.

    Parameters
    ----------
    active : (n, m) bool
        Sectors in contact.
    stiffness : (n, m, m) float
        Forces for a unit opening of each sector that does not happen, zero where not in contact
        [N/m].
    """

    active: NDArray[np.bool_]
    stiffness: Array

    @classmethod
    def of(cls, approach: Array, active: NDArray[np.bool_]) -> Held:
        """Return the held state for flexibilities A (n, m, m) [m/N]."""
        stiffness = np.zeros_like(approach)
        for rows, places, held, matrix in _held(approach, active):
            both = held[:, :, None] & held[:, None, :]
            inverse = np.where(both, np.linalg.inv(matrix), 0.0)
            stiffness[rows[:, None, None], places[:, :, None], places[:, None, :]] = inverse
        return cls(active, stiffness)


def solve_contacts(
    approach: Array, gap: Array, guess: NDArray[np.bool_] | Held | None
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
    guess : (m,) or (n, m) bool or Held or None
        Sectors in contact of a sample before or of each sample, or all that is known of a problem
        with the same A.

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
    if isinstance(guess, Held):
        force, closed = solve_alike(approach, gap[..., None], guess)
        return force[..., 0], closed[..., 0]
    closed = gap < 0.0
    if guess is not None and guess.ndim == 2:
        closed[:] = guess
    elif n > STRIDE * FEW:
        coarse = solve_contacts(approach[::STRIDE], gap[::STRIDE], guess)[1]
        closed[:] = np.repeat(coarse, STRIDE, axis=0)[:n]
    elif guess is not None:
        closed[:] = guess
    force = forces_of(approach, gap, closed) if n > FEW else np.zeros((n, m))
    open_rows = np.arange(n)
    if n > FEW and m:
        wrong = _wrong_rows(approach, gap, force, closed)
        for _ in range(MAX_EXCHANGES):
            closed[open_rows] ^= wrong
            open_rows = open_rows[wrong.any(axis=1)]
            if len(open_rows) == 0:
                return np.maximum(force, 0.0), closed
            left = approach[open_rows], gap[open_rows]
            force[open_rows] = forces_of(*left, closed[open_rows])
            wrong = _wrong_rows(*left, force[open_rows], closed[open_rows])
    for row in open_rows:
        force[row], closed[row] = solve_contact(approach[row], gap[row], closed[row].copy())
    return force, closed


def solve_alike(approach: Array, gap: Array, held: Held) -> tuple[Array, NDArray[np.bool_]]:
    """Solve t contact problems of n samples that share their flexibilities.

    Parameters
    ----------
    approach : (n, m, m) float
        A [m/N].
    gap : (n, m, t) float
        Openings without contact forces [m].
    held : Held
        A contact state near those of the solutions, with the same A.

    Returns
    -------
    force : (n, m, t) float
        Not negative [N].
    active : (n, m, t) bool
        Sectors in contact.
    """
    force = -(held.stiffness @ gap)
    closed = np.repeat(held.active[..., None], gap.shape[-1], axis=-1)
    if gap.shape[1]:
        wrong = _wrong(approach, gap, force, held.active[..., None])
        row, problem = np.nonzero(wrong.any(axis=1))
        if len(row):
            closed ^= wrong
            force[row, :, problem], closed[row, :, problem] = solve_contacts(
                approach[row], gap[row, :, problem], closed[row, :, problem]
            )
    return np.maximum(force, 0.0), closed


def _wrong(
    approach: Array, gap: Array, force: Array, closed: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell where a held sector pulls or an open one overlaps, (n, m, t)."""
    opening = gap + approach @ force
    size = np.max(np.abs(gap), axis=1, keepdims=True)
    stiffest = np.max(np.diagonal(approach, axis1=1, axis2=2), axis=1)[:, None, None]
    pulls = force < -RELATIVE_TOLERANCE * size / stiffest
    overlaps = opening < -RELATIVE_TOLERANCE * size
    return np.where(closed, pulls, overlaps)


def _wrong_rows(
    approach: Array, gap: Array, force: Array, closed: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell the same of one problem a sample, (n, m)."""
    return _wrong(approach, gap[..., None], force[..., None], closed[..., None])[..., 0]


def forces_of(approach: Array, gap: Array, closed: NDArray[np.bool_]) -> Array:
    """Return the forces that close the given sectors, of either sign: the tangent of contact.

    Parameters
    ----------
    approach : (n, m, m) float
        A [m/N].
    gap : (n, m) or (n, m, t) float
        Openings without contact forces, or t of them [m].
    closed : (n, m) bool
        Sectors held closed.

    Returns
    -------
    (n, m) or (n, m, t) float
        Forces, linear in `gap`; zero where not held [N].
    """
    columns = gap if gap.ndim == 3 else gap[..., None]
    force = np.zeros_like(columns)
    for rows, places, held, matrix in _held(approach, closed):
        own = rows[:, None], places
        force[own] = np.linalg.solve(matrix, np.where(held[..., None], -columns[own], 0.0))
    return force.reshape(gap.shape)


def _held(
    approach: Array, closed: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_], Array]]:
    """Yield stacks of samples that hold about as many sectors: one factorisation each.

    Yields
    ------
    rows : (r,) int
        The samples.
    places : (r, k) int
        Their k sectors, the held ones first.
    held : (r, k) bool
        Which of these are held.
    matrix : (r, k, k) float
        A of the held sectors; the others have an equation of their own, 1.
    """
    n, m = closed.shape
    if n == 1:
        # One sample after the other comes this way as well.
        (alone,) = np.nonzero(closed[0])
        if len(alone):
            matrix = approach[:, alone[:, None], alone]
            yield np.zeros(1, dtype=np.intp), alone[None], np.ones((1, len(alone)), bool), matrix
        return
    count = np.count_nonzero(closed, axis=1)
    width = WIDTH if n > MANY else max(1, int(count.max(initial=0)))
    stack = -(-count // width)
    for number in np.flatnonzero(np.bincount(stack)[1:]) + 1:
        rows = np.flatnonzero(stack == number)
        k = min(int(number) * width, m)
        places = np.argsort(~closed[rows], axis=1, kind="stable")[:, :k]
        held = np.arange(k) < count[rows, None]
        square = (rows * m)[:, None, None] * m + m * places[:, :, None] + places[:, None, :]
        both = held[:, :, None] & held[:, None, :]
        yield rows, places, held, np.where(both, approach.take(square), np.eye(k))
