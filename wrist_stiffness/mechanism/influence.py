"""How a small screw at a component reaches the platform, the other bodies and the free slides.

With e = (c x d)/|c x d| and Q = b e'/(e.b), used alike for translation and rotation,

    limb 1:  G = I - Q        limb 2:  G = Q        platform = sum_k G_k delta_k

because the cylindrical joints take up any screw along their own axes.  Transposes carry wrenches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.vectors import IDENTITY, both_halves

LIMB_1 = ("joint_1", "link_1", "joint_2")
LIMB_2_BASE = ("joint_5", "link_2", "joint_4")
LIMB_2 = (*LIMB_2_BASE, "link_3", "joint_3")
"""Elastic components from the motor to the platform."""

IN_LIMB_1 = np.array([name in LIMB_1 for name in ELASTIC])

# G = I - Q in limb 1 and G = Q in limb 2, as one formula.
_G_IDENTITY = np.where(IN_LIMB_1, 1.0, 0.0)[:, None, None] * IDENTITY
_G_SIGN = np.where(IN_LIMB_1, -1.0, 1.0)[:, None, None]
_SLIDE_SIGN = np.where(IN_LIMB_1, 1.0, -1.0)[:, None, None]
# Slide of joint_2, joint_3, joint_4 over the dual vectors of b, c, d.
_DUAL_SIGN = np.array([-1.0, 1.0, 1.0])[:, None]


def _frame_laws() -> tuple[Array, Array]:
    """Return how frames move with a screw at a component: X I + Y P.

    Gives `motor_side`, `platform_side` (2, 8, 8): entries X[m, k] and Y[m, k] for the frame of
    component m and a screw at component k.
    """
    motor_side, platform_side = np.zeros((2, 2, len(ELASTIC), len(ELASTIC)))
    number = {name: i for i, name in enumerate(ELASTIC)}
    for chain in (LIMB_1, LIMB_2_BASE):
        for place, moved in enumerate(chain):
            motor_side[0, number[moved], [number[name] for name in chain[:place]]] = 1.0
            platform_side[0, number[moved], [number[name] for name in chain[: place + 1]]] = 1.0
    for moved, done in (("link_3", ()), ("joint_3", ("link_3",))):
        for law, passed in ((motor_side, done), (platform_side, (*done, moved))):
            for source in ELASTIC:
                law[1, number[moved], number[source]] = 1.0 if source in LIMB_1 else -1.0
                if source in LIMB_2_BASE or source in passed:
                    law[0, number[moved], number[source]] = 1.0
    return motor_side, platform_side


MOTOR_SIDE_LAW, PLATFORM_SIDE_LAW = _frame_laws()
"""Motion of the components' interface frames, (2, 8, 8) each, as `Influence.of_frames` puts it."""


@dataclass(frozen=True)
class Influence:
    """The 3x3 projectors of one configuration (or a stack of them)."""

    # `limb_1`, `limb_2`: (..., 3, 3), G of any component in limb 1 and in limb 2
    limb_1: Array
    limb_2: Array
    # (..., 3, 3), slide of joint_2, joint_3, joint_4 (rows) for a translation in limb 1 (columns);
    # the turns obey the same rows for a rotation.  Limb 2 has the opposite sign
    slides_limb_1: Array
    link_3: Array  # (..., 3, 3), P = d f'/(f.d), f = b x c: how a screw of limb 1 moves link_3

    def of_components(self) -> Array:
        """G of all elastic components in the order of `ELASTIC`, (..., 8, 3, 3)."""
        return _G_IDENTITY + _G_SIGN * self.limb_2[..., None, :, :]

    def slides(self) -> Array:
        """Slides of joint_2 to joint_4 (rows) by a translation of a component, (..., 8, 3, 3)."""
        return _SLIDE_SIGN * self.slides_limb_1[..., None, :, :]

    def slid(self, moved: Array) -> Array:
        """Slides of joint_2 to joint_4 for translations (..., 8, 3) of the components, (..., 3)."""
        relative = _SLIDE_SIGN[:, 0, 0] @ moved
        slides: Array = (self.slides_limb_1 @ relative[..., None])[..., 0]
        return slides

    def of_frames(self) -> tuple[Array, Array]:
        """Motion of both interface frames of each component for a screw at each component.

        Gives `motor_side`, `platform_side` (..., 8, 8, 3, 3): entry [m, k] maps a screw at
        component k to the screw of component m's frame.
        """
        link_3 = self.link_3[..., None, None, :, :]
        motor_side, platform_side = (
            law[0, :, :, None, None] * IDENTITY + law[1, :, :, None, None] * link_3
            for law in (MOTOR_SIDE_LAW, PLATFORM_SIDE_LAW)
        )
        return motor_side, platform_side

    def through_components(self, motor_side: Array, platform_side: Array) -> Array:
        """Wrench that wrenches on the interface frames send through each component.

        The transpose of `of_frames`.

        `motor_side`, `platform_side` (..., 8, 6): wrench at O on the two frames of each component.
        Gives (..., 8, 6): wrench at O through each component.
        """
        direct, by_link_3 = (
            MOTOR_SIDE_LAW[part].T @ motor_side + PLATFORM_SIDE_LAW[part].T @ platform_side
            for part in (0, 1)
        )
        back = np.swapaxes(self.link_3, -1, -2)[..., None, :, :]
        return direct + both_halves(back, by_link_3)


def influence(configuration: Configuration) -> Influence:
    """Return the influence projectors of a configuration.

    `configuration`: of shape (...), away from the singularity D = 0, where the amplifier 1/(e.b) is
    unbounded.  Gives `Influence`: projectors of shape (..., 3, 3).
    """
    dual = configuration.dual
    # e/(e.b) and f/(f.d) are the dual vectors of b and d.
    q = configuration.b[..., :, None] * dual[..., 0, None, :]
    link_3 = configuration.d[..., :, None] * dual[..., 2, None, :]
    return Influence(IDENTITY - q, q, _DUAL_SIGN * dual, link_3)
