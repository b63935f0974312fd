"""The wrist to look at, with its error exaggerated: what a node sends and a replay writes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.mechanism.components import LINKS, Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import frame_about, triad
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.messages import (
    ColorRGBA,
    Header,
    Marker,
    MarkerArray,
    MarkerShape,
    Point,
    Pose,
    Vector3,
)
from wrist_stiffness.topics import BASE_FRAME

STEEL = ColorRGBA(0.45, 0.5, 0.55, 1.0)
RIGID = ColorRGBA(0.6, 0.6, 0.6, 0.4)
ACTUAL = ColorRGBA(0.95, 0.5, 0.1, 0.8)
ARROW = ColorRGBA(0.8, 0.1, 0.1, 1.0)

ARC_POINTS = 25
LEGEND = 60
"""Letters of the legend."""


class Pace:
    """Which samples are drawn: so many a second, by their stamps."""

    def __init__(self) -> None:
        self._drawn_ns = -NANOSECONDS

    def takes(self, stamp_ns: int, rate_hz: float) -> bool:
        """Tell whether the sample of a stamp is drawn.

        A stamp before the last one drawn says that the clock jumped back.
        """
        since_s = (stamp_ns - self._drawn_ns) / NANOSECONDS
        if rate_hz == 0.0 or 0.0 <= since_s < 1.0 / rate_hz:
            return False
        self._drawn_ns = stamp_ns
        return True

    def places(self, stamps: NDArray[np.int64], rate_hz: float) -> list[int]:
        """Return which samples of stamps (n,) that do not fall are drawn."""
        found, place = [], 0
        while place < len(stamps) and rate_hz:
            if self.takes(int(stamps[place]), rate_hz):
                found.append(place)
            # What lies between is surely not drawn.
            soon = self._drawn_ns + int(NANOSECONDS / rate_hz)
            place = max(place + 1, int(np.searchsorted(stamps, soon)))
        return found


class WristDrawing:
    """Draws one wrist; `exaggeration`: factor on the error's twist [-]; `frame_id`: name of F."""

    def __init__(self, geometry: Geometry, exaggeration: float, frame_id: str = BASE_FRAME) -> None:
        self._geometry = geometry
        self._exaggeration = exaggeration
        self._frame_id = frame_id
        self._arcs = {link: _arc(geometry, link) for link in LINKS}
        plate = geometry.platform
        # A cylinder stands along its own z.
        self._upright = np.roll(frame_about(plate.normal), -1, axis=1)
        # What stays in all pictures, and where their numbers are; those of points, and of a pose's
        # place and turn, follow one another.
        self._template = encode(MarkerArray(self._markers(LEGEND * "#")))
        self._layout = FixedLayout(MarkerArray, self._template)
        self._leaves = {leaf.path.removeprefix("markers."): leaf for leaf in self._layout.leaves}

    def payloads(
        self, stamps: NDArray[np.int64], configuration: Configuration, twist: Array
    ) -> list[bytes]:
        """Return links, rigid platform, actual platform and the shift of O, drawn n times.

        `stamps` (n,): of the joint states [ns]; `configuration`: the rigid wrist, n times; `twist`
        (n, 6): the pose error at O in F [m, rad].  Gives visualization_msgs/MarkerArray; the text
        says the factor.
        """
        factor, n = self._exaggeration, len(stamps)
        rotation, shift = exp_twist(factor * twist)
        rigid, bodies = configuration.platform, configuration.bodies
        arcs = [self._arcs[link] @ bodies[:, BODIES.index(link)].swapaxes(1, 2) for link in LINKS]
        numbers = {f"{i}.points.0.x": arc.reshape(n, -1) for i, arc in enumerate(arcs)}
        for i, turned, moved in ((3, rigid, 0.0 * shift), (4, rotation @ rigid, shift)):
            numbers[f"{i}.pose.position.x"] = turned @ self._geometry.platform.centre + moved
            turn = Rotation.from_matrix(turned @ self._upright)
            numbers[f"{i}.pose.orientation.x"] = turn.as_quat()
        numbers["5.points.1.x"] = shift
        s_um = 1e6 * np.linalg.norm(exp_twist(twist)[1], axis=1)
        mdeg = 1e3 * np.degrees(np.linalg.norm(twist[:, 3:], axis=1))
        texts = [
            f"s = {s:.2f} um, phi = {phi:.2f} mdeg, drawn x {factor:g}".center(LEGEND)[:LEGEND]
            for s, phi in zip(s_um.tolist(), mdeg.tolist(), strict=True)
        ]
        rows = np.tile(np.frombuffer(self._template, np.uint8), (n, 1))
        for path, leaf in self._leaves.items():
            if path.endswith("header.stamp_ns"):
                self._layout.write(rows, leaf, stamps)
        for path, column in numbers.items():
            self._layout.write(rows, self._leaves[path], column)
        place = self._template.index(LEGEND * b"#")
        legends = np.frombuffer("".join(texts).encode(), np.uint8)
        rows[:, place : place + LEGEND] = legends.reshape(n, LEGEND)
        return [row.tobytes() for row in rows]

    def _markers(self, text: str) -> tuple[Marker, ...]:
        header, geometry, plate = Header(0, self._frame_id), self._geometry, self._geometry.platform

        def marker(name: str, shape: int, colour: ColorRGBA, *size: float, **more: Any) -> Marker:
            scale = Vector3(*size)
            return Marker(header, name, type=shape, color=colour, scale=scale, **more)

        radial = {link: geometry.links[link].section_radial for link in LINKS}
        disc = plate.diameter, plate.diameter, plate.thickness
        arc = (Point(),) * ARC_POINTS
        height = 1.5 * max(link.arc_radius for link in geometry.links.values())
        above = Pose(Point(0.0, 0.0, height))
        return (
            *(
                marker(link, MarkerShape.LINE_STRIP, STEEL, radial[link], points=arc)
                for link in LINKS
            ),
            marker("platform rigid", MarkerShape.CYLINDER, RIGID, *disc),
            marker("platform", MarkerShape.CYLINDER, ACTUAL, *disc),
            marker(
                "shift of O", MarkerShape.ARROW, ARROW, 0.0015, 0.003, points=(Point(), Point())
            ),
            marker(
                "legend",
                MarkerShape.TEXT_VIEW_FACING,
                ARROW,
                0.0,
                0.0,
                0.005,
                pose=above,
                text=text,
            ),
        )


drawing_of = lru_cache(maxsize=2)(WristDrawing)


class Drawings:
    """Draws some samples of a replay, at the pace of a node."""

    def __init__(self, geometry: Geometry, settings: StreamSettings) -> None:
        self._pace, self._rate_hz = Pace(), settings.marker_rate_hz
        frame_id = settings.frames.prefix + BASE_FRAME
        self._drawing = WristDrawing(geometry, settings.marker_exaggeration, frame_id)

    def of(
        self, stamps: NDArray[np.int64], configuration: Configuration, twist: Array
    ) -> tuple[list[int], list[bytes]]:
        """Return which of n samples are drawn, and the drawings (see `WristDrawing.payloads`)."""
        drawn = self._pace.places(stamps, self._rate_hz)
        at = Configuration.of_row(configuration.row[drawn])
        return drawn, self._drawing.payloads(stamps[drawn], at, twist[drawn]) if drawn else []


def _arc(geometry: Geometry, link: str) -> Array:
    """Return points along a link at home, (`ARC_POINTS`, 3) [m]."""
    start, end = geometry.link_ends(link)
    turns = Rotation.from_matrix(np.stack([triad(start, end), triad(end, -start)]))
    arc = Slerp([0.0, 1.0], turns)(np.linspace(0.0, 1.0, ARC_POINTS)).as_matrix()[:, :, 0]
    return np.asarray(geometry.links[link].arc_radius * arc)
