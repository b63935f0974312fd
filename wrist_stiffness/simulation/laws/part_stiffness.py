"""`link_stiffness`, `bushing_stiffness`, `mount_compliance`: what is softer than it was drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
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
class InSeries(Law):
    """A flexibility in series with a component."""

    component: str
    added: Callable[[Array], Array]  # what comes to its own flexibility, both (6, 6) at O in F

    def parts(self, parts: ElasticComponents) -> ElasticComponents:
        """Add it."""
        flexibility, k = parts.flexibility.copy(), ELASTIC.index(self.component)
        flexibility[k] += self.added(flexibility[k])
        return replace(parts, flexibility=flexibility)
