"""The wrist to look at, with its error exaggerated."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Point, TransformStamped, Vector3
from scipy.spatial.transform import Rotation, Slerp
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import LINKS, Array
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.urdf import FRAMES
from wrist_stiffness.mechanism.vectors import triad
from wrist_stiffness.model.error_model import Prediction
from wrist_stiffness.ros.conversions import pose_message, time_message
from wrist_stiffness.topics import BASE_FRAME

STEEL = ColorRGBA(r=0.45, g=0.5, b=0.55, a=1.0)
RIGID = ColorRGBA(r=0.6, g=0.6, b=0.6, a=0.4)
ACTUAL = ColorRGBA(r=0.95, g=0.5, b=0.1, a=0.8)
ARROW = ColorRGBA(r=0.8, g=0.1, b=0.1, a=1.0)

ARC_POINTS = 25

UP = np.array([0.0, 0.0, 1.0])


def wrist_markers(
    stamp_ns: int, table: Table, prediction: Prediction, exaggeration: float
) -> MarkerArray:
    """Return links, rigid platform, actual platform and the shift of O.

    Parameters
    ----------
    stamp_ns : int
        Of the joint state [ns].
    table : Table
        For the geometry.
    prediction : Prediction
        The pose error.
    exaggeration : float
        Factor on the error's twist [-].

    Returns
    -------
    MarkerArray
        In `wrist_base`; the text says the factor.
    """
    geometry, configuration = table.geometry, prediction.configuration
    rotation, shift = exp_twist(exaggeration * prediction.twist)
    markers = [_link(geometry, configuration, link) for link in LINKS]
    markers += [
        _platform(geometry, configuration.platform, np.zeros(3), "platform rigid", RIGID),
        _platform(geometry, rotation @ configuration.platform, shift, "platform", ACTUAL),
        _arrow(shift),
        _text(geometry, prediction, exaggeration),
    ]
    for marker in markers:
        marker.header.frame_id = BASE_FRAME
        marker.header.stamp = time_message(stamp_ns)
    return MarkerArray(markers=markers)


def body_transforms(stamp_ns: int, configuration: Configuration) -> list[TransformStamped]:
    """Return where the rigid wrist's bodies are in `wrist_base`, by the names of its URDF.

    The platform's frame is the nominal one: the error is `/pose_error_predicted`, in `wrist_base`.
    """
    found = []
    for body, rotation in zip(BODIES, configuration.bodies, strict=True):
        if FRAMES[body] == BASE_FRAME:
            continue
        message = TransformStamped(child_frame_id=FRAMES[body])
        message.header.frame_id = BASE_FRAME
        message.header.stamp = time_message(stamp_ns)
        quaternion = Rotation.from_matrix(rotation).as_quat(canonical=True)
        message.transform.rotation = pose_message(np.zeros(3), quaternion).orientation
        found.append(message)
    return found


def _link(geometry: Geometry, configuration: Configuration, link: str) -> Marker:
    start, end = geometry.link_ends(link)
    turns = Rotation.from_matrix(np.stack([triad(start, end), triad(end, -start)]))
    arc = Slerp([0.0, 1.0], turns)(np.linspace(0.0, 1.0, ARC_POINTS)).as_matrix()[:, :, 0]
    dimensions = geometry.links[link]
    points = dimensions.arc_radius * arc @ configuration.rotations[link].T
    marker = Marker(ns=link, type=Marker.LINE_STRIP, color=STEEL)
    marker.scale.x = dimensions.section_radial
    marker.points = [_point(each) for each in points]
    return marker


def _platform(
    geometry: Geometry, rotation: Array, shift: Array, name: str, color: ColorRGBA
) -> Marker:
    plate = geometry.platform
    across = np.eye(3)[np.argmin(np.abs(plate.normal))]
    # A cylinder stands along its own z.
    upright = np.roll(triad(plate.normal, across), -1, axis=1)
    turn = Rotation.from_matrix(rotation @ upright).as_quat()
    marker = Marker(ns=name, type=Marker.CYLINDER, color=color)
    marker.pose = pose_message(shift + rotation @ plate.centre, turn)
    marker.scale = Vector3(x=plate.diameter, y=plate.diameter, z=plate.thickness)
    return marker


def _arrow(shift: Array) -> Marker:
    marker = Marker(ns="shift of O", type=Marker.ARROW, color=ARROW)
    marker.scale = Vector3(x=0.0015, y=0.003, z=0.0)
    marker.points = [_point(np.zeros(3)), _point(shift)]
    return marker


def _text(geometry: Geometry, prediction: Prediction, exaggeration: float) -> Marker:
    marker = Marker(ns="legend", type=Marker.TEXT_VIEW_FACING, color=ARROW)
    height = 1.5 * max(link.arc_radius for link in geometry.links.values())
    marker.pose.position = _point(height * UP)
    marker.scale.z = 0.005
    marker.text = (
        f"s = {1e6 * prediction.shift_norm:.2f} um, "
        f"phi = {1e3 * np.degrees(prediction.phi):.2f} mdeg, drawn x {exaggeration:g}"
    )
    return marker


def _point(place: Array) -> Point:
    x, y, z = place.tolist()
    return Point(x=x, y=y, z=z)
