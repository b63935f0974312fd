"""Links and bushings that are more flexible than modelled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, LINKS, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Parameter


class LinkStiffness(Law):
    """Flexibility of a link times (1 + fraction), exactly."""

    id = "link_stiffness"
    stage = "parts"
    places: tuple[str, ...] = LINKS
    sentence = "{place} bends more (or less) than modelled"
    check = "compare the link's section and material with the drawing; look for a crack"
    excited_by = "loads of several sizes and directions at poses all over the workspace"
    inexactness = 0.03
    own = (Parameter("flexibility_percent", -90.0, 10000.0, 30.0, linear=False),)

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


class BushingStiffness(LinkStiffness):
    """The same of a bushing, whose flanges scale with it."""

    id = "bushing_stiffness"
    places = JOINTS
    sentence = "the bushing of {place} gives more (or less) than modelled"
    check = "check the bushing's material, moisture and length; swap it for a new one"
