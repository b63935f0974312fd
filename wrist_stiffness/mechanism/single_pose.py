"""Kinematics, statics and contact of one pose at a time: what a live node computes per sample.

The same laws as `kinematics`, `statics` and `contact`, which serve stacks of poses and are the
judges of this file.  For one pose a NumPy call costs more than its arithmetic; so vectors are plain
floats here, and what does not depend on the pose is summed over the parts of each limb that turn
together before any pose is known.

The wrench u on such a group, in the axes of its body, follows from few vectors X: the load, the
force along each slide, the weight of link_3.  By virtual work the same T carries screws back,

    u = T X        delta = C u + S lambda        (platform; slides) = T' delta
"""

from __future__ import annotations

from math import cos, isfinite, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import CARRIER, ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.cones import GRAM_ROUNDING
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.contact import settle
from wrist_stiffness.mechanism.influence import LIMB_1, LIMB_2
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.vectors import skew

IDENTITY = np.eye(3)

GROUPS = tuple(
    tuple(name for name in limb if CARRIER[name] == body)
    for limb, body in (
        (LIMB_1, "frame"),
        (LIMB_1, "link_1"),
        (LIMB_2, "frame"),
        (LIMB_2, "link_2"),
        (LIMB_2, "link_3"),
    )
)
"""Elastic components that lie in one limb and turn with one body."""

_LINK_1, _LINK_2, _PLATFORM, _LINK_3 = (
    BODIES.index(body) for body in ("link_1", "link_2", "platform", "link_3")
)
_BODY = tuple(BODIES.index(CARRIER[names[0]]) for names in GROUPS)
_ROWS = np.ravel(np.add.outer(3 * np.array(_BODY), np.arange(3)))

# Columns of T before the turn into the body: platform, slides of joint_2 to joint_4, link_3.  In
# limb 1 they are I - Q', D', P', in limb 2 Q', -D', I - P', and without that identity past link_2.
# All but the identities is the dual basis times this law, with -b and d to be put in.
_LAW = np.hstack([np.zeros((3, 3)), np.diag([-1.0, 1.0, 1.0]), np.zeros((3, 3))])
_IN_LIMB_1, _IN_LIMB_2_BASE = np.eye(3, 9), np.eye(3, 9, 6)
_LIMB_1, _LIMB_2_BASE, _PAST_LINK_2 = slice(0, 6), slice(6, 12), slice(12, 15)
_MOTOR_1, _MOTOR_2 = slice(0, 3), slice(6, 9)

_FRAME_1, _FRAME_2 = (np.add.outer([0, 15], start + np.arange(3)).ravel() for start in (0, 6))
"""Six-vectors of the groups on the frame, whose axes are those of F at every pose."""


class SinglePoseKinematics:
    """Forward kinematics of one wrist, a pose at a time (see `Mechanism.forward`).

    Parameters
    ----------
    mechanism : Mechanism
        The kinematic scheme.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._cosines = float(mechanism.b0 @ mechanism.c0), float(mechanism.c0 @ mechanism.d0)
        self._assembly_mode = mechanism.assembly_mode
        # Rows by 1, cos 1, sin 1, cos 2, sin 2: both turns, each as its transpose, then b and d.
        turn = np.zeros((24, 5))
        for i, (axis, driven) in enumerate(
            ((mechanism.a1, mechanism.b0), (mechanism.a2, mechanism.d0))
        ):
            parts = np.stack(
                [np.outer(axis, axis), IDENTITY - np.outer(axis, axis), skew(axis)], axis=-1
            )
            columns = [0, 1 + 2 * i, 2 + 2 * i]
            turn[9 * i : 9 * i + 9, columns] = np.swapaxes(parts, 0, 1).reshape(9, 3)
            turn[18 + 3 * i : 21 + 3 * i, columns] = np.swapaxes(parts, 1, 2) @ driven
        self._turn = turn
        self._home_inverse = np.stack(
            [
                np.linalg.inv(np.stack([driven, mechanism.c0, np.cross(driven, mechanism.c0)]))
                for driven in (mechanism.b0, mechanism.d0)
            ]
        )

    def forward(self, theta: Array) -> Configuration | None:
        """Return the configuration at motor angles (2,) [rad], None where there is none."""
        theta_1, theta_2 = theta.tolist()
        if not (isfinite(theta_1) and isfinite(theta_2)):
            return None
        turned = self._turn.dot(
            np.array([1.0, cos(theta_1), sin(theta_1), cos(theta_2), sin(theta_2)])
        )
        bx, by, bz, dx, dy, dz = turned[18:].tolist()
        cos_2, cos_3 = self._cosines
        k = bx * dx + by * dy + bz * dz
        gram = 1.0 - k * k - cos_2 * cos_2 - cos_3 * cos_3 + 2.0 * cos_2 * cos_3 * k
        if gram <= GRAM_ROUNDING:
            return None
        determinant = self._assembly_mode * sqrt(gram)
        ax, ay, az = by * dz - bz * dy, bz * dx - bx * dz, bx * dy - by * dx
        scale = 1.0 / (1.0 - k * k)
        p, q, r = (cos_2 - k * cos_3) * scale, (cos_3 - k * cos_2) * scale, determinant * scale
        cx, cy, cz = p * bx + q * dx + r * ax, p * by + q * dy + r * ay, p * bz + q * dz + r * az
        scale = 1.0 / sqrt(cx * cx + cy * cy + cz * cz)
        cx, cy, cz = cx * scale, cy * scale, cz * scale
        ux, uy, uz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        vx, vy, vz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx
        # fmt: off
        rows = np.array([
            bx, by, bz, cx, cy, cz, ux, uy, uz,
            dx, dy, dz, cx, cy, cz, vx, vy, vz,
            vx, vy, vz, ax, ay, az, -ux, -uy, -uz,
        ])
        # fmt: on
        turns = np.empty((len(BODIES), 3, 3))
        turns[0] = IDENTITY
        turns[1:3] = turned[:18].reshape(2, 3, 3)
        turns[3:5] = self._home_inverse @ rows[:18].reshape(2, 3, 3)
        return Configuration(
            theta,
            rows[0:3],
            rows[3:6],
            rows[9:12],
            np.array(determinant),
            rows[18:].reshape(3, 3) / determinant,
            turns.swapaxes(1, 2),
        )


class SinglePoseStatics:
    """Elastic answer of one wrist with flange contact, a pose at a time.

    The same as `lookup.response.respond` with `statics.contact_operators`.

    Parameters
    ----------
    components : ElasticComponents
        Condensed parts.
    gravity : (3,) float
        Acceleration of gravity in F [m/s^2].
    screws : (5, 6) float, optional
        Constant screws of `GROUPS`, at O in the home frames of their bodies [m, rad].
    opening : (m,) float, optional
        Of the sectors beyond the components' gaps [m].
    """

    def __init__(
        self,
        components: ElasticComponents,
        gravity: Array,
        screws: Array | None = None,
        opening: Array | None = None,
    ) -> None:
        self._gravity = gravity
        self._sectors = sectors = components.sectors
        m, n = len(sectors.gap), len(GROUPS)
        # Six-vectors of the groups lie as (half, group, xyz), bodies' fields as (body, xyz).
        flexibility, weight_screw = np.zeros((2, n, 3, 2, n, 3)), np.zeros((2, n, 3, 5, 3))
        screw, weight_gap = np.zeros((m, 2, n, 3)), np.zeros((m, 5, 3))
        total = np.zeros((5, 2, 3, 5, 3))
        for group, names in enumerate(GROUPS):
            body = _BODY[group]
            carried = np.zeros((6, 3))
            for name in reversed(names):
                k = ELASTIC.index(name)
                c, own = components.flexibility[k], sectors.component == k
                here = carried + components.weight_platform_side[k]
                flexibility[:, group, :, :, group] += c.reshape(2, 3, 2, 3)
                weight_screw[:, group, :, body] += (c @ here).reshape(2, 3, 3)
                screw[own, :, group] = sectors.screw[own].reshape(-1, 2, 3)
                weight_gap[own, body] = sectors.weight_approach[own] + sectors.screw[own] @ here
                carried = here + components.weight_motor_side[k]
            total[body, :, :, body] = carried.reshape(2, 3, 3)
        total[_PLATFORM, :, :, _PLATFORM] = components.platform_weight.reshape(2, 3, 3)
        self._screw = screw.reshape(m, 6 * n)
        self._by_wrench = np.concatenate([flexibility.reshape(6 * n, 6 * n), self._screw])
        # A force along a slide has no moment.
        self._by_force = np.ascontiguousarray(self._by_wrench[:, :15])
        by_field = (weight_screw.reshape(6 * n, 15), weight_gap.reshape(m, 15))
        self._by_field = np.concatenate([*by_field, total.reshape(30, 15)])
        self._constant = np.zeros(6 * n + m)
        if screws is not None:
            self._constant[: 6 * n] = screws.reshape(n, 2, 3).swapaxes(0, 1).ravel()
        self._constant[6 * n :] = sectors.gap if opening is None else sectors.gap + opening

    def respond(
        self,
        configuration: Configuration,
        wrench: Array,
        active: NDArray[np.bool_] | None = None,
        limb_1: Array | None = None,
        limb_2: Array | None = None,
        opening: Array | None = None,
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Solve for the platform's twist under a load, with contact and own weight.

        Parameters
        ----------
        configuration : Configuration
            Of one pose.
        wrench : (6,) float
            Load on the platform at O in F [N, N m].
        active : (m,) bool, optional
            First guess of the sectors in contact; leaves no trace in the result.
        limb_1, limb_2 : (6,) float, optional
            Further screws in the limbs at O in F [m, rad].
        opening : (m,) float, optional
            Further opening of the sectors [m].

        Returns
        -------
        twist : (6,) float
            Of the platform at O in F, first order [m, rad].
        force : (m,) float
            Of each sector [N].
        active : (m,) bool
            Sectors in contact.

        Raises
        ------
        InputError
            If the flanges' flexibility is not positive definite.
        """
        turns = configuration.bodies.swapaxes(-1, -2).reshape(15, 3)
        sectors = self._sectors
        law = _LAW.copy()
        law[0, :3], law[2, 6:] = -configuration.b, configuration.d
        law = configuration.dual.T.dot(law)
        turned, t = turns.take(_ROWS, axis=0), np.empty((15, 9))
        turned[_LIMB_1].dot(_IN_LIMB_1 + law, out=t[_LIMB_1])
        turned[_LIMB_2_BASE].dot(_IN_LIMB_2_BASE - law, out=t[_LIMB_2_BASE])
        turned[_PAST_LINK_2].dot(-law, out=t[_PAST_LINK_2])

        own = self._by_field.dot(turns.dot(self._gravity))
        weight = own[-30:].reshape(5, 2, 3) @ turns.reshape(5, 3, 3)
        x = np.zeros((2, 9))
        x[:, :3] = wrench.reshape(2, 3) + weight[_PLATFORM]
        x[:, 6:] = weight[_LINK_3]
        u = x.dot(t.T)
        carried = u[:, _MOTOR_1]
        carried += weight[_LINK_1]
        carried = u[:, _MOTOR_2]
        carried += weight[_LINK_2]
        bent = self._by_wrench.dot(u.ravel())
        bent += own[:-30]
        bent += self._constant
        for screw, frame in ((limb_1, _FRAME_1), (limb_2, _FRAME_2)):
            if screw is not None:
                bent[frame] += screw

        to_slides, delta, gap = t[:, 3:6], bent[:30], bent[30:]
        if opening is not None:
            gap += opening
        gap += sectors.slide.dot(delta[:15].dot(to_slides))
        by_slide = self._by_force.dot(to_slides)
        half = by_slide[30:] + sectors.slide.dot(0.5 * to_slides.T.dot(by_slide[:15]))
        approach = half.dot(sectors.slide.T) + sectors.slide.dot(half.T)
        approach += sectors.approach
        force, closed = settle(approach, gap, active)
        delta += by_slide[:30].dot(force.dot(sectors.slide))
        delta += force.dot(self._screw)
        return delta.reshape(2, 15).dot(t[:, :3]).ravel(), force, closed
