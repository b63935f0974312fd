"""Read and check a geometry file (YAML).

Units are in the keys; every block says where its values come from (`source`).  A message names the
file, the line, the key, the value and the limit.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.inputs.document import Node, node_of, read_yaml
from wrist_stiffness.inputs.schema import (
    SOURCES,
    Quantity,
    Schema,
    direction,
    list_of,
    mapping_of,
    nullable,
    number,
    record,
    text,
    vector,
    version,
)
from wrist_stiffness.mechanism.components import JOINTS, LINKS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.geometry import (
    BushingDimensions,
    Geometry,
    Limits,
    LinkDimensions,
    PlatformDimensions,
)
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.material import AnyMaterial, Material, read_material
from wrist_stiffness.mechanism.own_stiffness import bearing_pair, own_stiffness
from wrist_stiffness.mechanism.vectors import unit

SCHEMA = 1
READOUT_SPREAD = 0.1
"""Least ratio of the readout points' spreads: Eqs. (1)-(10) amplify errors on flat sets."""

LENGTH = Quantity(number(above=0.0))

# Read when the rest of its part is known.
OWN: dict[str, Schema[Any]] = {"stiffness": lambda node: None}

SITE = record(
    {
        "gravity_m_s2": Quantity(vector()),
        "reference_temperature_degC": Quantity(number(above=-273.15)),
    },
    sources=SOURCES,
)
LIMITS = record(
    {
        **dict.fromkeys(("joint_lower_deg", "joint_upper_deg"), Quantity(vector(2))),
        "operative_tilt_deg": Quantity(number(above=0.0, below=180.0)),
        "map_margin": number(at_least=1.0, below=10.0),
        "singularity": number(above=0.0, below=1.0),
        **dict.fromkeys(("force_N", "moment_Nm", "encoder_step_deg"), Quantity(number(above=0.0))),
    },
    sources=SOURCES,
    make=Limits,
)

T = TypeVar("T")
P = TypeVar("P", LinkDimensions, BushingDimensions)


def load_geometry(path: str | Path) -> Geometry:
    """Read a geometry file.

    `path`: a YAML file; `config/palmieri2015.yaml` is the documented example.  Gives `Geometry`:
    checked values in SI units.  Raises `GeometryError` if the file cannot be read, a key is
    missing, unknown or outside its limits, or the home pose is singular.
    """
    return geometry_of(read_yaml(path, GeometryError))


def geometry_from_values(values: Mapping[str, Any], place: str = "geometry") -> Geometry:
    """Build a geometry from the file's values, for example those in a table.

    `values`: as a geometry file reads; `place`: what error messages call it.  Gives `Geometry`:
    checked values in SI units.  Raises `GeometryError` as `load_geometry`.
    """
    return geometry_of(node_of(values, place, GeometryError))


def geometry_of(root: Node) -> Geometry:
    """Build a geometry from an opened file; as `load_geometry`."""
    materials: dict[str, AnyMaterial] = {}

    def material(node: Node) -> AnyMaterial:
        return materials[text(*materials)(node)]

    def isotropic(node: Node) -> Material:
        found = material(node)
        if not isinstance(found, Material):
            raise node.refuse(f"{node.plain} is orthotropic, pins are isotropic beams")
        return found

    def read_materials(node: Node) -> None:
        materials.update(mapping_of(read_material, SOURCES)(node))
        if not materials:
            raise node.refuse("names no material, parts need one")

    axes: dict[str, Array] = {}

    def read_axes(node: Node) -> dict[str, Array]:
        axes.update(_each(JOINTS, _axis)(node))
        return axes

    link, bushing = _link(material), _bushing(material, axes)
    values = record(
        {
            "schema": version(SCHEMA),
            "materials": read_materials,
            "name": text(),
            "status": text(*SOURCES),
            "axes": read_axes,
            "links": _each(LINKS, link),
            "bushings": _each(JOINTS, bushing),
            "platform": _platform(material),
            "limits": _limits,
            "site": SITE,
        },
        {"note": text(), "pins": record({"material": isotropic}, sources=SOURCES)},
    )(root)
    platform, load_point = values["platform"]
    geometry = Geometry(
        **{key: values[key] for key in ("name", "status", "axes", "links", "bushings", "limits")},
        **values["site"],
        platform=platform,
        load_point=load_point,
        sha256=_checksum(root.plain),
        pins=values.get("pins", {}).get("material"),
    )
    try:
        mechanism_of(geometry)
    except GeometryError as error:
        raise root["axes"].refuse(str(error)) from error
    return geometry


def mechanism_of(geometry: Geometry) -> Mechanism:
    """Return the kinematic scheme of a geometry."""
    axes = geometry.axes
    return Mechanism(
        a1=axes["joint_1"],
        b0=axes["joint_2"],
        c0=axes["joint_3"],
        d0=axes["joint_4"],
        a2=axes["joint_5"],
        n0=geometry.platform.normal,
    )


def _checksum(values: Mapping[str, Any]) -> str:
    """SHA-256 of the values, in an order and layout of its own."""
    plain = {**_plain(values), "schema": SCHEMA}
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    """Make every number a float: 40 and 40.0 are the same length."""
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return float(value) if isinstance(value, int) else value


def _each(names: tuple[str, ...], schema: Schema[T]) -> Schema[dict[str, T]]:
    return record(dict.fromkeys(names, schema), sources=SOURCES)


def _axis(node: Node) -> Array:
    return unit(direction(node))


def _link(material: Schema[AnyMaterial]) -> Schema[LinkDimensions]:
    lengths = ("arc_radius_mm", "section_radial_mm", "section_axial_mm", "overhang_mm")
    bores = ("motor_bore_mm", "platform_bore_mm")
    schema = record(
        {**dict.fromkeys((*lengths, *bores), LENGTH), "material": material},
        OWN,
        sources=SOURCES,
        make=LinkDimensions,
    )

    def read(node: Node) -> LinkDimensions:
        link: LinkDimensions = schema(node)
        limit = min(link.section_axial, 2.0 * link.overhang)
        for key, bore in zip(bores, (link.motor_bore, link.platform_bore), strict=True):
            if bore >= limit:
                raise node[key].refuse(
                    f"{bore * 1e3:g} does not fit into the bar "
                    f"(section_axial_mm and twice overhang_mm leave {limit * 1e3:g})"
                )
        if link.section_radial >= 2.0 * link.arc_radius:
            raise node["section_radial_mm"].refuse(
                f"{link.section_radial * 1e3:g} reaches past O "
                f"(twice arc_radius_mm is {2e3 * link.arc_radius:g})"
            )
        return _with_own(node, link, link.arc_radius, np.zeros((6, 0)))

    return read


def _with_own(node: Node, part: P, distance: float, free: Array) -> P:
    if "stiffness" not in node.value:
        return part
    return replace(part, stiffness=own_stiffness(node["stiffness"], distance, free))


def _bushing(material: Schema[AnyMaterial], axes: dict[str, Array]) -> Schema[BushingDimensions]:
    lengths = ("pin_diameter_mm", "length_mm", "wall_mm", "flange_diameter_mm")
    keys: dict[str, Any] = dict.fromkeys((*lengths, "flange_thickness_mm"), LENGTH)
    keys |= {"radius_mm": Quantity(number()), "material": material}
    # 0 = touching, null = no flange.
    gaps = dict.fromkeys(("inner_gap_um", "outer_gap_um"), Quantity(nullable(number(at_least=0.0))))
    active = record(
        keys, OWN, sources=SOURCES, make=partial(BushingDimensions, inner_gap=None, outer_gap=None)
    )
    passive = record({**keys, **gaps}, OWN, sources=SOURCES, make=BushingDimensions)

    def read(node: Node) -> BushingDimensions:
        joint = node.path.rpartition(".")[2]
        bushing: BushingDimensions = (passive if joint in PASSIVE_JOINTS else active)(node)
        sleeve = bushing.pin_diameter + 2.0 * bushing.wall
        if bushing.flange_diameter <= sleeve:
            raise node["flange_diameter_mm"].refuse(
                f"{bushing.flange_diameter * 1e3:g} is not larger than the sleeve, {sleeve * 1e3:g}"
            )
        if abs(bushing.radius) <= bushing.length / 2.0:
            raise node["radius_mm"].refuse(
                f"{bushing.radius * 1e3:g} puts the bushing over O "
                f"(half of length_mm is {5e2 * bushing.length:g})"
            )
        if "stiffness" in node.value and (bushing.inner_gap, bushing.outer_gap) != (None, None):
            raise node["stiffness"].refuse("is for a joint without flanges: its gaps must be null")
        axis = axes[joint]
        given = node.value.get("stiffness")
        if isinstance(given, Node) and isinstance(given.value, dict) and "bearings" in given.value:
            pair = record({"bearings": bearing_pair(bushing.radius * axis, axis)})
            return replace(bushing, stiffness=pair(given)["bearings"])
        slide_and_turn = np.kron(np.eye(2), axis[:, None]).astype(np.float64)
        return _with_own(node, bushing, abs(bushing.radius), slide_and_turn)

    return read


def _platform(
    material: Schema[AnyMaterial],
) -> Schema[tuple[PlatformDimensions, Array]]:
    return record(
        {
            "normal": _axis,
            **dict.fromkeys(("centre_mm", "tool_point_mm"), Quantity(vector())),
            **dict.fromkeys(("diameter_mm", "thickness_mm"), LENGTH),
            "material": material,
            "readout_points_mm": Quantity(_readout_points),
            "load_at": text("O", "P0"),
        },
        sources=SOURCES,
        make=_plate,
    )


def _plate(
    material: AnyMaterial,
    load_at: str,
    normal: Array,
    centre: Array,
    thickness: float,
    **others: Any,
) -> tuple[PlatformDimensions, Array]:
    # The plate is rigid; its mass follows from its size, hubs and screws are not modelled.
    platform = PlatformDimensions(
        normal=normal,
        centre=centre,
        thickness=thickness,
        mass=material.density * np.pi / 4.0 * others["diameter"] ** 2 * thickness,
        centre_of_gravity=centre - 0.5 * thickness * normal,
        **others,
    )
    return platform, centre if load_at == "P0" else np.zeros(3)


def _readout_points(node: Node) -> Array:
    points = np.array(list_of(vector(), at_least=4)(node))
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    ratio = spread[2] / spread[0] if spread[0] > 0.0 else 0.0
    if ratio < READOUT_SPREAD:
        raise node.refuse(
            f"nearly coplanar, smallest over largest spread is {ratio:.3f}, below {READOUT_SPREAD}"
        )
    return points


def _limits(node: Node) -> Limits:
    limits = LIMITS(node)
    if np.any(limits.joint_lower >= limits.joint_upper):
        low, high = (np.degrees(x).tolist() for x in (limits.joint_lower, limits.joint_upper))
        raise node["joint_lower_deg"].refuse(f"{low} is not below joint_upper_deg, {high}")
    return limits
