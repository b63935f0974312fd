"""Convert out: a twist as position and quaternion, the same numbers in nodes and in replay."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.compiled import native
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import dot, skew


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


def seen_from(point: Array) -> Array:
    """Return the matrix that takes a twist at O to the twist of the same motion at another point.

    `point` (3,): in F [m].  Gives (6, 6): its congruence takes covariances along.  Exact for finite
    motions, too: the exponential of the result is the same motion with the point as origin.
    """
    matrix = np.eye(6)
    matrix[:3, 3:] = -skew(point)
    return matrix
