"""Refuse what cannot be built or measured in other units, before anything is meshed."""

from __future__ import annotations

import math

import numpy as np

from wrist_stiffness.errors import UnreachablePoseError
from wrist_stiffness.inputs.document import Node
from wrist_stiffness.mechanism.collisions import BOSS, collision
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.kinematics import angles_text
from wrist_stiffness.mechanism.pins import PINS, pin_length
from wrist_stiffness.mechanism.workspace import Workspace

POSES_PER_AXIS = 15
"""Of the grid over the motor angles on which bodies are tried."""

WIDEST_FIT = 0.37e-3
"""Most by which a bore and what sits in it may differ, and most play between a flange and its hub
[m]: the largest clearance of H11/c11, the loosest preferred fit of ISO 286, at 30 mm."""

NAMED = {
    "steel": (200.0, 7850.0),
    "alumin": (70.0, 2700.0),
    "titan": (110.0, 4500.0),
    "brass": (105.0, 8500.0),
    "bronze": (110.0, 8800.0),
    "magnesium": (45.0, 1750.0),
}
"""Young's modulus [GPa] and density [kg/m^3] of metals by the beginning of their names."""

ALLOYS = 2.0
"""Factor by which alloys of one name may differ from these: a wrong unit is ten or more."""

SLOWEST_METAL, METAL_DENSITY, FASTEST = 1000.0, 3000.0, 20e3
"""Speed of sound in a bar [m/s]: lead has 1190, and nothing denser than 3000 kg/m^3 has less;
diamond has 18,500 (M. F. Ashby, Materials Selection in Mechanical Design, chart of E and rho)."""


def check_fits(root: Node, geometry: Geometry) -> None:
    """Refuse impossible materials, pins and sleeves that do not fit, and bodies that collide.

    `root`: the opened geometry file, for the places of its values; `geometry`: as read from it.
    Raises `GeometryError`: names the first value that is in the way, its line and the limit.
    """
    for name, material in root["materials"].value.items():
        if name != "source":
            _check_material(name, material)
    _check_bores(root, geometry)
    _check_pins(root, geometry)
    _check_gaps(root, geometry)
    limits, tilt = root["limits"], np.degrees(geometry.limits.operative_tilt)
    workspace = Workspace(mechanism_of(geometry), geometry.limits)
    try:
        poses = workspace.grid(POSES_PER_AXIS)
    except UnreachablePoseError as error:
        raise limits["operative_tilt_deg"].refuse(
            f"{tilt:g} is not reached in every direction: {error}"
        ) from error
    needed = workspace.operative_border
    for key, beyond in (
        ("joint_lower_deg", needed < geometry.limits.joint_lower),
        ("joint_upper_deg", needed > geometry.limits.joint_upper),
    ):
        if beyond.any():
            low, high = np.degrees([needed.min(axis=0), needed.max(axis=0)])
            raise limits[key].refuse(
                f"{limits[key].plain} stops short of the operative workspace: {tilt:g} deg of "
                f"tilt need motor angles from ({low[0]:.1f}, {low[1]:.1f}) to "
                f"({high[0]:.1f}, {high[1]:.1f}) deg"
            )
    poses = poses[workspace.operative(poses)]
    if not len(poses):
        raise limits["singularity"].refuse(
            f"no pose of the operative workspace has such a |D|, up to {tilt:g} deg of tilt"
        )
    if (found := collision(geometry, poses)) is not None:
        first, second, theta = found
        node, name = _place_of(second, root, geometry)
        raise node.refuse(
            f"{name} and {first} are in one place at motor angles {angles_text(theta)}, in the "
            "operative workspace"
        )


def _place_of(body: str, root: Node, geometry: Geometry) -> tuple[Node, str]:
    """Return the value that places a body, and what the body is called."""
    if body in geometry.links:
        return root["links"][body]["arc_radius_mm"], body
    if body in geometry.bushings:
        return root["bushings"][body]["radius_mm"], f"the pin of {body}"
    if body == BOSS:
        return root["bushings"]["joint_4"]["radius_mm"], f"the {BOSS}"
    return root["platform"]["centre_mm"], "the plate"


def _check_material(name: str, material: Node) -> None:
    moduli, density = (material[key].plain for key in ("young_GPa", "density_kg_m3"))
    for young in moduli if isinstance(moduli, list) else [moduli]:
        for metal, usual in NAMED.items():
            for key, value, normal in zip(
                ("young_GPa", "density_kg_m3"), (young, density), usual, strict=True
            ):
                if name.lower().startswith(metal) and not 1 / ALLOYS < value / normal < ALLOYS:
                    raise material[key].refuse(
                        f"{value:g} is not {name}, which has {normal:g}: another unit?"
                    )
        speed = np.sqrt(1e9 * young / density)
        if speed > FASTEST or (density > METAL_DENSITY and speed < SLOWEST_METAL):
            limit = f"below {FASTEST:g}" if speed > FASTEST else f"at least {SLOWEST_METAL:g}"
            raise material["young_GPa"].refuse(
                f"{young:g} with {density:g} kg/m^3 makes a speed of sound of {speed:.3g} m/s, "
                f"which is {limit} m/s in any material so dense: another unit?"
            )


def _check_bores(root: Node, geometry: Geometry) -> None:
    links, bushings = geometry.links, geometry.bushings
    rooms = {
        f"{link}.{bore}_mm": (getattr(links[link], bore), joint)
        for (link, bore), joint in PINS.items()
    }
    hub, seat = links["link_3"], bushings["joint_4"]
    # A bushing beside the bar sits in a boss, which is not described.
    if abs(abs(seat.radius) - hub.arc_radius) < (seat.length + hub.section_radial) / 2.0:
        rooms["link_3.motor_bore_mm"] = (hub.motor_bore - 2.0 * seat.wall, "joint_4")
    for bore, (room, joint) in rooms.items():
        pin = bushings[joint].pin_diameter
        if abs(pin - room) > WIDEST_FIT:
            raise root["bushings"][joint]["pin_diameter_mm"].refuse(
                f"{1e3 * pin:g} does not fit links.{bore}, which has room for {1e3 * room:g} "
                f"(may differ by {1e3 * WIDEST_FIT:g})"
            )


def _check_pins(root: Node, geometry: Geometry) -> None:
    """Where pins are taken as rigid, none may bend more than the bar that holds it.

    Both as cantilevers of one material under a force along the radius of the bar's arc, without
    shear (W. C. Young, Roark's Formulas for Stress and Strain).
    """
    for (name, _), joint in PINS.items() if geometry.pins is None else ():
        bar, bushing = geometry.links[name], geometry.bushings[joint]
        start, end = geometry.link_ends(name)
        cosine = float(start @ end)
        arc = math.acos(cosine) - cosine * math.sqrt(1.0 - cosine**2)
        bends = bar.arc_radius**3 * arc / 2.0 / (bar.section_axial * bar.section_radial**3 / 12.0)
        inertia = math.pi / 64.0 * bushing.pin_diameter**4
        longest = (3.0 * inertia * bends) ** (1.0 / 3.0)
        length = pin_length(geometry, name, joint)
        if length > longest:
            raise root["bushings"][joint]["radius_mm"].refuse(
                f"{1e3 * bushing.radius:g} leaves {1e3 * length:.1f} mm of pin between {name} and "
                f"its bushing: it would bend more than {name} (at most {1e3 * longest:.1f} mm), "
                "but is taken as rigid; pins: {material: steel} lets all pins bend"
            )


def _check_gaps(root: Node, geometry: Geometry) -> None:
    for joint, bushing in geometry.bushings.items():
        for key, gap in (("inner_gap_um", bushing.inner_gap), ("outer_gap_um", bushing.outer_gap)):
            if gap is not None and gap > WIDEST_FIT:
                raise root["bushings"][joint][key].refuse(
                    f"{1e6 * gap:g} is wider than any fit (at most {1e6 * WIDEST_FIT:g}); "
                    "null = no flange"
                )
