"""Exponential and logarithm of SE(3) at O: how small errors and poses compose.

A pose is (rotation, translation of the point at O).  Errors multiply from the left, in the fixed
axes of F: T_actual = T_err T_nominal.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross

SMALL_ANGLE = 1e-4
"""Below this the series of the coefficients is exact to double precision."""


def exp_twist(twist: Array) -> tuple[Array, Array]:
    """Return the rigid motion of a twist held for unit time.

    Parameters
    ----------
    twist : (..., 6) float
        (translation; rotation) at O in F [m, rad].

    Returns
    -------
    rotation : (..., 3, 3) float
        Rotation matrix.
    shift : (..., 3) float
        Where the point at O goes [m].
    """
    v, w = twist[..., :3], twist[..., 3:]
    angle = np.sqrt(np.sum(w * w, axis=-1))[..., None]
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    wv = cross(w, v)
    shift = v + first * wv + second * cross(w, wv)
    return Rotation.from_rotvec(w.reshape(-1, 3)).as_matrix().reshape(*w.shape, 3), shift


def log_motion(rotation: Array, shift: Array) -> Array:
    """Return the twist whose exponential is a rigid motion (inverse of `exp_twist`).

    Parameters
    ----------
    rotation : (..., 3, 3) float
        Rotation matrix, angle below pi.
    shift : (..., 3) float
        Where the point at O goes [m].

    Returns
    -------
    (..., 6) float
        Twist at O in F [m, rad].
    """
    w = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec().reshape(shift.shape)
    angle = np.sqrt(np.sum(w * w, axis=-1))[..., None]
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    half = 0.5 * safe
    third = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / safe**2)
    ws = cross(w, shift)
    return np.concatenate([shift - 0.5 * ws + third * cross(w, ws), w], axis=-1)
