"""Forward and inverse kinematics, Jacobian and singularity of the spherical five-bar.

Limb 1: motor 1 - link_1 - platform (axes a1, b).  Limb 2: motor 2 - link_2 - link_3 - platform
(axes a2, d, c).  All axes meet in O; any link angles and both assembly modes are the same code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wrist_stiffness.errors import (
    GeometryError,
    InputError,
    SingularPoseError,
    UnreachablePoseError,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.vectors import (
    IDENTITY,
    angle_between,
    cross,
    dot,
    skew,
    triad,
    unit,
)

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


HOME_TOLERANCE = 1e-6
"""Least |sin| of an angle between neighbouring axes, and least |D|, that a home pose may have."""


@dataclass(frozen=True)
class Mechanism:
    """A spherical five-bar given by its five home axes.

    Raises `GeometryError` if neighbouring axes are parallel or the home pose is singular.
    """

    # `a1`, `b0`, `c0`, `d0`, `a2`: (3,), home axes of joint_1 ... joint_5, unit vectors through O
    a1: Array
    b0: Array
    c0: Array
    d0: Array
    a2: Array
    n0: Array  # (3,), home normal of the platform, unit vector

    def __post_init__(self) -> None:
        """Check the home pose."""
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
                    f"home axes of {names} are parallel: {u.tolist()} and {v.tolist()} "
                    f"(|sin| below {HOME_TOLERANCE:.0e})"
                )
        determinant = float(self.b0 @ np.cross(self.d0, self.c0))
        if abs(determinant) < HOME_TOLERANCE:
            raise GeometryError(
                f"home pose is singular: |D| = {abs(determinant):.2e} below {HOME_TOLERANCE:.0e}, "
                "the home axes of joint_2, joint_3 and joint_4 are coplanar"
            )

    @cached_property
    def assembly_mode(self) -> float:
        """Return sigma = sign(c . (b x d)) at home: the branch of the closure, +1 or -1."""
        return float(np.sign(self.c0 @ np.cross(self.b0, self.d0)))

    @cached_property
    def _turn_parts(self) -> tuple[Array, Array, Array]:
        """Constant, cosine and sine part of both motors' turns of x, y, z, b0 or d0, (2, 3, 4)."""
        axes, driven = np.stack([self.a1, self.a2]), np.stack([self.b0, self.d0])
        columns = np.concatenate([np.broadcast_to(IDENTITY, (2, 3, 3)), driven[:, :, None]], axis=2)
        along = axes[:, :, None] * axes[:, None, :]
        return along @ columns, (IDENTITY - along) @ columns, skew(axes) @ columns

    @cached_property
    def _driving(self) -> tuple[Array, Array, Array]:
        """Motor axes as columns (3, 2), the part that is free of b, the signs of the rest."""
        axes = np.stack([self.a1, self.a2], axis=-1)
        return axes, axes * [1.0, 0.0], np.array([-1.0, 1.0])

    @cached_property
    def _home_inverse(self) -> Array:
        """Inverse of the rows (b0, c0, b0 x c0) and (d0, c0, d0 x c0), (2, 3, 3)."""
        driven = np.stack([self.b0, self.d0])
        rows = [driven, np.broadcast_to(self.c0, (2, 3)), cross(driven, self.c0)]
        return np.linalg.inv(np.stack(rows, axis=1))

    @cached_property
    def _cosines(self) -> tuple[float, float]:
        """Cosines of alpha_2 and alpha_3."""
        return float(self.b0 @ self.c0), float(self.c0 @ self.d0)

    def _turned(self, theta: Array, columns: slice = slice(None)) -> Array:
        """Turn x, y, z, b0 with motor 1 and x, y, z, d0 with motor 2: columns, (..., 2, 3, 4)."""
        if not np.isfinite(theta).all():
            bad = first_where(theta, ~np.isfinite(theta).all(axis=-1))
            raise InputError(f"motor angles {angles_text(bad)}: not finite")
        constant, cosine, sine = (part[..., columns] for part in self._turn_parts)
        angle = theta[..., None, None]
        turned = np.cos(angle) * cosine
        turned += constant
        turned += np.sin(angle) * sine
        return turned

    def closure_radicand(self, theta: Array) -> Array:
        """Gram determinant of b, c and d, which is D^2; negative where the loop cannot close.

        `theta` (..., 2): motor angles [rad].  Gives (...): dimensionless, 1 at best.  Raises
        `InputError` if an angle is not finite.
        """
        driven = self._turned(np.asarray(theta, dtype=float), slice(3, 4))[..., 0]
        return gram_determinant(dot(driven[..., 0, :], driven[..., 1, :]), *self._cosines)

    def reachable(self, theta: Array) -> NDArray[np.bool_]:
        """Tell where the loop closes, (...) for finite `theta` (..., 2) [rad]."""
        return self.closure_radicand(theta) > GRAM_ROUNDING

    def forward(self, theta: Array) -> Configuration:
        """Forward kinematics.

        A stack of poses goes through the same formulas as one pose; the last digit may differ.

        `theta` (..., 2): motor angles [rad].  Raises `InputError` if an angle is not finite;
        `UnreachablePoseError` if the loop does not close at one of the poses (the first one is
        named).
        """
        theta = np.asarray(theta, dtype=float)
        turned = self._turned(theta)
        driven = turned[..., 3]
        b, d = driven[..., 0, :], driven[..., 1, :]
        c, across, determinant = self._closed(theta, b, d)
        rows = np.empty((*theta.shape[:-1], 2, 3, 3))
        rows[..., 0, :] = driven
        rows[..., 1, :] = c[..., None, :]
        rows[..., 2, :] = to_c = cross(driven, c[..., None, :])
        bodies = np.empty((*theta.shape[:-1], len(BODIES), 3, 3))
        bodies[..., 0, :, :] = IDENTITY
        bodies[..., 1:3, :, :] = turned[..., :3]
        bodies[..., 3:5, :, :] = np.swapaxes(self._home_inverse @ rows, -1, -2)
        dual = np.empty((*theta.shape[:-1], 3, 3))
        dual[..., 0, :] = to_c[..., 1, :]
        dual[..., 1, :] = across
        dual[..., 2, :] = -to_c[..., 0, :]
        dual /= determinant[..., None, None]
        return Configuration(theta, b, c, d, determinant, dual, bodies)

    def platform_rotation(self, theta: Array) -> Array:
        """Rotation U -> F of the rigid platform alone, in a third of the time of `forward`.

        `theta` (..., 2): motor angles [rad].  Gives (..., 3, 3): the same as `forward` gives.
        Raises `InputError` if an angle is not finite; `UnreachablePoseError` if the loop does not
        close at one of the poses (the first one is named).
        """
        theta = np.asarray(theta, dtype=float)
        driven = self._turned(theta, slice(3, 4))[..., 0]
        b, d = driven[..., 0, :], driven[..., 1, :]
        c, _, _ = self._closed(theta, b, d)
        rows = np.stack([b, c, cross(b, c)], axis=-2)
        return np.asarray(np.swapaxes(self._home_inverse[0] @ rows, -1, -2))

    def _closed(self, theta: Array, b: Array, d: Array) -> tuple[Array, Array, Array]:
        """Return axis c that closes the loop with b and d, b x d, and D; refuse where none does."""
        k = dot(b, d)
        gram = gram_determinant(k, *self._cosines)
        if not (gram > GRAM_ROUNDING).all():
            self._refuse_open_loop(theta, k, gram)
        # D is the determinant of b, d and c.
        determinant = self.assembly_mode * np.sqrt(gram)
        across = cross(b, d)
        c = third_axis(b, d, across, k, *self._cosines, determinant)
        # The closure is exact only to rounding; unit length keeps the rotations orthonormal.
        return unit(c), across, determinant

    def _refuse_open_loop(self, theta: Array, k: Array, gram: Array) -> None:
        wrong = ~(gram > GRAM_ROUNDING)
        angle = np.degrees(np.arccos(np.clip(first_where(k[..., None], wrong)[0], -1.0, 1.0)))
        alpha_2, alpha_3 = np.degrees(np.arccos(self._cosines))
        raise UnreachablePoseError(
            f"motor angles {angles_text(first_where(theta, wrong))}: the loop does not close; the "
            f"angle between joint_2 and joint_4 is {angle:.3f} deg, it must lie between "
            f"{abs(alpha_2 - alpha_3):.3f} and {180 - abs(180 - alpha_2 - alpha_3):.3f}"
        )

    def normal(self, configuration: Configuration) -> Array:
        """Return the platform's normal in F, (..., 3)."""
        return configuration.platform @ self.n0

    def jacobian(self, configuration: Configuration) -> Array:
        """Jacobian of the platform's angular velocity, omega = J theta_dot.

        `configuration`: of shape (...).  Gives (..., 3, 2): dimensionless, in F.  Raises
        `SingularPoseError` if D vanishes at one of the poses.
        """
        determinant = configuration.singularity
        singular = np.abs(determinant) < HOME_TOLERANCE
        if singular.any():
            raise SingularPoseError(
                f"motor angles {angles_text(first_where(configuration.theta, singular))}: "
                f"|D| below {HOME_TOLERANCE:.0e}, "
                "the axes of joint_2, joint_3 and joint_4 are coplanar"
            )
        axes, direct, sign = self._driving
        about_b = sign * (configuration.dual[..., 0, :] @ axes)
        return direct + configuration.b[..., :, None] * about_b[..., None, :]

    def tilt(self, theta: Array) -> Array:
        """Angle of the platform normal from home [rad], (...) for `theta` (..., 2)."""
        return angle_between(self.normal(self.forward(theta)), self.n0)

    def inverse(self, normal: Array) -> Array:
        """Inverse kinematics of a platform normal: all solutions of this assembly mode.

        `normal` (..., 3): desired platform normals in F, of any length.  Gives (..., 4, 2): motor
        angles in [-pi, pi]; rows that do not exist or belong to the other assembly mode are NaN.
        """
        n = unit(normal)
        cos_3 = self._cosines[1]
        platform_home = triad(self.b0, self.n0).T @ self.c0
        solutions = []
        for branch_1 in (1.0, -1.0):
            b = cone_intersection(
                self.a1, n, float(self.a1 @ self.b0), float(self.b0 @ self.n0), branch_1
            )
            c = triad(b, n) @ platform_home
            for branch_2 in (1.0, -1.0):
                d = cone_intersection(self.a2, c, float(self.d0 @ self.a2), cos_3, branch_2)
                theta = np.stack(
                    [angle_about(self.a1, self.b0, b), angle_about(self.a2, self.d0, d)], axis=-1
                )
                other_mode = np.sign(dot(c, cross(b, d))) != self.assembly_mode
                theta[other_mode] = np.nan
                solutions.append(theta)
        return np.stack(solutions, axis=-2)

    def inverse_near(self, normal: Array, theta: Array) -> Array:
        """Inverse kinematics: the solution nearest to given motor angles.

        `normal` (..., 3): desired platform normals in F; `theta` (..., 2): where to stay near to
        [rad].  Gives (..., 2): motor angles [rad].  Raises `UnreachablePoseError` if a normal has
        no solution.
        """
        step = np.angle(np.exp(1j * (self.inverse(normal) - theta[..., None, :])))
        distance = np.where(np.isnan(step[..., 0]), np.inf, np.sum(step * step, axis=-1))
        unreachable = np.min(distance, axis=-1) == np.inf
        if unreachable.any():
            bad = np.round(first_where(normal, unreachable), 6).tolist()
            raise UnreachablePoseError(f"platform normal {bad} is out of reach")
        best = np.argmin(distance, axis=-1)[..., None, None]
        return theta + np.take_along_axis(step, best, axis=-2)[..., 0, :]


def angles_text(theta: Array) -> str:
    """Return motor angles (2,) [rad] as error messages say them."""
    first, second = np.degrees(theta)
    return f"({first:.3f}, {second:.3f}) deg"


def first_where(values: Array, wrong: ArrayLike) -> Array:
    """Return the first row of `values` (..., n) whose pose `wrong` (...) marks, (n,)."""
    return np.reshape(values, (-1, values.shape[-1]))[np.argmax(np.ravel(wrong))]
