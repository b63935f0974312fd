"""Axes on cones about other axes: the formula behind the closure and the inverse kinematics."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross, skew

GRAM_ROUNDING = 1e-15
"""A Gram determinant of three unit axes up to here is rounding: they are coplanar."""


def gram_determinant(k: Array, cos_u: float, cos_v: float) -> Array:
    """Return the Gram determinant of unit u, v, w: the square of w . (u x v), (...).

    Negative where no w has these cosines.

    `k` (...): u . v.  `cos_u`, `cos_v`: w . u and w . v.
    """
    return 1.0 - k * k - cos_u * cos_u - cos_v * cos_v + 2.0 * cos_u * cos_v * k


def third_axis(
    u: Array, v: Array, across: Array, k: Array, cos_u: float, cos_v: float, determinant: Array
) -> Array:
    """Return the unit axes w with given cosines to unit u and v, and given w . (u x v).

    `u`, `v`, `across` (..., 3): unit axes, and u x v.  `k` (...): u . v, not +1 or -1.  `cos_u`,
    `cos_v`: w . u and w . v.  `determinant` (...): square root of `gram_determinant`; its sign
    chooses one of the two axes.  Gives (..., 3): unit axes, but for rounding.
    """
    scale = 1.0 / (1.0 - k * k)
    return (
        ((cos_u - k * cos_v) * scale)[..., None] * u
        + ((cos_v - k * cos_u) * scale)[..., None] * v
        + (determinant * scale)[..., None] * across
    )


def cone_intersection(u: Array, v: Array, cos_u: float, cos_v: float, branch: float) -> Array:
    """Return the unit axes with given cosines to unit u (3,) and v (..., 3), (..., 3).

    Of the two axes `branch` (+1 or -1) chooses the side of u x v.  NaN where the cones do not meet.
    """
    k = v @ u
    gram = gram_determinant(k, cos_u, cos_v)
    meet = gram > GRAM_ROUNDING
    determinant = branch * np.sqrt(np.where(meet, gram, np.nan))
    # Parallel axes never meet; their k would divide by zero.
    return third_axis(u, v, cross(u, v), np.where(meet, k, 0.0), cos_u, cos_v, determinant)


def angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Return the signed angle about `axis` (3,) from `start` (3,) to `end` (..., 3) [rad]."""
    return np.arctan2(end @ (skew(axis) @ start), end @ start - (end @ axis) * (start @ axis))
