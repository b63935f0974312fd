"""Convert out: a twist as position and quaternion, the same numbers in nodes and in replay."""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.single_motion import exp_one
from wrist_stiffness.mechanism.vectors import skew


def pose_of_twist(twist: Array) -> tuple[Array, Array]:
    """Return the rigid motion of a twist as messages carry it.

    Parameters
    ----------
    twist : (6,) float
        (translation; rotation) at O in F [m, rad].

    Returns
    -------
    position : (3,) float
        Where the point at O goes [m].
    quaternion : (4,) float
        Rotation, x y z w with w >= 0 for angles up to pi.
    """
    u, v, w = twist[3:].tolist()
    half = 0.5 * sqrt(u * u + v * v + w * w)
    scale = 0.5 * sin(half) / half if half > 0.0 else 0.5
    return exp_one(twist)[1], np.array([scale * u, scale * v, scale * w, cos(half)])


def seen_from(point: Array) -> Array:
    """Return the matrix that takes a twist at O to the twist of the same motion at another point.

    Parameters
    ----------
    point : (3,) float
        In F [m].

    Returns
    -------
    (6, 6) float
        Its congruence takes covariances along.  Exact for finite motions, too: the exponential of
        the result is the same motion with the point as origin.
    """
    matrix = np.eye(6)
    matrix[:3, 3:] = -skew(point)
    return matrix
