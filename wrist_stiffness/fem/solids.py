"""Parametric solids of the links and bushings, with named faces.

A link lies in its own axes: O at the origin, the motor-side bore on +x, the arc in the xy-plane
towards +y.  A bushing lies in its own axes: centre of the sleeve at the origin, bore along z,
"inner" end at -z; only its half section is drawn, `revolve.py` sweeps the mesh.  Shapes are built
in millimetres because the CAD kernel's tolerance is 1e-7 units; the meshes are in metres.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np
from netgen.occ import (
    Axes,
    Axis,
    Cylinder,
    Dir,
    OCCGeometry,
    Pnt,
    WorkPlane,
    X,
    Y,
    Z,
)

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.mechanism.geometry import BushingDimensions, LinkDimensions

FLANGES = ("inner", "outer")
"""Ends of a bushing that can carry a flange, in the order of the contact modes."""

MILLIMETRES = 1e3
"""CAD units per metre."""

PIN_CORNER = 5.0
"""Element size at the ends of a bushing's bore over that at the re-entrant corners of its hub wall,
where the stress is far more singular."""

CAD_TOLERANCE = 1e-6
"""Two corners nearer than this are one [mm]."""


@dataclass(frozen=True)
class MeshSettings:
    """Largest element sizes [m]."""

    link: float  # in the bar of a link
    # at the bore walls of a link, where the rotational terms of its flexibility converge slowest
    bore: float
    # `bushing`, `bushing_corner`: in the half section of a bushing, and at the ends of its hub
    # wall, where the stress of a held edge under a flange is singular
    bushing: float
    bushing_corner: float
    bushing_arc: float  # along the circumference of a bushing, at the hub wall

    def times(self, factor: float) -> MeshSettings:
        """Return all sizes times a factor."""
        return MeshSettings(*(factor * size for size in astuple(self)))


def link_shape(link: LinkDimensions, angle: float, sizes: MeshSettings) -> OCCGeometry:
    """Solid of a link, with the faces `motor_bore` and `platform_bore`.

    `link`: the link's dimensions [m]; `angle`: angle at O between the axes of its bores [rad], in
    (0, pi); `sizes`: element sizes [m], stored in the shape.  Gives `OCCGeometry`: the shape, in
    millimetres.  Raises `GeometryError` if the bar closes on itself or the bores meet.
    """
    radius, radial, axial = (
        MILLIMETRES * v for v in (link.arc_radius, link.section_radial, link.section_axial)
    )
    past_bore = link.overhang / link.arc_radius
    if not 0.0 < angle < math.pi or angle + 2.0 * past_bore >= 2.0 * math.pi:
        raise GeometryError(
            f"link of {math.degrees(angle):.3f} deg with an overhang of "
            f"{math.degrees(past_bore):.3f} deg: need an angle in (0, 180) deg and an open bar"
        )
    between = angle * (link.arc_radius - link.section_radial / 2.0)
    if between <= (link.motor_bore + link.platform_bore) / 2.0:
        raise GeometryError(
            f"bores {between * 1e3:.3f} mm apart at the inside of the bar cut into each other: "
            f"their radii add up to {(link.motor_bore + link.platform_bore) * 5e2:.3f} mm"
        )
    corner = Pnt(radius - radial / 2.0, 0.0, -axial / 2.0)
    section = WorkPlane(Axes(corner, n=-Y, h=X)).Rectangle(radial, axial).Face()
    axis = Axis((0, 0, 0), Z)
    bar = section.Revolve(axis, math.degrees(angle + 2.0 * past_bore))
    bar = bar.Rotate(axis, -math.degrees(past_bore))
    bores = (("motor_bore", link.motor_bore, 0.0), ("platform_bore", link.platform_bore, angle))
    for name, diameter, place in bores:
        outwards = Dir(math.cos(place), math.sin(place), 0.0)
        start = radius - radial
        foot = Pnt(start * math.cos(place), start * math.sin(place), 0.0)
        drill = Cylinder(foot, outwards, r=MILLIMETRES * diameter / 2.0, h=2.0 * radial)
        drill.faces.name = name
        drill.faces.maxh = MILLIMETRES * sizes.bore
        bar = bar - drill
    bar.solids.maxh = MILLIMETRES * sizes.link
    return OCCGeometry(bar)


def bushing_section(bushing: BushingDimensions, sizes: MeshSettings, rings: int) -> OCCGeometry:
    """Half section of a flanged bushing in the plane of x = radius and y = place along the bore.

    Edges: `pin_wall` (the whole bore, under the flanges too), `hub_wall` (the sleeve's outside
    between the flanges) and, where there is a flange, its rings towards the hub from inside out,
    `inner_0`, `inner_1` ... or `outer_0`, ....  Their widths grow as 1, 3, 5, ...: the pressure is
    steepest at the sleeve.
    The ends of the hub wall and of the bore carry the singular stresses of a held edge, so the
    mesh is graded towards them; a section can afford it, a tetrahedral mesh of the solid cannot.

    `bushing`: the bushing's dimensions [m]; its `radius` and the size of its gaps do not enter.
    `sizes`: element sizes [m], stored in the shape.  `rings`: rings over the width of a flange.
    Gives `OCCGeometry`: the plane shape, in millimetres.
    """
    r_pin = MILLIMETRES * bushing.pin_diameter / 2.0
    r_hub = r_pin + MILLIMETRES * bushing.wall
    r_flange = MILLIMETRES * bushing.flange_diameter / 2.0
    half = MILLIMETRES * bushing.length / 2.0
    thickness = MILLIMETRES * bushing.flange_thickness
    has_inner, has_outer = bushing.inner_gap is not None, bushing.outer_gap is not None
    # Corners (r, z), each with the name of the edge that starts there.
    borders = r_hub + (r_flange - r_hub) * (np.arange(rings + 1) / rings) ** 2
    inner = [(r, -half, f"inner_{k}") for k, r in enumerate(borders[1:])][::-1]
    outer = [(r, half, f"outer_{k}") for k, r in enumerate(borders[:-1])]
    outline = [
        (r_pin, -half - thickness * has_inner, None),
        *([(r_flange, -half - thickness, None), *inner] if has_inner else []),
        (r_hub, -half, "hub_wall"),
        *([*outer, (r_flange, half, None)] if has_outer else [(r_hub, half, None)]),
        *([(r_flange, half + thickness, None)] if has_outer else []),
        (r_pin, half + thickness * has_outer, "pin_wall"),
    ]
    drawing = WorkPlane().MoveTo(*outline[0][:2])
    for r, z, _ in outline[1:]:
        drawing.LineTo(r, z)
    section = drawing.Close().Face()
    section.maxh = MILLIMETRES * sizes.bushing
    for edge, (_, _, name) in zip(section.edges, outline, strict=True):
        if name is not None:
            edge.name = name
    for corner in section.vertices:
        if abs(corner.p.x - r_hub) < CAD_TOLERANCE:
            corner.maxh = MILLIMETRES * sizes.bushing_corner
        elif abs(corner.p.x - r_pin) < CAD_TOLERANCE:
            corner.maxh = MILLIMETRES * min(sizes.bushing, PIN_CORNER * sizes.bushing_corner)
    return OCCGeometry(section, dim=2)
