"""`gravity`: more weight than modelled, or a wrist that is not mounted upright."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.vectors import skew
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
