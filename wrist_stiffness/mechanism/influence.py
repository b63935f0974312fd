"""How a small screw at a component reaches the platform, the other bodies and the free slides.

With e = (c x d)/|c x d| and Q = b e'/(e.b), used alike for translation and rotation,

    limb 1:  G = I - Q        limb 2:  G = Q        platform = sum_k G_k delta_k

because the cylindrical joints take up any screw along their own axes.  The transposes carry wrenches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.vectors import cross, dot, unit

LIMB_1 = ("joint_1", "link_1", "joint_2")
LIMB_2_BASE = ("joint_5", "link_2", "joint_4")
LIMB_2 = (*LIMB_2_BASE, "link_3", "joint_3")
"""Elastic components from the motor to the platform."""

IN_LIMB_1 = np.array([name in LIMB_1 for name in ELASTIC])


@dataclass(frozen=True)
class Influence:
    """The 3x3 projectors of one configuration (or a stack of them).

    Parameters
    ----------
    limb_1, limb_2 : (..., 3, 3) float
        G of any component in limb 1 and in limb 2.
    slides_limb_1 : (..., 3, 3) float
        Slide of joint_2, joint_3, joint_4 (rows) for a translation in limb 1 (columns); the turns
        obey the same rows for a rotation.  Limb 2 has the opposite sign.
    link_3 : (..., 3, 3) float
        P = d f'/(f.d), f = b x c: how a screw of limb 1 moves link_3.
    """

    limb_1: Array
    limb_2: Array
    slides_limb_1: Array
    link_3: Array

    def of_components(self) -> Array:
        """G of all elastic components in the order of `ELASTIC`, (..., 8, 3, 3)."""
        return np.where(
            IN_LIMB_1[:, None, None], self.limb_1[..., None, :, :], self.limb_2[..., None, :, :]
        )

    def slides(self) -> Array:
        """Slides of joint_2, joint_3, joint_4 for a translation of each component, (..., 8, 3, 3)."""
        sign = np.where(IN_LIMB_1, 1.0, -1.0)
        return sign[:, None, None] * self.slides_limb_1[..., None, :, :]

    def of_frames(self) -> tuple[Array, Array]:
        """Motion of both interface frames of each component for a screw at each component.

        Returns
        -------
        motor_side, platform_side : (..., 8, 8, 3, 3) float
            Entry [m, k] maps a screw at component k to the screw of component m's frame.
        """
        shape = (*self.link_3.shape[:-2], len(ELASTIC), len(ELASTIC), 3, 3)
        motor_side, platform_side = np.zeros(shape), np.zeros(shape)
        number = {name: i for i, name in enumerate(ELASTIC)}
        for chain in (LIMB_1, LIMB_2_BASE):
            for place, moved in enumerate(chain):
                for source in chain[: place + 1]:
                    platform_side[..., number[moved], number[source], :, :] = np.eye(3)
                    if source != moved:
                        motor_side[..., number[moved], number[source], :, :] = np.eye(3)
        before, after = -self.link_3, np.eye(3) - self.link_3
        for moved, done in (("link_3", ()), ("joint_3", ("link_3",))):
            for frames, passed in ((motor_side, done), (platform_side, (*done, moved))):
                for source in ELASTIC:
                    if source in LIMB_1:
                        law = self.link_3
                    elif source in LIMB_2_BASE or source in passed:
                        law = after
                    else:
                        law = before
                    frames[..., number[moved], number[source], :, :] = law
        return motor_side, platform_side


def influence(configuration: Configuration) -> Influence:
    """Return the influence projectors of a configuration.

    Parameters
    ----------
    configuration : Configuration
        Of shape (...), away from the singularity D = 0, where the amplifier 1/(e.b) is unbounded.

    Returns
    -------
    Influence
        Projectors of shape (..., 3, 3).
    """
    b, c, d = configuration.b, configuration.c, configuration.d
    e = unit(cross(c, d))
    q = (b[..., :, None] * e[..., None, :]) / dot(e, b)[..., None, None]
    slides = np.empty((*b.shape[:-1], len(PASSIVE_JOINTS), 3))
    for row, (normal, axis, sign) in enumerate(
        ((e, b, -1.0), (cross(d, b), c, 1.0), (cross(b, c), d, 1.0))
    ):
        slides[..., row, :] = sign * normal / dot(normal, axis)[..., None]
    link_3 = d[..., :, None] * slides[..., 2, None, :]
    return Influence(np.eye(3) - q, q, slides, link_3)
