"""Refuse bodies that cannot be put together, before any of them is meshed."""

from __future__ import annotations

from wrist_stiffness.inputs.document import Node
from wrist_stiffness.mechanism.geometry import Geometry

WIDEST_FIT = 0.37e-3
"""Most by which a bore and what sits in it may differ [m]: the largest clearance of H11/c11, the
loosest preferred fit of ISO 286, at 30 mm."""

PINS = {
    ("link_1", "motor_bore"): "joint_1",
    ("link_1", "platform_bore"): "joint_2",
    ("link_2", "motor_bore"): "joint_5",
    ("link_2", "platform_bore"): "joint_4",
    ("link_3", "platform_bore"): "joint_3",
}
"""Bores that hold a joint's pin; link_3's other bore may hold the sleeve of joint_4."""


def check_fits(root: Node, geometry: Geometry) -> None:
    """Refuse pins and sleeves of another size than their bores, and bars that cross.

    Parameters
    ----------
    root : Node
        The opened geometry file, for the places of its values.
    geometry : Geometry
        As read from it.

    Raises
    ------
    GeometryError
        Names the first value that is in the way, its line and the limit.
    """
    links, bushings = geometry.links, geometry.bushings
    rooms = {
        f"{link}.{bore}_mm": (getattr(links[link], bore), joint)
        for (link, bore), joint in PINS.items()
    }
    other, hub, seat = links["link_2"], links["link_3"], bushings["joint_4"]
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
    # At joint_4 these two bars lie one above the other in every pose.
    apart = abs(other.arc_radius - hub.arc_radius)
    if apart < (needed := (other.section_radial + hub.section_radial) / 2.0):
        raise root["links"]["link_3"]["arc_radius_mm"].refuse(
            f"{1e3 * hub.arc_radius:g} is {1e3 * apart:.3g} mm from that of link_2, and the bars "
            f"cross at joint_4: half of both section_radial_mm is {1e3 * needed:.3g} mm"
        )
