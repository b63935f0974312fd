"""`link_stiffness`, `bushing_stiffness`: a part is softer than its finite elements say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class UniformSoftness(Law):
    """Another modulus: all of a part's flexibility, its flanges included, grows alike."""

    component: str  # link or joint
    fraction: float  # extra flexibility over that of the base, > -1 [-]

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Scale flexibility and flanges."""
        scale = 1.0 + self.fraction
        flexibility = parts.flexibility.copy()
        flexibility[ELASTIC.index(self.component)] *= scale
        contact = dict(parts.contact)
        if self.component in contact:
            flange = contact[self.component]
            contact[self.component] = replace(
                flange,
                screw=scale * flange.screw,
                approach=scale * flange.approach,
                weight_approach=scale * flange.weight_approach,
            )
        return replace(parts, flexibility=flexibility, contact=contact)


@dataclass(frozen=True)
class EndHinge(Law):
    """A cracked or badly pressed bore: a link bends more at one end, about all axes there."""

    component: str  # link
    fraction: float  # extra flexibility at the end over the base's mean rotational one [-]
    end: Array  # (3,), centre of that bore from O with the wrist at home [m]

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Add a rotational spring in series."""
        flexibility = parts.flexibility.copy()
        k = ELASTIC.index(self.component)
        hinge = self.fraction * np.trace(flexibility[k, 3:, 3:]) / 3.0
        turn = np.vstack([skew(self.end), np.eye(3)])
        flexibility[k] = flexibility[k] + hinge * turn @ turn.T
        return replace(parts, flexibility=flexibility)
