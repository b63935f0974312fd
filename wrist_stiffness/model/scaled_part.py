"""A link or bushing whose flexibility is scaled: shared by two effects of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.places import LIMB
from wrist_stiffness.model.situation import Situation


class ScaledPart(Law):
    """Flexibility of a part times (1 + fraction), exactly, contact included.

    In a bushing the flanges scale with it.
    """

    stage = "parts"
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the fraction."""
        return (Parameter("flexibility_percent", -90.0, 10000.0, 30.0, linear=False),)

    def part_factor(self, values: Mapping[str, float]) -> float:
        """Return 1 + fraction."""
        return 1.0 + values["flexibility_percent"]

    def changed(
        self,
        parts: ElasticComponents,
        geometry: Geometry,
        place: str,
        values: Mapping[str, float],
    ) -> ElasticComponents:
        """Return the parts with one of them scaled."""
        factor = self.part_factor(values)
        flexibility = parts.flexibility.copy()
        flexibility[ELASTIC.index(place)] *= factor
        contact = dict(parts.contact)
        if place in contact:
            flange = contact[place]
            contact[place] = replace(
                flange,
                screw=factor * flange.screw,
                approach=factor * flange.approach,
                weight_approach=factor * flange.weight_approach,
            )
        return replace(parts, flexibility=flexibility, contact=contact)


def extra(at: Situation, place: str, fraction: Array) -> Contribution:
    """Return fraction (n,) times the elastic screw of a part as a contribution."""
    return Contribution(**{LIMB[place]: fraction[:, None] * at.elastic_screw(place)})
