"""`gravity`, `inertia`: more weight than modelled, another gravity, and fast motion that bends."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.vectors import cross, skew
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class AddedMass(Law):
    """A payload or fitting, fixed to the platform or to a link."""

    component: str  # `platform` or a link
    mass: float  # [kg]
    place: Array  # (3,), centre of gravity from O with the wrist at home [m]

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Add its weight; a link's is held by the bore on the platform's side."""
        weight = self.mass * np.vstack([np.eye(3), skew(self.place)])
        if self.component == "platform":
            return replace(parts, platform_weight=parts.platform_weight + weight)
        carried = parts.weight_platform_side.copy()
        carried[ELASTIC.index(self.component)] += weight
        return replace(parts, weight_platform_side=carried)


@dataclass(frozen=True)
class MountingTilt(Law):
    """The wrist stands askew: gravity has another direction in F."""

    lean: Array  # (3,), rotation vector of the wrist against the vertical [rad]

    def gravity(self, gravity: Array) -> Array:
        """Turn gravity the other way."""
        return Rotation.from_rotvec(-self.lean).apply(gravity)


class Inertia(Law):
    """Newton's and Euler's forces of platform and tool in the motion that the motors make.

    `mass` [kg]; `place` (3,): centre of gravity in U [m]; `gyration`: radius of gyration about it
    [m].
    """

    def __init__(self, mass: float, place: Array, gyration: float) -> None:
        self._mass, self._place, self._gyration = mass, place, gyration
        self._past: list[tuple[float, Array]] = []

    def wrench(self, block: Block) -> Array:
        """Differentiate three spots of the body twice, each a third of it, by the last 3 samples.

        Three equal masses on a circle of the radius of gyration about the centre of gravity.
        """
        angles = 2.0 * np.pi * np.arange(3) / 3.0
        circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)
        spots = self._place + np.sqrt(2.0) * self._gyration * circle
        at = np.einsum("nij,sj->nsi", block.configuration.platform, spots)
        out = np.zeros((len(at), 6))
        for i, now in enumerate(block.time_s):
            self._past = [*self._past[-2:], (float(now), at[i])]
            if len(self._past) == 3:
                force = -self._mass / 3.0 * _acceleration(self._past)
                out[i, :3] = force.sum(axis=0)
                out[i, 3:] = cross(at[i], force).sum(axis=0)
        return out


def _acceleration(past: list[tuple[float, Array]]) -> Array:
    (t0, x0), (t1, x1), (t2, x2) = past
    return 2.0 * ((x2 - x1) / (t2 - t1) - (x1 - x0) / (t1 - t0)) / (t2 - t0)
