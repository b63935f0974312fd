"""Read and check a geometry file (YAML).

Units are in the keys; every block says where its values come from (`source`).  A message names the
file, the key, the value and the limit.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.mechanism.components import JOINTS, LINKS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.geometry import (
    BushingDimensions,
    Geometry,
    Limits,
    LinkDimensions,
    Material,
    PlatformDimensions,
)
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.yaml_block import Block, read_yaml

SCHEMA = 1
SOURCES = ("paper", "assumed", "calibrated", "measured")
READOUT_SPREAD = 0.1
"""Least ratio of the readout points' spreads: Eqs. (1)-(10) amplify errors on flat sets."""

T = TypeVar("T")


def load_geometry(path: str | Path) -> Geometry:
    """Read a geometry file.

    Parameters
    ----------
    path : path
        A YAML file; `config/palmieri2015.yaml` is the documented example.

    Returns
    -------
    Geometry
        Checked values in SI units.

    Raises
    ------
    GeometryError
        If the file cannot be read, a key is missing, unknown or outside its limits, or the home
        pose is singular.
    """
    return geometry_from_values(read_yaml(path, GeometryError), str(path))


def geometry_from_values(values: Mapping[str, Any], place: str = "geometry") -> Geometry:
    """Build a geometry from the file's values.

    Parameters
    ----------
    values : mapping
        As a geometry file reads.
    place : str
        What error messages call it.

    Returns
    -------
    Geometry
        Checked values in SI units.

    Raises
    ------
    GeometryError
        If a key is missing, unknown or outside its limits, or the home pose is singular.
    """
    root = Block(values, place, GeometryError, SOURCES)
    schema = root.number("schema")
    if schema != SCHEMA:
        raise GeometryError(
            f"{place}.schema: {schema:g} is not {SCHEMA}, the version that this program reads"
        )
    materials = _each(root.block("materials"), _material)
    axes_block = root.block("axes")
    axes = {joint: axes_block.direction(joint) for joint in JOINTS}
    axes_block.done()
    bushings_block, links_block = root.block("bushings"), root.block("links")
    bushings = {joint: _bushing(bushings_block.block(joint), joint, materials) for joint in JOINTS}
    bushings_block.done()
    links = {link: _link(links_block.block(link), materials) for link in LINKS}
    links_block.done()
    platform, load_point = _platform(root.block("platform"), materials)
    limits = _limits(root.block("limits"))
    site = root.block("site")
    gravity = site.vector("gravity_m_s2")
    temperature = site.number("reference_temperature_degC", above=-273.15)
    site.done()
    name, status = root.text("name"), root.text("status", SOURCES)
    if "note" in root.values:
        root.text("note")
    root.no_more_keys()
    geometry = Geometry(
        name=name,
        status=status,
        axes=axes,
        links=links,
        bushings=bushings,
        platform=platform,
        limits=limits,
        gravity=gravity,
        reference_temperature=temperature,
        load_point=load_point,
        sha256=_checksum(values),
    )
    try:
        mechanism_of(geometry)
    except GeometryError as error:
        raise GeometryError(f"{place}.axes: {error}") from error
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


def _each(block: Block, build: Callable[[Block], T]) -> dict[str, T]:
    built = {key: build(block.block(key)) for key in block.values}
    block.done()
    return built


def _material(block: Block) -> Material:
    material = Material(
        young=block.number("young_GPa", 1e9, above=0.0),
        poisson=block.number("poisson", above=-1.0, below=0.5),
        density=block.number("density_kg_m3", above=0.0),
        expansion=block.number("expansion_1e-6_K", 1e-6),
    )
    block.done()
    return material


def _of_material(block: Block, materials: dict[str, Material]) -> Material:
    return materials[block.text("material", tuple(materials))]


def _link(block: Block, materials: dict[str, Material]) -> LinkDimensions:
    link = LinkDimensions(
        arc_radius=block.number("arc_radius_mm", 1e-3, above=0.0),
        section_radial=block.number("section_radial_mm", 1e-3, above=0.0),
        section_axial=block.number("section_axial_mm", 1e-3, above=0.0),
        overhang=block.number("overhang_mm", 1e-3, above=0.0),
        motor_bore=block.number("motor_bore_mm", 1e-3, above=0.0),
        platform_bore=block.number("platform_bore_mm", 1e-3, above=0.0),
        material=_of_material(block, materials),
    )
    block.done()
    for key, bore in (("motor_bore_mm", link.motor_bore), ("platform_bore_mm", link.platform_bore)):
        limit = min(link.section_axial, 2.0 * link.overhang)
        if bore >= limit:
            raise GeometryError(
                f"{block.place}.{key}: {bore * 1e3:g} does not fit into the bar "
                f"(section_axial_mm and twice overhang_mm leave {limit * 1e3:g})"
            )
    if link.section_radial >= 2.0 * link.arc_radius:
        raise GeometryError(
            f"{block.place}.section_radial_mm: {link.section_radial * 1e3:g} reaches past O "
            f"(twice arc_radius_mm is {2e3 * link.arc_radius:g})"
        )
    return link


def _bushing(block: Block, joint: str, materials: dict[str, Material]) -> BushingDimensions:
    gaps: list[float | None] = [None, None]
    if joint in PASSIVE_JOINTS:
        for i, key in enumerate(("inner_gap_um", "outer_gap_um")):
            # 0 = touching, null = no flange.
            gaps[i] = block.optional_number(key, 1e-6, at_least=0.0)
    bushing = BushingDimensions(
        radius=block.number("radius_mm", 1e-3),
        pin_diameter=block.number("pin_diameter_mm", 1e-3, above=0.0),
        length=block.number("length_mm", 1e-3, above=0.0),
        wall=block.number("wall_mm", 1e-3, above=0.0),
        flange_diameter=block.number("flange_diameter_mm", 1e-3, above=0.0),
        flange_thickness=block.number("flange_thickness_mm", 1e-3, above=0.0),
        inner_gap=gaps[0],
        outer_gap=gaps[1],
        material=_of_material(block, materials),
    )
    block.done()
    sleeve = bushing.pin_diameter + 2.0 * bushing.wall
    if bushing.flange_diameter <= sleeve:
        raise GeometryError(
            f"{block.place}.flange_diameter_mm: {bushing.flange_diameter * 1e3:g} is not larger "
            f"than the sleeve, {sleeve * 1e3:g}"
        )
    if abs(bushing.radius) <= bushing.length / 2.0:
        raise GeometryError(
            f"{block.place}.radius_mm: {bushing.radius * 1e3:g} puts the bushing over O "
            f"(half of length_mm is {5e2 * bushing.length:g})"
        )
    return bushing


def _platform(block: Block, materials: dict[str, Material]) -> tuple[PlatformDimensions, Array]:
    normal = block.direction("normal")
    centre = block.vector("centre_mm", 1e-3)
    diameter = block.number("diameter_mm", 1e-3, above=0.0)
    thickness = block.number("thickness_mm", 1e-3, above=0.0)
    material = _of_material(block, materials)
    points = _readout_points(block)
    load_at = block.text("load_at", ("O", "P0"))
    # The plate is rigid; its mass follows from its size, hubs and screws are not modelled.
    mass = material.density * np.pi / 4.0 * diameter**2 * thickness
    platform = PlatformDimensions(
        normal=normal,
        centre=centre,
        diameter=diameter,
        thickness=thickness,
        mass=mass,
        centre_of_gravity=centre - 0.5 * thickness * normal,
        tool_point=block.vector("tool_point_mm", 1e-3),
        readout_points=points,
    )
    block.done()
    return platform, centre if load_at == "P0" else np.zeros(3)


def _readout_points(block: Block) -> Array:
    key = "readout_points_mm"
    points = block.rows(key, 1e-3, at_least=4)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    ratio = spread[2] / spread[0] if spread[0] > 0.0 else 0.0
    if ratio < READOUT_SPREAD:
        raise GeometryError(
            f"{block.place}.{key}: nearly coplanar, smallest over largest spread is {ratio:.3f}, "
            f"below {READOUT_SPREAD}"
        )
    return points


def _limits(block: Block) -> Limits:
    degree = np.pi / 180.0
    limits = Limits(
        joint_lower=block.vector("joint_lower_deg", degree, size=2),
        joint_upper=block.vector("joint_upper_deg", degree, size=2),
        operative_tilt=block.number("operative_tilt_deg", degree, above=0.0, below=180.0),
        map_margin=block.number("map_margin", at_least=1.0, below=10.0),
        singularity=block.number("singularity", above=0.0, below=1.0),
        force=block.number("force_N", above=0.0),
        moment=block.number("moment_Nm", above=0.0),
        encoder_step=block.number("encoder_step_deg", degree, above=0.0),
    )
    block.done()
    if np.any(limits.joint_lower >= limits.joint_upper):
        low, high = (np.degrees(x).tolist() for x in (limits.joint_lower, limits.joint_upper))
        raise GeometryError(
            f"{block.place}.joint_lower_deg: {low} is not below joint_upper_deg, {high}"
        )
    return limits
