"""The wrist's elastic operators as spline columns that keep their definiteness.

[[C, B], [B', A]] is the flexibility of the whole wrist to the platform's wrench and to the contact
forces together, hence positive definite.  Interpolated entry by entry it would lose that between
the nodes; its Cholesky factor keeps it.
"""

from __future__ import annotations

import numpy as np

from wrist_stiffness.errors import TableError
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import ContactOperators


def column_count(sectors: int) -> int:
    """Return how many spline columns a pose has with this many flange sectors."""
    size = 6 + sectors
    return size * (size + 1) // 2 + sectors + 6


def pack(operators: ContactOperators) -> Array:
    """Return the operators at n poses as spline columns.

    `operators`: at n poses.  Gives (n, columns): lower Cholesky factor of [[C, B], [B', A]], then
    gaps, then the twist of own weight.  Raises `TableError` if the flexibility is not positive
    definite at a pose.
    """
    b_transposed = np.swapaxes(operators.force_twist, -1, -2)
    whole = np.concatenate(
        [
            np.concatenate([operators.compliance, operators.force_twist], axis=-1),
            np.concatenate([b_transposed, operators.approach], axis=-1),
        ],
        axis=-2,
    )
    try:
        factor = np.linalg.cholesky(whole)
    except np.linalg.LinAlgError as error:
        raise TableError("the wrist's flexibility is not positive definite at a node") from error
    rows, columns = np.tril_indices(whole.shape[-1])
    return np.concatenate(
        [factor[..., rows, columns], operators.gap, operators.weight_twist], axis=-1
    )


def column_sizes(columns: Array, sectors: int) -> Array:
    """Return the natural size of each spline column, to compare tables by.

    A factor's entry is measured by its row, whose length is the root of a diagonal flexibility:
    an entry that vanishes by symmetry is rounding and has no size of its own.

    `columns` (n, columns): as `pack` orders them; `sectors`: flange sectors m.  Gives (columns,):
    positive, in the columns' units.
    """
    size = 6 + sectors
    rows, _ = np.tril_indices(size)
    largest = np.max(np.abs(columns), axis=0)
    sizes = np.empty(columns.shape[1])
    for row in range(size):
        belongs = np.flatnonzero(rows == row)
        sizes[belongs] = np.linalg.norm(largest[belongs])
    gaps = slice(len(rows), len(rows) + sectors)
    shift, turn = slice(gaps.stop, gaps.stop + 3), slice(gaps.stop + 3, gaps.stop + 6)
    for group in (gaps, shift, turn):
        sizes[group] = np.max(largest[group], initial=0.0)
    return np.where(sizes > 0.0, sizes, 1.0)


def unpack(
    columns: Array, components: ElasticComponents, configuration: Configuration
) -> ContactOperators:
    """Return the operators from interpolated spline columns.

    `columns` (..., columns): as `pack` orders them; `components`: of the table: they say which
    joint each sector belongs to; `configuration`: the poses, for the slides that a screw at a
    component makes (kinematics, not elasticity).  Gives `ContactOperators`: C and A positive
    semi-definite at every pose.
    """
    slide = components.sectors.slide
    m = len(slide)
    size = 6 + m
    rows, places = np.tril_indices(size)
    factor = np.zeros((*columns.shape[:-1], size, size))
    factor[..., rows, places] = columns[..., : len(rows)]
    whole = factor @ np.swapaxes(factor, -1, -2)
    return ContactOperators(
        compliance=whole[..., :6, :6],
        force_twist=whole[..., :6, 6:],
        approach=whole[..., 6:, 6:],
        gap=columns[..., len(rows) : len(rows) + m],
        weight_twist=columns[..., len(rows) + m :],
        slide=slide,
        slides=influence(configuration).slides(),
    )
