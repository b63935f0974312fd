"""Exponential and logarithm of one rigid motion, in plain floats.

The same formulas as in `rigid_motion`, which takes stacks; for one motion floats are ten times
faster.
"""

from __future__ import annotations

from math import atan2, sin, sqrt, tan

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import (
    COSINE_OF_LARGE_ANGLE,
    SERIES_ANGLE,
    SMALL_ANGLE,
    log_motion,
)


def exp_one(twist: Array) -> tuple[Array, Array]:
    """Return rotation (3, 3) and shift (3,) [m] of a twist (6,) (see `exp_twist`)."""
    x, y, z, u, v, w = twist.tolist()
    square = u * u + v * v + w * w
    angle = sqrt(square)
    if angle < SMALL_ANGLE:
        sine, first = 1.0 - square / 6.0, 0.5 * (1.0 - square / 24.0) ** 2
    else:
        sine, first = sin(angle) / angle, 0.5 * (sin(0.5 * angle) / (0.5 * angle)) ** 2
    if angle < SERIES_ANGLE:
        second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0
    else:
        second = (angle - sin(angle)) / angle**3
    a, b, c = v * z - w * y, w * x - u * z, u * y - v * x
    shift = np.array(
        [
            x + first * a + second * (v * c - w * b),
            y + first * b + second * (w * a - u * c),
            z + first * c + second * (u * b - v * a),
        ]
    )
    rotation = np.array(
        [
            [1.0 - first * (v * v + w * w), first * u * v - sine * w, first * u * w + sine * v],
            [first * u * v + sine * w, 1.0 - first * (u * u + w * w), first * v * w - sine * u],
            [first * u * w - sine * v, first * v * w + sine * u, 1.0 - first * (u * u + v * v)],
        ]
    )
    return rotation, shift


def log_one(rotation: Array, shift: Array) -> Array:
    """Return the twist (6,) of a rotation (3, 3) and a shift (3,) [m] (see `log_motion`)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    cosine = 0.5 * (xx + yy + zz - 1.0)
    if cosine < COSINE_OF_LARGE_ANGLE:
        return log_motion(rotation, shift)
    u, v, w = zy - yz, xz - zx, yx - xy
    sine = 0.5 * sqrt(u * u + v * v + w * w)
    scale = 0.5 * atan2(sine, cosine) / sine if sine > 0.0 else 0.5
    u, v, w = scale * u, scale * v, scale * w
    square = u * u + v * v + w * w
    angle = sqrt(square)
    if angle < SMALL_ANGLE:
        third = 1.0 / 12.0 + square / 720.0
    else:
        third = (1.0 - 0.5 * angle / tan(0.5 * angle)) / square
    x, y, z = shift.tolist()
    a, b, c = v * z - w * y, w * x - u * z, u * y - v * x
    return np.array(
        [
            x - 0.5 * a + third * (v * c - w * b),
            y - 0.5 * b + third * (w * a - u * c),
            z - 0.5 * c + third * (u * b - v * a),
            u,
            v,
            w,
        ]
    )
