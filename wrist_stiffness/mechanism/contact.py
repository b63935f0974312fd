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

BLOCK_STEPS = 12
"""Block exchanges for many poses together before the rest are solved one by one."""


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
    softest = float(np.max(np.diagonal(approach)))
    if softest <= 0.0:
        raise InputError("contact: the flexibility of the flanges is not positive definite")
    force_scale = length_scale / softest
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


def solve_contacts(approach: Array, gap: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Solve the contact problems of many poses together.

    The same block exchanges as `solve_contact`, for all poses at once; the few poses that do not
    settle in `BLOCK_STEPS` are left to it.  Results agree with it to rounding, not to the bit.

    Parameters
    ----------
    approach : (n, m, m) float
        A of each pose [m/N].
    gap : (n, m) float
        Opening of each gap without contact forces [m].

    Returns
    -------
    force : (n, m) float
        Contact forces, not negative [N].
    active : (n, m) bool
        Sectors in contact.

    Raises
    ------
    InputError
        If an input is not finite or a matrix is not positive definite.
    """
    if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(approach))):
        raise InputError("contact: a gap or a flexibility is not finite")
    force, closed = np.zeros(gap.shape), gap < 0.0
    pending = np.flatnonzero(np.any(closed, axis=-1))
    for _ in range(BLOCK_STEPS):
        if len(pending) == 0:
            return force, closed
        a, g, c = approach[pending], gap[pending], closed[pending]
        # Sectors that do not touch get an equation of their own: their force is zero.
        both = c[:, :, None] & c[:, None, :]
        alone = np.eye(g.shape[-1]) * np.max(np.abs(a), axis=(-1, -2))[:, None, None]
        try:
            f = np.linalg.solve(np.where(both, a, alone), np.where(c, -g, 0.0)[..., None])[..., 0]
        except np.linalg.LinAlgError:
            break
        opening = g + np.einsum("nij,nj->ni", a, f)
        length_scale = np.max(np.abs(g), axis=-1, keepdims=True)
        force_scale = length_scale / np.max(np.diagonal(a, axis1=-2, axis2=-1), axis=-1)[:, None]
        wrong = np.where(
            c, f < -RELATIVE_TOLERANCE * force_scale, opening < -RELATIVE_TOLERANCE * length_scale
        )
        settled = ~np.any(wrong, axis=-1) & np.all(np.isfinite(f), axis=-1)
        force[pending[settled]] = np.maximum(f[settled], 0.0)
        closed[pending] ^= wrong
        pending = pending[~settled]
    for pose in pending:
        force[pose], closed[pose] = solve_contact(approach[pose], gap[pose])
    return force, closed
