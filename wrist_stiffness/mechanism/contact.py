"""One-sided frictionless contact: the complementarity problem of the flanges.

    0 <= force  perpendicular to  opening = gap + A force >= 0,      A symmetric positive definite

has one solution.  Block principal pivoting (Judice and Pires 1994) finds it in a few small solves
from any guess of the active set; its fallback, one change at a time, always ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
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

    Parameters
    ----------
    approach : (m, m) float
        A [m/N].
    gap : (m,) float
        Opening without contact forces; negative where the surfaces would overlap [m].
    active : (m,) bool, optional
        First guess of the sectors in contact, usually those of the sample before.

    Returns
    -------
    force : (m,) float
        Contact forces, not negative [N].
    active : (m,) bool
        Sectors in contact.

    Raises
    ------
    InputError
        If shapes do not fit, an input is not finite or the matrix is not positive definite.
    """
    m = len(gap)
    if approach.shape != (m, m) or (active is not None and active.shape != (m,)):
        guess = "" if active is None else f" and a guess of shape {active.shape}"
        raise InputError(f"contact: {m} gaps, but a flexibility of shape {approach.shape}{guess}")
    if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(approach))):
        raise InputError("contact: a gap or a flexibility is not finite")
    closed = np.zeros(m, dtype=bool) if active is None else active.copy()
    force = np.zeros(m)
    if not np.any(closed) and np.all(gap >= 0.0):
        return force, closed
    length_scale = float(np.max(np.abs(gap)))
    force_scale = length_scale / float(np.max(np.diagonal(approach)))
    fewest, patience = m + 1, PATIENCE
    for _ in range(MAX_PIVOTS):
        force[:] = 0.0
        if np.any(closed):
            try:
                force[closed] = np.linalg.solve(approach[np.ix_(closed, closed)], -gap[closed])
            except np.linalg.LinAlgError as error:
                raise InputError("contact: the flexibility of the flanges is singular") from error
        opening = gap + approach @ force
        wrong = np.where(
            closed,
            force < -RELATIVE_TOLERANCE * force_scale,
            opening < -RELATIVE_TOLERANCE * length_scale,
        )
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return np.maximum(force, 0.0), closed
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong[: -1 - int(np.argmax(wrong[::-1]))] = False
        closed ^= wrong
    raise InputError(
        f"contact: no solution after {MAX_PIVOTS} exchanges; is the matrix positive definite?"
    )
