"""Forward and inverse kinematics, Jacobian and singularity of the spherical five-bar.

Limb 1: motor 1 - link_1 - platform (axes a1, b).  Limb 2: motor 2 - link_2 - link_3 - platform
(axes a2, d, c).  All axes meet in O; any link angles and both assembly modes are the same code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import GeometryError, SingularPoseError, UnreachablePoseError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import (
    angle_between,
    cross,
    dot,
    rotation_about,
    skew,
    triad,
    unit,
)

HOME_TOLERANCE = 1e-6
"""Least |sin| of an angle between neighbouring axes, and least |D|, that a home pose may have."""


@dataclass(frozen=True)
class Configuration:
    """The wrist at given motor angles, rigid, origin at O, everything in F.

    Parameters
    ----------
    theta : (..., 2) float
        Motor angles [rad].
    b, c, d : (..., 3) float
        Unit axes of joint_2, joint_3 and joint_4.
    rotations : dict of str to (..., 3, 3) float
        Rotation of `link_1`, `link_2`, `link_3` and `platform` from home.
    """

    theta: Array
    b: Array
    c: Array
    d: Array
    rotations: dict[str, Array]

    @property
    def platform(self) -> Array:
        """Rotation U -> F of the rigid platform, (..., 3, 3)."""
        return self.rotations["platform"]

    @cached_property
    def singularity(self) -> Array:
        """D = b . (d x c), zero where the platform gains a freedom (type 2), (...)."""
        return dot(self.b, cross(self.d, self.c))


@dataclass(frozen=True)
class Mechanism:
    """A spherical five-bar given by its five home axes.

    Parameters
    ----------
    a1, b0, c0, d0, a2 : (3,) float
        Home axes of joint_1 ... joint_5, unit vectors through O.
    n0 : (3,) float
        Home normal of the platform, unit vector.

    Raises
    ------
    GeometryError
        If neighbouring axes are parallel or the home pose is singular.
    """

    a1: Array
    b0: Array
    c0: Array
    d0: Array
    a2: Array
    n0: Array

    def __post_init__(self) -> None:
        pairs = {
            "joint_1 and joint_2": (self.a1, self.b0),
            "joint_2 and joint_3": (self.b0, self.c0),
            "joint_3 and joint_4": (self.c0, self.d0),
            "joint_4 and joint_5": (self.d0, self.a2),
            "joint_1 and joint_5": (self.a1, self.a2),
            "joint_2 and joint_4": (self.b0, self.d0),
            "joint_2 and the platform normal": (self.b0, self.n0),
        }
        for names, (u, v) in pairs.items():
            if np.linalg.norm(np.cross(u, v)) < HOME_TOLERANCE:
                raise GeometryError(
                    f"home axes of {names} are parallel: {u.tolist()}, {v.tolist()}"
                )
        determinant = float(self.b0 @ np.cross(self.d0, self.c0))
        if abs(determinant) < HOME_TOLERANCE:
            raise GeometryError(
                f"home pose is singular: |D| = {abs(determinant):.2e}, axes of joint_2, joint_3 and "
                f"joint_4 are coplanar (limit {HOME_TOLERANCE:.0e})"
            )

    @cached_property
    def alphas(self) -> Array:
        """Link angles alpha_1 ... alpha_5 between (a1,b), (b,c), (c,d), (d,a2), (a1,a2) [rad]."""
        pairs = (
            (self.a1, self.b0),
            (self.b0, self.c0),
            (self.c0, self.d0),
            (self.d0, self.a2),
            (self.a1, self.a2),
        )
        return np.array([angle_between(u, v) for u, v in pairs])

    @cached_property
    def assembly_mode(self) -> float:
        """Return sigma = sign(c . (b x d)) at home: the branch of the closure, +1 or -1."""
        return float(np.sign(self.c0 @ np.cross(self.b0, self.d0)))

    def closure_radicand(self, theta: Array) -> Array:
        """Square of c's component along b x d over |b x d|; negative where the loop cannot close.

        Parameters
        ----------
        theta : (..., 2) float
            Motor angles [rad].

        Returns
        -------
        (...) float
            Dimensionless, 1 at best.
        """
        return self._close(np.asarray(theta, dtype=float))[-1]

    def _close(self, theta: Array) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
        turn_1 = rotation_about(self.a1, theta[..., 0])
        turn_2 = rotation_about(self.a2, theta[..., 1])
        b = turn_1 @ self.b0
        d = turn_2 @ self.d0
        cos_2, cos_3 = self.b0 @ self.c0, self.c0 @ self.d0
        k = dot(b, d)
        with np.errstate(divide="ignore", invalid="ignore"):
            p = (cos_2 - k * cos_3) / (1.0 - k * k)
            q = (cos_3 - k * cos_2) / (1.0 - k * k)
            radicand = (1.0 - p * cos_2 - q * cos_3) / (1.0 - k * k)
        return turn_1, turn_2, b, d, p, q, radicand

    def reachable(self, theta: Array) -> NDArray[np.bool_]:
        """Tell where the loop closes, (...) for `theta` (..., 2) [rad]."""
        return self.closure_radicand(theta) > 0.0

    def forward(self, theta: Array) -> Configuration:
        """Forward kinematics.

        Parameters
        ----------
        theta : (..., 2) float
            Motor angles [rad].

        Returns
        -------
        Configuration
            Axes and rotations of all bodies.

        Raises
        ------
        UnreachablePoseError
            If the loop does not close at one of the poses (the first one is named).
        """
        theta = np.asarray(theta, dtype=float)
        turn_1, turn_2, b, d, p, q, radicand = self._close(theta)
        if not np.all(radicand > 0.0):
            bad = np.argwhere(~(np.atleast_1d(radicand) > 0.0))[0]
            angles = np.degrees(
                np.reshape(theta, (-1, 2))[np.ravel_multi_index(bad, np.atleast_1d(radicand).shape)]
            )
            raise UnreachablePoseError(
                f"motor angles ({angles[0]:.3f}, {angles[1]:.3f}) deg: the loop does not close "
                f"(angle between joint_2 and joint_4 outside its limits)"
            )
        c = p[..., None] * b + q[..., None] * d
        c += (self.assembly_mode * np.sqrt(radicand))[..., None] * cross(b, d)
        # The closure is exact only to rounding; unit length keeps the triads orthonormal.
        c = unit(c)
        rotations = {
            "link_1": turn_1,
            "link_2": turn_2,
            "link_3": triad(d, c) @ triad(self.d0, self.c0).T,
            "platform": triad(b, c) @ triad(self.b0, self.c0).T,
        }
        return Configuration(theta, b, c, d, rotations)

    def normal(self, configuration: Configuration) -> Array:
        """Return the platform's normal in F, (..., 3)."""
        return configuration.platform @ self.n0

    def jacobian(self, configuration: Configuration) -> Array:
        """Jacobian of the platform's angular velocity, omega = J theta_dot.

        Parameters
        ----------
        configuration : Configuration
            Of shape (...).

        Returns
        -------
        (..., 3, 2) float
            Dimensionless, in F.

        Raises
        ------
        SingularPoseError
            If D vanishes at one of the poses.
        """
        determinant = configuration.singularity
        if np.any(np.abs(determinant) < HOME_TOLERANCE):
            raise SingularPoseError(
                f"|D| = {np.min(np.abs(determinant)):.2e} below {HOME_TOLERANCE:.0e}: "
                "the axes of joint_2, joint_3 and joint_4 are coplanar"
            )
        w = cross(configuration.d, configuration.c)
        first = self.a1 - configuration.b * (dot(w, self.a1) / determinant)[..., None]
        second = configuration.b * (dot(w, self.a2) / determinant)[..., None]
        return np.stack([first, second], axis=-1)

    def tilt(self, theta: Array) -> Array:
        """Angle of the platform normal from home [rad], (...) for `theta` (..., 2)."""
        return angle_between(self.normal(self.forward(theta)), self.n0)

    def inverse(self, normal: Array) -> Array:
        """Inverse kinematics of a platform normal: all solutions of this assembly mode.

        Parameters
        ----------
        normal : (..., 3) float
            Desired platform normals in F (any length).

        Returns
        -------
        (..., 4, 2) float
            Motor angles in (-pi, pi]; rows that do not exist or belong to the other assembly
            mode are NaN.
        """
        n = unit(np.asarray(normal, dtype=float))
        solutions = []
        home = triad(self.b0, self.n0)
        for branch_1 in (1.0, -1.0):
            b = _cone_intersection(self.a1, n, self.a1 @ self.b0, self.b0 @ self.n0, branch_1)
            c = triad(b, n) @ home.T @ self.c0
            for branch_2 in (1.0, -1.0):
                d = _cone_intersection(
                    np.broadcast_to(self.a2, c.shape),
                    c,
                    self.d0 @ self.a2,
                    self.c0 @ self.d0,
                    branch_2,
                )
                theta = np.stack(
                    [_angle_about(self.a1, self.b0, b), _angle_about(self.a2, self.d0, d)], axis=-1
                )
                other_mode = np.sign(dot(c, cross(b, d))) != self.assembly_mode
                theta[other_mode] = np.nan
                solutions.append(theta)
        return np.stack(solutions, axis=-2)

    def inverse_near(self, normal: Array, theta: Array) -> Array:
        """Inverse kinematics: the solution nearest to given motor angles.

        Parameters
        ----------
        normal : (..., 3) float
            Desired platform normals in F.
        theta : (..., 2) float
            Where to stay near to [rad].

        Returns
        -------
        (..., 2) float
            Motor angles [rad].

        Raises
        ------
        UnreachablePoseError
            If a normal has no solution.
        """
        solutions = self.inverse(normal)
        step = np.angle(np.exp(1j * (solutions - np.asarray(theta)[..., None, :])))
        distance = np.where(
            np.isnan(step[..., 0]), np.inf, np.sum(np.nan_to_num(step) ** 2, axis=-1)
        )
        if np.any(np.min(distance, axis=-1) == np.inf):
            bad = np.reshape(normal, (-1, 3))[
                np.argmax(np.ravel(np.min(distance, axis=-1)) == np.inf)
            ]
            raise UnreachablePoseError(
                f"platform normal {np.round(bad, 6).tolist()} is out of reach"
            )
        best = np.argmin(distance, axis=-1)[..., None, None]
        return np.asarray(theta) + np.take_along_axis(step, best, axis=-2)[..., 0, :]


def _cone_intersection(u: Array, v: Array, cos_u: float, cos_v: float, branch: float) -> Array:
    """Unit vectors at given cosines to unit u and v, (..., 3); NaN where the cones do not meet."""
    k = dot(u, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        p = (cos_u - k * cos_v) / (1.0 - k * k)
        q = (cos_v - k * cos_u) / (1.0 - k * k)
        height = branch * np.sqrt((1.0 - p * cos_u - q * cos_v) / (1.0 - k * k))
        return p[..., None] * u + q[..., None] * v + height[..., None] * cross(u, v)


def _angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Signed angle about `axis` (3,) from `start` (3,) to `end` (..., 3) [rad]."""
    return np.arctan2(end @ (skew(axis) @ start), end @ start - (end @ axis) * (start @ axis))
