"""Pins as beams: from the bar of a link, which holds them, to the bushing in which they turn."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.material import Material
from wrist_stiffness.mechanism.vectors import cross, screws_to_origin

PINS = {
    ("link_1", "motor_bore"): "joint_1",
    ("link_1", "platform_bore"): "joint_2",
    ("link_2", "motor_bore"): "joint_5",
    ("link_2", "platform_bore"): "joint_4",
    ("link_3", "platform_bore"): "joint_3",
}
"""Bores that hold a joint's pin; link_3's other bore may hold the sleeve of joint_4."""

SHEAR = 10.0 / 9.0
"""Section over its area in shear, of a round bar (W. C. Young, Roark's Formulas for Stress and
Strain)."""


def pin_length(geometry: Geometry, link: str, joint: str) -> float:
    """Length of a pin between the faces of its bar and its bushing [m]; negative inside the bar."""
    bar, bushing = geometry.links[link], geometry.bushings[joint]
    between = abs(abs(bushing.radius) - bar.arc_radius)
    return between - (bar.section_radial + bushing.length) / 2.0


def pin_flexibilities(geometry: Geometry, link: str, material: Material) -> tuple[Array, Array]:
    """Return the flexibilities of a link's pins at O in F at home, motor side first (6, 6) each."""
    motor_side, platform_side = (
        _pin_flexibility(geometry, link, PINS.get((link, bore)), material)
        for bore in ("motor_bore", "platform_bore")
    )
    return motor_side, platform_side


def in_series(first: Array, middle: Array, last: Array) -> tuple[Array, Array]:
    """Put a part between two massless ones.

    `first`, `middle`, `last` (6, 6): flexibilities at O.  Gives `flexibility` (6, 6): of all three,
    and `follow` (12, 12): screws of the middle part's two frames by those of the outer frames.
    """
    whole = first + middle + last
    by_first, by_last = (np.linalg.solve(whole, end).T for end in (first, last))
    one = np.eye(6)
    return whole, np.block([[one - by_first, by_first], [by_last, one - by_last]])


def _pin_flexibility(geometry: Geometry, link: str, joint: str | None, material: Material) -> Array:
    if joint is None or (length := pin_length(geometry, link, joint)) <= 0.0:
        return np.zeros((6, 6))
    bar, bushing = geometry.links[link], geometry.bushings[joint]
    outwards, diameter = geometry.joint_side(joint), bushing.pin_diameter
    way = np.sign(abs(bushing.radius) - bar.arc_radius)
    tip = (bar.arc_radius + way * (bar.section_radial / 2.0 + length)) * outwards
    area = np.pi / 4.0 * diameter**2
    stretch = material.young * area
    bend = stretch * diameter**2 / 16.0
    shear = stretch / (2.0 + 2.0 * material.poisson)
    # At the tip, the bar holding the other end; z along the pin.
    across = length**3 / (3.0 * bend) + SHEAR * length / shear
    turn = length / bend
    flexibility = np.diag(
        [across, across, length / stretch, turn, turn, length / (shear * diameter**2 / 8.0)]
    )
    flexibility[[0, 4], [4, 0]] = length * turn / 2.0
    flexibility[[1, 3], [3, 1]] = -length * turn / 2.0
    z = way * outwards
    x = np.linalg.svd(z[None])[2][1]
    axes = np.column_stack([x, cross(z, x), z])
    screw = screws_to_origin(tip, axes)
    return np.asarray(screw @ flexibility @ screw.T)
