"""The rigid wrist at given motor angles: its axes and how its bodies are turned."""

from __future__ import annotations

from dataclasses import dataclass

from wrist_stiffness.mechanism.components import Array

BODIES = ("frame", "link_1", "link_2", "platform", "link_3")
"""Rigid bodies, in the order of `Configuration.bodies`."""


@dataclass(frozen=True)
class Configuration:
    """The wrist at given motor angles, rigid, origin at O, everything in F.

    Parameters
    ----------
    theta : (..., 2) float
        Motor angles [rad].
    b, c, d : (..., 3) float
        Unit axes of joint_2, joint_3 and joint_4.
    singularity : (...) float
        D = b . (d x c), zero where the platform gains a freedom (type 2).
    dual : (..., 3, 3) float
        Rows d x c, b x d and c x b over D, the basis dual to (b, c, d): they hold the influence.
    bodies : (..., 5, 3, 3) float
        Rotation of each of `BODIES` from home.
    """

    theta: Array
    b: Array
    c: Array
    d: Array
    singularity: Array
    dual: Array
    bodies: Array

    @property
    def rotations(self) -> dict[str, Array]:
        """Rotation of each body from home by its name, (..., 3, 3)."""
        return {name: self.bodies[..., i, :, :] for i, name in enumerate(BODIES)}

    @property
    def platform(self) -> Array:
        """Rotation U -> F of the rigid platform, (..., 3, 3)."""
        return self.bodies[..., 3, :, :]
