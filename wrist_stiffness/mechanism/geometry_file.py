"""Read and check a geometry file (YAML).

Units are in the keys; every block says where its values come from (`source`).  A message names the
file, the key, the value and the limit.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from wrist_stiffness.errors import GeometryError, WristError
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
from wrist_stiffness.mechanism.vectors import unit

SCHEMA = 1
SOURCES = ("paper", "assumed", "calibrated", "measured")
UNIT_TOLERANCE = 1e-6
"""Home axes are typed with finite digits: they are made unit if their length is this close to 1."""

T = TypeVar("T")


@dataclass
class _Block:
    """One mapping of the file that knows where it stands, so that every error can say it."""

    values: Mapping[str, Any]
    place: str

    def __post_init__(self) -> None:
        if not isinstance(self.values, Mapping):
            raise GeometryError(f"{self.place}: expected a mapping, found {self.values!r}")
        self.used: set[str] = set()

    def _take(self, key: str) -> Any:
        if key not in self.values:
            raise GeometryError(f"{self.place}: {key} is missing")
        self.used.add(key)
        return self.values[key]

    def block(self, key: str) -> _Block:
        return _Block(self._take(key), f"{self.place}.{key}")

    def text(self, key: str, allowed: tuple[str, ...] | None = None) -> str:
        value = self._take(key)
        if not isinstance(value, str) or (allowed and value not in allowed):
            wanted = f"one of {', '.join(allowed)}" if allowed else "a text"
            raise GeometryError(f"{self.place}.{key}: {value!r} is not {wanted}")
        return value

    def number(
        self,
        key: str,
        scale: float = 1.0,
        above: float = -np.inf,
        below: float = np.inf,
        optional: bool = False,
    ) -> float:
        value = self._take(key)
        if value is None and optional:
            return float("nan")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise GeometryError(f"{self.place}.{key}: {value!r} is not a finite number")
        if not above < value < below:
            raise GeometryError(f"{self.place}.{key}: {value} is not between {above} and {below}")
        return float(value) * scale

    def vector(self, key: str, scale: float = 1.0, size: int = 3) -> Array:
        value = self._take(key)
        try:
            vector = np.array(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise GeometryError(
                f"{self.place}.{key}: {value!r} is not a list of {size} numbers"
            ) from error
        if vector.shape != (size,) or not np.all(np.isfinite(vector)):
            raise GeometryError(
                f"{self.place}.{key}: {value!r} is not a list of {size} finite numbers"
            )
        return vector * scale

    def direction(self, key: str) -> Array:
        vector = self.vector(key)
        length = float(np.linalg.norm(vector))
        if abs(length - 1.0) > UNIT_TOLERANCE:
            raise GeometryError(
                f"{self.place}.{key}: {vector.tolist()} has length {length:.9g}, not 1 (within {UNIT_TOLERANCE:.0e})"
            )
        return unit(vector)

    def done(self) -> None:
        """Check the source of the block and that no key was left unread."""
        if "source" in self.values:
            source = self._take("source")
            words = source.values() if isinstance(source, Mapping) else [source]
            for word in words:
                if word not in SOURCES:
                    raise GeometryError(
                        f"{self.place}.source: {word!r} is not one of {', '.join(SOURCES)}"
                    )
            if isinstance(source, Mapping) and (extra := set(source) - set(self.values) - {"rest"}):
                raise GeometryError(
                    f"{self.place}.source names unknown keys: {', '.join(sorted(extra))}"
                )
        elif any(not isinstance(value, Mapping) for value in self.values.values()):
            raise GeometryError(f"{self.place}: source is missing (one of {', '.join(SOURCES)})")
        if unknown := set(self.values) - self.used:
            raise GeometryError(f"{self.place}: unknown key {', '.join(sorted(map(str, unknown)))}")


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
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise GeometryError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise GeometryError(f"{path}: not a YAML file: {' '.join(str(error).split())}") from error
    return geometry_from_values(content, str(path))


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
    root = _Block(values, place)
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
    if "note" in values:
        root.text("note")
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
    if unknown := set(values) - root.used:
        raise GeometryError(f"{place}: unknown key {', '.join(sorted(map(str, unknown)))}")
    try:
        mechanism_of(geometry)
    except WristError as error:
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
    return hashlib.sha256(
        json.dumps(values, sort_keys=True, separators=(",", ":")).encode()
    ).hexdigest()


def _each(block: _Block, build: Callable[[_Block], T]) -> dict[str, T]:
    built = {key: build(block.block(key)) for key in block.values}
    block.done()
    return built


def _material(block: _Block) -> Material:
    material = Material(
        young=block.number("young_GPa", 1e9, above=0.0),
        poisson=block.number("poisson", above=-1.0, below=0.5),
        density=block.number("density_kg_m3", above=0.0),
        expansion=block.number("expansion_1e-6_K", 1e-6),
    )
    block.done()
    return material


def _of_material(block: _Block, materials: dict[str, Material]) -> Material:
    return materials[block.text("material", tuple(materials))]


def _link(block: _Block, materials: dict[str, Material]) -> LinkDimensions:
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
        raise GeometryError(f"{block.place}.section_radial_mm: the bar reaches past O")
    return link


def _bushing(block: _Block, joint: str, materials: dict[str, Material]) -> BushingDimensions:
    gaps: list[float | None] = [None, None]
    if joint in PASSIVE_JOINTS:
        for i, key in enumerate(("inner_gap_um", "outer_gap_um")):
            gap = block.number(key, 1e-6, optional=True)
            if gap < 0.0:
                raise GeometryError(
                    f"{block.place}.{key}: {gap * 1e6:g} is negative (0 = touching, null = no flange)"
                )
            gaps[i] = None if np.isnan(gap) else gap
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
            f"{block.place}.flange_diameter_mm: {bushing.flange_diameter * 1e3:g} is not larger than "
            f"the sleeve, {sleeve * 1e3:g}"
        )
    if abs(bushing.radius) <= bushing.length / 2.0:
        raise GeometryError(
            f"{block.place}.radius_mm: {bushing.radius * 1e3:g}: the bushing reaches past O"
        )
    return bushing


def _platform(block: _Block, materials: dict[str, Material]) -> tuple[PlatformDimensions, Array]:
    normal = block.direction("normal")
    centre = block.vector("centre_mm", 1e-3)
    diameter = block.number("diameter_mm", 1e-3, above=0.0)
    thickness = block.number("thickness_mm", 1e-3, above=0.0)
    material = _of_material(block, materials)
    points_raw = block._take("readout_points_mm")
    try:
        points = np.array(points_raw, dtype=float) * 1e-3
    except (TypeError, ValueError) as error:
        raise GeometryError(
            f"{block.place}.readout_points_mm: not a list of points of 3 numbers"
        ) from error
    if (
        points.ndim != 2
        or points.shape[1] != 3
        or len(points) < 4
        or not np.all(np.isfinite(points))
    ):
        raise GeometryError(
            f"{block.place}.readout_points_mm: shape {points.shape}, needs at least 4 points of 3 finite numbers"
        )
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[2] < 0.1 * spread[0]:
        raise GeometryError(
            f"{block.place}.readout_points_mm: nearly coplanar, ratio {spread[2] / spread[0]:.3f} below 0.1"
        )
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


def _limits(block: _Block) -> Limits:
    degree = np.pi / 180.0
    limits = Limits(
        joint_lower=block.vector("joint_lower_deg", degree, size=2),
        joint_upper=block.vector("joint_upper_deg", degree, size=2),
        operative_tilt=block.number("operative_tilt_deg", degree, above=0.0, below=180.0),
        map_margin=block.number("map_margin", above=0.999, below=10.0),
        singularity=block.number("singularity", above=0.0, below=1.0),
        force=block.number("force_N", above=0.0),
        moment=block.number("moment_Nm", above=0.0),
        encoder_step=block.number("encoder_step_deg", degree, above=0.0),
    )
    block.done()
    if np.any(limits.joint_lower >= limits.joint_upper):
        raise GeometryError(f"{block.place}.joint_lower_deg: not below joint_upper_deg")
    return limits
