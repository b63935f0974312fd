"""Exponential and logarithm of SE(3) at O: how small errors and poses compose.

A pose is (rotation, translation of the point at O).  Errors multiply from the left, in the fixed
axes of F: T_actual = T_err T_nominal.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.compiled import native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross, dot, skew, vee

SMALL_ANGLE = 1e-4
"""Below this the series of the coefficients is exact to double precision."""

SERIES_ANGLE = 0.02
"""Below this three terms of a series are exact to double precision."""

COSINE_OF_LARGE_ANGLE = -0.5
"""Below this cosine the sine of the angle no longer tells the angle well."""


def exp_twist(twist: Array) -> tuple[Array, Array]:
    """Return the rigid motion of a twist held for unit time.

    `twist` (..., 6): (translation; rotation) at O in F [m, rad].  Gives `rotation` (..., 3, 3):
    rotation matrix, and `shift` (..., 3): where the point at O goes [m].
    """
    if native is not None:
        rows = np.ascontiguousarray(twist, float).reshape(-1, 6)
        rotations, shifts = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
        native.exp_twist(rows, rotations, shifts)
        return rotations.reshape(*twist.shape[:-1], 3, 3), shifts.reshape(*twist.shape[:-1], 3)
    v, w = twist[..., :3], twist[..., 3:]
    angle = np.sqrt(dot(w, w))[..., None]
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    first = 0.5 * np.where(small, 1.0 - angle**2 / 24.0, np.sin(safe / 2.0) / (safe / 2.0)) ** 2
    # Here the closed form is a difference of nearly equal numbers.
    series = 1.0 / 6.0 - angle**2 / 120.0 + angle**4 / 5040.0
    second = np.where(angle < SERIES_ANGLE, series, (safe - np.sin(safe)) / safe**3)
    wv = cross(w, v)
    shift = v + first * wv + second * cross(w, wv)
    turn = skew(w)
    rotation = np.eye(3) + sine[..., None] * turn + first[..., None] * (turn @ turn)
    return rotation, shift


def pose_of_twist(twist: Array) -> tuple[Array, Array]:
    """Return the rigid motion of a twist as messages carry it.

    `twist` (..., 6): (translation; rotation) at O in F [m, rad].  Gives `position` (..., 3): where
    the point at O goes [m], and `quaternion` (..., 4): rotation, x y z w with w >= 0 for angles up
    to pi.
    """
    if native is not None:
        pose = np.empty((*twist.shape[:-1], 7))
        native.pose_of_twist(np.ascontiguousarray(twist, float), pose)
        return pose[..., :3], pose[..., 3:]
    half = 0.5 * np.sqrt(dot(twist[..., 3:], twist[..., 3:]))[..., None]
    # sin(x) / x, with numpy's pi in it.
    scale = 0.5 * np.sinc(half / np.pi)
    quaternion = np.concatenate([scale * twist[..., 3:], np.cos(half)], axis=-1)
    return exp_twist(twist)[1], quaternion


def rotation_vector(rotation: Array) -> Array:
    """Return the rotation vectors (..., 3) [rad] of rotation matrices (..., 3, 3).

    For small angles to the last digit, and of many in a tenth of SciPy's time.
    """
    # Twice the sine of the angle times the axis.
    w = vee(rotation)
    sine = 0.5 * np.sqrt(dot(w, w))
    cosine = 0.5 * (np.trace(rotation, axis1=-2, axis2=-1) - 1.0)
    turned = sine > 0.0
    w *= np.where(turned, 0.5 * np.arctan2(sine, cosine) / np.where(turned, sine, 1.0), 0.5)[
        ..., None
    ]
    # The sine fades towards a half turn; measured poses can be anywhere.
    large = cosine < COSINE_OF_LARGE_ANGLE
    if np.any(large):
        w[large] = Rotation.from_matrix(rotation[large]).as_rotvec()
    return w


def log_motion(rotation: Array, shift: Array) -> Array:
    """Return the twist whose exponential is a rigid motion (inverse of `exp_twist`).

    `rotation` (..., 3, 3): rotation matrix, angle below pi; `shift` (..., 3): where the point at O
    goes [m].  Gives (..., 6): twist at O in F [m, rad].
    """
    if native is not None:
        shape = np.broadcast_shapes(rotation.shape[:-2], shift.shape[:-1])
        rotations = np.ascontiguousarray(np.broadcast_to(rotation, (*shape, 3, 3)), float)
        shifts = np.ascontiguousarray(np.broadcast_to(shift, (*shape, 3)), float)
        twists = np.empty((math.prod(shape), 6))
        if not native.log_motion(rotations, shifts, twists):
            return twists.reshape(*shape, 6)
    w = rotation_vector(rotation)
    angle = np.sqrt(dot(w, w))[..., None]
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    half = 0.5 * safe
    third = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / safe**2)
    ws = cross(w, shift)
    return np.concatenate([shift - 0.5 * ws + third * cross(w, ws), w], axis=-1)
