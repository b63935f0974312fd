"""The wrist to look at, with its error exaggerated: what a node sends and a replay writes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.mechanism.components import LINKS, Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import triad
from wrist_stiffness.recording.messages import (
    ColorRGBA,
    Header,
    Marker,
    MarkerArray,
    MarkerShape,
    Point,
    Pose,
    Quaternion,
    Vector3,
)
from wrist_stiffness.topics import BASE_FRAME

STEEL = ColorRGBA(0.45, 0.5, 0.55, 1.0)
RIGID = ColorRGBA(0.6, 0.6, 0.6, 0.4)
ACTUAL = ColorRGBA(0.95, 0.5, 0.1, 0.8)
ARROW = ColorRGBA(0.8, 0.1, 0.1, 1.0)

ARC_POINTS = 25


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


class WristDrawing:
    """Draws one wrist.

    Parameters
    ----------
    geometry : Geometry
        Its dimensions.
    exaggeration : float
        Factor on the error's twist [-].
    frame_id : str
        Name of F.
    """

    def __init__(self, geometry: Geometry, exaggeration: float, frame_id: str = BASE_FRAME) -> None:
        self._geometry = geometry
        self._exaggeration = exaggeration
        self._frame_id = frame_id
        self._arcs = {link: _arc(geometry, link) for link in LINKS}
        plate = geometry.platform
        across = np.eye(3)[np.argmin(np.abs(plate.normal))]
        # A cylinder stands along its own z.
        self._upright = np.roll(triad(plate.normal, across), -1, axis=1)

    def message(self, stamp_ns: int, configuration: Configuration, twist: Array) -> MarkerArray:
        """Return links, rigid platform, actual platform and the shift of O.

        Parameters
        ----------
        stamp_ns : int
            Of the joint state [ns].
        configuration : Configuration
            The rigid wrist.
        twist : (6,) float
            The pose error at O in F [m, rad].

        Returns
        -------
        MarkerArray
            In `wrist_base`; the text says the factor.
        """
        header = Header(stamp_ns, self._frame_id)
        factor, rigid = self._exaggeration, configuration.platform
        rotation, shift = exp_twist(factor * twist)
        turned = np.stack([rigid, rotation @ rigid])
        turns = Rotation.from_matrix(turned @ self._upright).as_quat().tolist()
        centres = turned @ self._geometry.platform.centre + [np.zeros(3), shift]
        markers = [self._link(header, configuration, link) for link in LINKS]
        s_um = 1e6 * float(np.linalg.norm(exp_twist(twist)[1]))
        mdeg = 1e3 * float(np.degrees(np.linalg.norm(twist[3:])))
        height = 1.5 * max(link.arc_radius for link in self._geometry.links.values())
        return MarkerArray(
            (
                *markers,
                self._platform(header, centres[0], turns[0], "platform rigid", RIGID),
                self._platform(header, centres[1], turns[1], "platform", ACTUAL),
                Marker(
                    header,
                    "shift of O",
                    type=MarkerShape.ARROW,
                    color=ARROW,
                    scale=Vector3(0.0015, 0.003, 0.0),
                    points=(Point(), Point(*shift.tolist())),
                ),
                Marker(
                    header,
                    "legend",
                    type=MarkerShape.TEXT_VIEW_FACING,
                    color=ARROW,
                    pose=Pose(Point(0.0, 0.0, height)),
                    scale=Vector3(0.0, 0.0, 0.005),
                    text=f"s = {s_um:.2f} um, phi = {mdeg:.2f} mdeg, drawn x {factor:g}",
                ),
            )
        )

    def _link(self, header: Header, configuration: Configuration, link: str) -> Marker:
        points = self._arcs[link] @ configuration.bodies[BODIES.index(link)].T
        return Marker(
            header,
            link,
            type=MarkerShape.LINE_STRIP,
            color=STEEL,
            scale=Vector3(self._geometry.links[link].section_radial, 0.0, 0.0),
            points=tuple(Point(*each) for each in points.tolist()),
        )

    def _platform(
        self, header: Header, centre: Array, turn: list[float], name: str, color: ColorRGBA
    ) -> Marker:
        plate = self._geometry.platform
        return Marker(
            header,
            name,
            type=MarkerShape.CYLINDER,
            color=color,
            pose=Pose(Point(*centre.tolist()), Quaternion(*turn)),
            scale=Vector3(plate.diameter, plate.diameter, plate.thickness),
        )


class Drawings:
    """Draws some samples of a replay, at the pace of a node.

    Parameters
    ----------
    geometry : Geometry
        Of the wrist.
    settings : StreamSettings
        Rate and exaggeration.
    """

    def __init__(self, geometry: Geometry, settings: StreamSettings) -> None:
        self._pace, self._rate_hz = Pace(), settings.marker_rate_hz
        frame_id = settings.frames.prefix + BASE_FRAME
        self.message = WristDrawing(geometry, settings.marker_exaggeration, frame_id).message

    def take(self, stamp_ns: int) -> bool:
        """Tell whether the sample of a stamp is drawn."""
        return self._pace.takes(stamp_ns, self._rate_hz)


def _arc(geometry: Geometry, link: str) -> Array:
    """Return points along a link at home, (`ARC_POINTS`, 3) [m]."""
    start, end = geometry.link_ends(link)
    turns = Rotation.from_matrix(np.stack([triad(start, end), triad(end, -start)]))
    arc = Slerp([0.0, 1.0], turns)(np.linspace(0.0, 1.0, ARC_POINTS)).as_matrix()[:, :, 0]
    return np.asarray(geometry.links[link].arc_radius * arc)
