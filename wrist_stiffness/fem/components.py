"""From a geometry to the elastic components that the mechanism assembles pose by pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from wrist_stiffness.fem.condensed_store import PACKAGES, CondensedSolid, condense_solid
from wrist_stiffness.fem.parts import RINGS, Part, Solid, wrist_parts
from wrist_stiffness.fem.solids import FLANGES, MeshSettings
from wrist_stiffness.fem.superelement import Interface, Superelement
from wrist_stiffness.mechanism.components import (
    LINKS,
    PASSIVE_JOINTS,
    ElasticComponents,
    FlangeContact,
)
from wrist_stiffness.mechanism.geometry import BushingDimensions, Geometry
from wrist_stiffness.mechanism.pins import in_series, pin_flexibilities
from wrist_stiffness.mechanism.vectors import skew
from wrist_stiffness.progress import Progress, silent

SHIPPED_SIZES = MeshSettings(
    link=1.2e-3, bore=0.8e-3, bushing=0.5e-3, bushing_corner=0.02e-3, bushing_arc=1.4e-3
)
"""Element sizes of the shipped tables, which state what these leave out."""

Condenser = Callable[[Solid, MeshSettings, Interface], CondensedSolid]
"""Makes the superelement of a solid."""


@dataclass(frozen=True)
class Provenance:
    """How elastic components were made."""

    # `nodes`, `elements`: by component; equal parts share one mesh
    nodes: dict[str, int]
    elements: dict[str, int]
    packages: dict[str, str]  # versions


def elastic_components(
    geometry: Geometry,
    sizes: MeshSettings = SHIPPED_SIZES,
    interface: Interface = "rigid",
    progress: Progress = silent,
    condenser: Condenser = condense_solid,
    rings: int = RINGS,
) -> tuple[ElasticComponents, Provenance]:
    """Condense every elastic part of a wrist.

    `interface`: how walls follow their frames; `progress`: called with parts done and in all;
    `condenser`: `condense_solid`, or a `CondensedStore` that remembers; `rings`: contact modes over
    the width of a flange.  Gives `ElasticComponents`: at O in F with the wrist at home.  Raises
    `GeometryError` if a part cannot be built.
    """
    parts = wrist_parts(geometry, rings)
    condensed: dict[Solid, CondensedSolid] = {}
    for done, part in enumerate(parts):
        progress(done, len(parts))
        if part.solid not in condensed:
            condensed[part.solid] = condenser(part.solid, sizes, interface)
    progress(len(parts), len(parts))
    provenance = Provenance(
        nodes={part.name: condensed[part.solid].nodes for part in parts},
        elements={part.name: condensed[part.solid].elements for part in parts},
        packages={package: version(package) for package in PACKAGES},
    )
    elements = {solid: kept.element for solid, kept in condensed.items()}
    return place_components(geometry, parts, elements), provenance


def place_components(
    geometry: Geometry, parts: list[Part], condensed: dict[Solid, Superelement]
) -> ElasticComponents:
    """Turn and move condensed solids to their places in the wrist at home.

    `parts`: its elastic parts, in the order of `ELASTIC`.  Gives `ElasticComponents`: at O in F
    with the wrist at home.
    """
    flexibility, motor_side, platform_side, mass = [], [], [], []
    contact: dict[str, FlangeContact] = {}
    for part in parts:
        element, home = condensed[part.solid], part.home
        own = (geometry.links | geometry.bushings)[part.name].stiffness
        bends = home.screw @ element.flexibility @ home.screw.T if own is None else own.flexibility
        both = np.kron(np.eye(2), home.wrench)
        weights = np.vstack([element.weight_motor_side, element.weight_platform_side])
        weight, inertia = both @ weights @ home.rotation.T, both @ element.mass @ both.T
        if part.name in LINKS and geometry.pins is not None:
            motor_pin, platform_pin = pin_flexibilities(geometry, part.name, geometry.pins)
            bends, follow = in_series(motor_pin, bends, platform_pin)
            weight, inertia = follow.T @ weight, follow.T @ inertia @ follow
        flexibility.append(bends)
        motor_side.append(weight[:6])
        platform_side.append(weight[6:])
        mass.append(inertia)
        if part.name in PASSIVE_JOINTS and part.solid.flanges:
            contact[part.name] = _flange_contact(part, element, geometry.bushings[part.name])
    plate = geometry.platform
    return ElasticComponents(
        flexibility=np.array(flexibility),
        weight_motor_side=np.array(motor_side),
        weight_platform_side=np.array(platform_side),
        platform_weight=plate.mass * np.vstack([np.eye(3), skew(plate.centre_of_gravity)]),
        contact=contact,
        mass=np.array(mass),
    )


def _flange_contact(part: Part, element: Superelement, bushing: BushingDimensions) -> FlangeContact:
    wrench, screw = element.sector_wrench, element.sector_screw
    on_hub = wrench.T @ (element.flexibility @ wrench + screw)
    gap_of = dict(zip(FLANGES, (bushing.inner_gap, bushing.outer_gap), strict=True))
    return FlangeContact(
        sign=np.sign(wrench[2]) * np.sign(bushing.radius),
        screw=part.home.screw @ (element.flexibility @ wrench + screw),
        approach=on_hub + screw.T @ wrench + element.sector_approach,
        weight_approach=element.sector_weight @ part.home.rotation.T,
        gap=np.repeat(
            [gap_of[flange] for flange in part.solid.flanges],
            len(wrench.T) // len(part.solid.flanges),
        ).astype(float),
    )
