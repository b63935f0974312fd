"""Where bars, pins and plate would run into each other, as points of one inside of the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import CARRIER, ENDS, LINKS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.vectors import frame_about

BOSS = "boss of joint_4"
"""What of link_3 holds joint_4's bushing where this reaches past the bar."""

POINTS_PER_SECTION = 2
"""Along a body for the smaller side of its section, so that none can pass between them."""


@dataclass(frozen=True)
class _Body:
    """A box in polar coordinates of its own (an arc, a disc, a pin): its points, its inside."""

    carrier: str
    axes: Array  # (3, 3), its axes in F at home, as columns
    # `lower`, `upper`: (3,), its limits in radius and angle about its third axis and along it [m,
    # rad, m]
    lower: Array
    upper: Array

    @property
    def points(self) -> Array:
        """Points in F at home, (n, 3) [m]."""
        size = self.upper - self.lower
        size[1] *= self.upper[0]
        step = min(size[0], size[2]) / POINTS_PER_SECTION
        along = [
            np.linspace(low, high, 2 + math.ceil(length / step))
            for low, high, length in zip(self.lower, self.upper, size, strict=True)
        ]
        radius, angle, z = np.stack(np.meshgrid(*along, indexing="ij")).reshape(3, -1)
        own = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
        return np.asarray(own @ self.axes.T)

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points (..., 3) in F at home are inside."""
        x, y, z = np.moveaxis(points @ self.axes, -1, 0)
        middle = (self.lower[1] + self.upper[1]) / 2.0
        angle = middle + np.angle(np.exp(1j * (np.arctan2(y, x) - middle)))
        own = np.stack([np.hypot(x, y), angle, z], axis=-1)
        return np.asarray(np.all((own > self.lower) & (own < self.upper), axis=-1))


def collision(geometry: Geometry, poses: Array) -> tuple[str, str, Array] | None:
    """Return two bodies that are in one place at some pose, and its motor angles; None if none are.

    Bars may hit bars, the plate, the boss of another one and the pins of joints that are not
    theirs; hubs of the platform are not described, and what a joint connects may touch there.

    `poses` (n, 2): motor angles [rad].  Gives a link, then a link, a pin by its joint, `platform`
    or `BOSS`, and (2,) [rad].
    """
    turns = mechanism_of(geometry).forward(poses).rotations
    bars = {name: _bar(geometry, name) for name in LINKS}
    others = {name: _pin(geometry, name) for name in geometry.bushings}
    others |= {"platform": _plate(geometry), BOSS: _boss(geometry)}
    pairs = list(combinations(bars, 2))
    pairs += [
        (bar, other)
        for bar in bars
        for other in others
        if other not in ENDS[bar] and (bar, other) != ("link_3", BOSS)
    ]
    bodies = bars | others
    points = {name: body.points for name, body in bodies.items()}
    far = {name: np.linalg.norm(own, axis=1) for name, own in points.items()}
    for first, second in pairs:
        for inner, outer in ((first, second), (second, first)):
            body = bodies[outer]
            # All turn about O: a body is met in its own shell alone.
            near = (far[inner] > far[outer].min()) & (far[inner] < far[outer].max())
            turned = np.swapaxes(turns[body.carrier], -1, -2) @ turns[bodies[inner].carrier]
            hit = body.contains(points[inner][near] @ np.swapaxes(turned, -1, -2)).any(axis=-1)
            if hit.any():
                return first, second, poses[np.argmax(hit)]
    return None


def _bar(geometry: Geometry, name: str) -> _Body:
    link = geometry.links[name]
    start, end = geometry.link_ends(name)
    normal = np.cross(start, end)
    normal /= np.linalg.norm(normal)
    past = link.overhang / link.arc_radius
    angle = math.atan2(float(np.cross(start, end) @ normal), float(start @ end))
    radial, axial = link.section_radial / 2.0, link.section_axial / 2.0
    return _Body(
        name,
        np.column_stack([start, np.cross(normal, start), normal]),
        np.array([link.arc_radius - radial, -past, -axial]),
        np.array([link.arc_radius + radial, angle + past, axial]),
    )


def _pin(geometry: Geometry, joint: str) -> _Body:
    """Between the bar that holds it and its bushing."""
    bushing, side = geometry.bushings[joint], geometry.joint_side(joint)
    holder = next(link for link in LINKS if joint in ENDS[link])
    ends = abs(bushing.radius), geometry.links[holder].arc_radius
    # It reaches through its bushing.
    low, high = min(ends) - bushing.length / 2.0, max(ends) + bushing.length / 2.0
    return _round(CARRIER[joint], side, bushing.pin_diameter / 2.0, low, high)


def _boss(geometry: Geometry) -> _Body:
    """From its bar to the end of the sleeve that it holds, no wider than the sleeve."""
    seat, arc = geometry.bushings["joint_4"], geometry.links["link_3"].arc_radius
    low = min(arc, abs(seat.radius) - seat.length / 2.0)
    high = max(arc, abs(seat.radius) + seat.length / 2.0)
    sleeve = seat.pin_diameter / 2.0 + seat.wall
    return _round("link_3", geometry.joint_side("joint_4"), sleeve, low, high)


def _plate(geometry: Geometry) -> _Body:
    platform = geometry.platform
    height = float(platform.centre @ platform.normal)
    radius = platform.diameter / 2.0
    return _round("platform", platform.normal, radius, height - platform.thickness, height)


def _round(carrier: str, axis: Array, radius: float, low: float, high: float) -> _Body:
    axes = np.roll(frame_about(axis), -1, axis=1)
    return _Body(
        carrier, axes, np.array([-1e-12, -math.pi, low]), np.array([radius, math.pi, high])
    )
