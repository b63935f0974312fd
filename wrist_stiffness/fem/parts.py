"""The eight elastic parts of a wrist: what is meshed, and where it sits.

A part is a solid in its own axes (see `solids.py`) and a placement in F at home.  Equal solids are
the same `Solid`, so that a mesh or a condensation is made once and turned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from wrist_stiffness.fem.elasticity import (
    body_force,
    mass_matrix,
    stiffness_matrix,
    surface_integrals,
)
from wrist_stiffness.fem.mesh import SolidMesh, mesh_solid
from wrist_stiffness.fem.revolve import SECTORS, revolve
from wrist_stiffness.fem.solids import FLANGES, MeshSettings, bushing_section, link_shape
from wrist_stiffness.mechanism.components import ELASTIC, LINKS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.geometry import (
    BushingDimensions,
    Geometry,
    LinkDimensions,
)
from wrist_stiffness.mechanism.material import AnyMaterial
from wrist_stiffness.mechanism.vectors import screws_to_origin, wrenches_to_origin

RINGS = 2
"""Contact modes over the width of a flange; what more would change is stated by each table."""


@dataclass(frozen=True)
class Placement:
    """Where a part's own axes are in F."""

    rotation: Array  # (3, 3), part axes to F
    origin: Array  # (3,), origin of the part's axes in F [m]

    @property
    def screw(self) -> Array:
        """Screws at the part's origin in its axes to screws at O in F (6, 6)."""
        return screws_to_origin(self.origin, self.rotation)

    @property
    def wrench(self) -> Array:
        """Wrenches at the part's origin in its axes to wrenches at O in F (6, 6)."""
        return wrenches_to_origin(self.origin, self.rotation)

    def turned(self, rotation: Array) -> Placement:
        """Turn with a body about O by a rotation (3, 3) in F."""
        return Placement(rotation @ self.rotation, rotation @ self.origin)


@dataclass(frozen=True)
class Solid:
    """One shape to be meshed, and which of its walls are held."""

    # without what does not shape it (a bushing's place, the size of its gaps)
    dimensions: LinkDimensions | BushingDimensions
    angle: float  # between a link's bores [rad]; zero for a bushing
    # `motor_wall`, `platform_wall`: surfaces that follow the frames on the motor side and on the
    # platform side; a bushing turns, and at a passive joint slides, against what is on the platform
    # side
    motor_wall: str
    platform_wall: str
    flanges: tuple[str, ...]  # flanges that take part in contact
    rings: int = RINGS  # contact modes over the width of each sector

    @property
    def material(self) -> AnyMaterial:
        """What it is made of."""
        return self.dimensions.material

    @property
    def is_bushing(self) -> bool:
        """Whether it is a bushing, about z, and not a link."""
        return isinstance(self.dimensions, BushingDimensions)

    @property
    def sectors(self) -> list[str]:
        """Names of the surfaces that carry contact modes, in order."""
        return [
            f"{flange}_{ring}_{sector}"
            for flange in self.flanges
            for ring in range(self.rings)
            for sector in range(SECTORS)
        ]


@dataclass(frozen=True)
class Part:
    """An elastic component as a solid at a place at home."""

    name: str
    solid: Solid
    home: Placement


@dataclass(frozen=True)
class ElasticBody:
    """The finite-element matrices of one solid in its own axes."""

    solid: Solid
    mesh: SolidMesh
    stiffness: sparse.csr_matrix  # (3 n, 3 n) [N/m]
    mass: sparse.csr_matrix  # (n, n) along each direction [kg]
    weight: Array  # (3 n, 3), nodal forces of unit accelerations [N/(m/s^2)]
    # (3 n, m), nodal forces of 1 N spread evenly over each contact sector, pressing the flange away
    # from the hub [-]
    pressure: Array


def wrist_parts(geometry: Geometry, rings: int = RINGS) -> list[Part]:
    """List the elastic parts of a wrist in the order of `ELASTIC`.

    `rings`: contact modes over the width of a flange.
    """
    return [
        _link_part(geometry, name) if name in LINKS else _bushing_part(geometry, name, rings)
        for name in ELASTIC
    ]


def assemble_body(solid: Solid, sizes: MeshSettings) -> ElasticBody:
    """Mesh a solid and assemble its matrices.

    Gives `ElasticBody`: in the solid's own axes.
    """
    if isinstance(solid.dimensions, LinkDimensions):
        return assemble_mesh(solid, mesh_solid(link_shape(solid.dimensions, solid.angle, sizes)))
    sector_arc = math.pi * (solid.dimensions.pin_diameter + 2.0 * solid.dimensions.wall) / SECTORS
    arcs = max(1, math.ceil(sector_arc / sizes.bushing_arc))
    return assemble_mesh(
        solid, revolve(bushing_section(solid.dimensions, sizes, solid.rings), arcs)
    )


def assemble_mesh(solid: Solid, mesh: SolidMesh) -> ElasticBody:
    """Assemble the matrices of a solid on a mesh that names its walls and its flanges' sectors."""
    modes = []
    for sector in solid.sectors:
        away_from_hub = -1.0 if sector.startswith(FLANGES[0]) else 1.0
        share = surface_integrals(mesh, sector)[:, 0]
        modes.append(away_from_hub * share / share.sum())
    pressure = np.zeros((len(mesh.nodes), 3, len(modes)))
    for k, mode in enumerate(modes):
        pressure[:, 2, k] = mode
    mass = mass_matrix(mesh, solid.material.density)
    return ElasticBody(
        solid=solid,
        mesh=mesh,
        stiffness=stiffness_matrix(mesh, solid.material),
        mass=mass,
        weight=body_force(mass),
        pressure=pressure.reshape(3 * len(mesh.nodes), len(modes)),
    )


def _link_part(geometry: Geometry, name: str) -> Part:
    motor_side, platform_side = geometry.link_ends(name)
    normal = np.cross(motor_side, platform_side)
    sine = float(np.linalg.norm(normal))
    # Rounded so that links that differ only in the last digits of their axes share one mesh.
    angle = round(math.atan2(sine, float(motor_side @ platform_side)), 12)
    normal = normal / sine
    axes = np.column_stack([motor_side, np.cross(normal, motor_side), normal])
    bar = replace(geometry.links[name], stiffness=None)
    solid = Solid(bar, angle, "motor_bore", "platform_bore", ())
    return Part(name, solid, Placement(axes, np.zeros(3)))


def _bushing_part(geometry: Geometry, name: str, rings: int) -> Part:
    bushing = geometry.bushings[name]
    outwards = geometry.joint_side(name)
    least = np.eye(3)[np.argmin(np.abs(outwards))]
    across = least - outwards * (least @ outwards)
    across /= np.linalg.norm(across)
    axes = np.column_stack([across, np.cross(outwards, across), outwards])
    gaps = {"inner": bushing.inner_gap, "outer": bushing.outer_gap}
    shape = replace(
        bushing,
        radius=0.0,
        inner_gap=None if bushing.inner_gap is None else 0.0,
        outer_gap=None if bushing.outer_gap is None else 0.0,
        stiffness=None,
    )
    if name in PASSIVE_JOINTS:
        flanges = tuple(end for end in FLANGES if gaps[end] is not None)
        solid = Solid(shape, 0.0, "pin_wall", "hub_wall", flanges, rings)
    else:
        solid = Solid(shape, 0.0, "hub_wall", "pin_wall", ())
    return Part(name, solid, Placement(axes, abs(bushing.radius) * outwards))
