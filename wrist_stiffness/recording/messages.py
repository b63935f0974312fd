"""The ROS 2 messages of the wrist's topics as frozen dataclasses.

Each field carries its line of the official ``.msg`` file.  Encoding, decoding, the schema text in a
recording and the type hash all follow from these lines, so a message is declared once.

Two conventions differ from ``rclpy``'s classes: stamps and durations are one integer of
nanoseconds (attribute ``stamp_ns`` for the field ``stamp``), and sequences are tuples.
"""

from __future__ import annotations

from dataclasses import Field, dataclass, field
from enum import IntEnum
from typing import Any, ClassVar, dataclass_transform

MSG_LINE = "msg_line"
MESSAGE_TYPES: dict[str, type[Message]] = {}
"""Classes by full type name."""


def line(text: str, default: Any) -> Any:
    """Declare one field of a message.

    `text`: line of the ``.msg`` file: type, name and, where the file has one, the default value;
    `default`: value in Python where none is given; immutable.
    """
    return field(default=default, metadata={MSG_LINE: text})


@dataclass_transform(frozen_default=True)
class Message:
    """Base of all messages; `ros_type` is the full type name, ``package/msg/Type``."""

    ros_type: ClassVar[str]
    constants: ClassVar[tuple[str, ...]] = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __init_subclass__(cls, package: str) -> None:
        """Make a frozen dataclass of the fields."""
        cls.ros_type = f"{package}/msg/{cls.__name__}"
        dataclass(frozen=True)(cls)
        MESSAGE_TYPES[cls.ros_type] = cls


class Header(Message, package="std_msgs"):
    """Stamp [ns since the epoch of the recording's clock] and coordinate frame."""

    stamp_ns: int = line("builtin_interfaces/Time stamp", 0)
    frame_id: str = line("string frame_id", "")


class String(Message, package="std_msgs"):
    """A text."""

    data: str = line("string data", "")


class Bool(Message, package="std_msgs"):
    """A truth value."""

    data: bool = line("bool data", False)


class Float64(Message, package="std_msgs"):
    """A number; its unit belongs to the topic."""

    data: float = line("float64 data", 0.0)


class MultiArrayDimension(Message, package="std_msgs"):
    """One dimension of an array: label, length and stride [elements]."""

    label: str = line("string label", "")
    size: int = line("uint32 size", 0)
    stride: int = line("uint32 stride", 0)


class MultiArrayLayout(Message, package="std_msgs"):
    """Dimensions of an array, outermost first, and the offset of its first element."""

    dim: tuple[MultiArrayDimension, ...] = line("MultiArrayDimension[] dim", ())
    data_offset: int = line("uint32 data_offset", 0)


class Float64MultiArray(Message, package="std_msgs"):
    """Numbers with a layout."""

    layout: MultiArrayLayout = line("MultiArrayLayout layout", MultiArrayLayout())
    data: tuple[float, ...] = line("float64[] data", ())


class JointState(Message, package="sensor_msgs"):
    """Positions [rad], velocities [rad/s] and efforts [N m] by joint name; may be empty."""

    header: Header = line("std_msgs/Header header", Header())
    name: tuple[str, ...] = line("string[] name", ())
    position: tuple[float, ...] = line("float64[] position", ())
    velocity: tuple[float, ...] = line("float64[] velocity", ())
    effort: tuple[float, ...] = line("float64[] effort", ())


class Temperature(Message, package="sensor_msgs"):
    """Temperature [°C] with its variance [K²], 0 = unknown."""

    header: Header = line("std_msgs/Header header", Header())
    temperature: float = line("float64 temperature", 0.0)
    variance: float = line("float64 variance", 0.0)


class Vector3(Message, package="geometry_msgs"):
    """A free vector."""

    x: float = line("float64 x", 0.0)
    y: float = line("float64 y", 0.0)
    z: float = line("float64 z", 0.0)


class Vector3Stamped(Message, package="geometry_msgs"):
    """A free vector in a frame; its unit belongs to the topic."""

    header: Header = line("std_msgs/Header header", Header())
    vector: Vector3 = line("Vector3 vector", Vector3())


class Point(Message, package="geometry_msgs"):
    """A position [m]."""

    x: float = line("float64 x", 0.0)
    y: float = line("float64 y", 0.0)
    z: float = line("float64 z", 0.0)


class Quaternion(Message, package="geometry_msgs"):
    """A unit quaternion, scalar last."""

    x: float = line("float64 x 0", 0.0)
    y: float = line("float64 y 0", 0.0)
    z: float = line("float64 z 0", 0.0)
    w: float = line("float64 w 1", 1.0)


class Pose(Message, package="geometry_msgs"):
    """Position [m] and orientation."""

    position: Point = line("Point position", Point())
    orientation: Quaternion = line("Quaternion orientation", Quaternion())


class PoseWithCovariance(Message, package="geometry_msgs"):
    """A pose and the row-major 6×6 covariance [m, rad], translation first, fixed axes."""

    pose: Pose = line("Pose pose", Pose())
    covariance: tuple[float, ...] = line("float64[36] covariance", (0.0,) * 36)


class Wrench(Message, package="geometry_msgs"):
    """Force [N] and moment [N m]."""

    force: Vector3 = line("Vector3 force", Vector3())
    torque: Vector3 = line("Vector3 torque", Vector3())


class WrenchStamped(Message, package="geometry_msgs"):
    """A wrench with stamp and frame."""

    header: Header = line("std_msgs/Header header", Header())
    wrench: Wrench = line("Wrench wrench", Wrench())


class PoseStamped(Message, package="geometry_msgs"):
    """A pose with stamp and frame."""

    header: Header = line("std_msgs/Header header", Header())
    pose: Pose = line("Pose pose", Pose())


class PoseWithCovarianceStamped(Message, package="geometry_msgs"):
    """A pose with covariance, stamp and frame."""

    header: Header = line("std_msgs/Header header", Header())
    pose: PoseWithCovariance = line("PoseWithCovariance pose", PoseWithCovariance())


class PoseArray(Message, package="geometry_msgs"):
    """Several poses of one stamp and frame."""

    header: Header = line("std_msgs/Header header", Header())
    poses: tuple[Pose, ...] = line("Pose[] poses", ())


class Transform(Message, package="geometry_msgs"):
    """Translation [m] and rotation from a child frame to its parent."""

    translation: Vector3 = line("Vector3 translation", Vector3())
    rotation: Quaternion = line("Quaternion rotation", Quaternion())


class TransformStamped(Message, package="geometry_msgs"):
    """Where a child frame stands in the header's frame."""

    header: Header = line("std_msgs/Header header", Header())
    child_frame_id: str = line("string child_frame_id", "")
    transform: Transform = line("Transform transform", Transform())


class TFMessage(Message, package="tf2_msgs"):
    """Any number of transforms."""

    transforms: tuple[TransformStamped, ...] = line(
        "geometry_msgs/TransformStamped[] transforms", ()
    )


class JointTrajectoryPoint(Message, package="trajectory_msgs"):
    """State of the joints [rad, rad/s, rad/s², N m] at a time after the start [ns]."""

    positions: tuple[float, ...] = line("float64[] positions", ())
    velocities: tuple[float, ...] = line("float64[] velocities", ())
    accelerations: tuple[float, ...] = line("float64[] accelerations", ())
    effort: tuple[float, ...] = line("float64[] effort", ())
    time_from_start_ns: int = line("builtin_interfaces/Duration time_from_start", 0)


class JointTrajectory(Message, package="trajectory_msgs"):
    """Points of a motion, in the order of `joint_names`."""

    header: Header = line("std_msgs/Header header", Header())
    joint_names: tuple[str, ...] = line("string[] joint_names", ())
    points: tuple[JointTrajectoryPoint, ...] = line("JointTrajectoryPoint[] points", ())


class KeyValue(Message, package="diagnostic_msgs"):
    """One named value of a diagnostic."""

    key: str = line("string key", "")
    value: str = line("string value", "")


class DiagnosticLevel(IntEnum):
    """Severity of a `DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class DiagnosticStatus(Message, package="diagnostic_msgs"):
    """State of one component, `level` as in `DiagnosticLevel`."""

    constants = tuple(f"byte {level.name}={level.value}" for level in DiagnosticLevel)
    level: int = line("byte level", 0)
    name: str = line("string name", "")
    message: str = line("string message", "")
    hardware_id: str = line("string hardware_id", "")
    values: tuple[KeyValue, ...] = line("KeyValue[] values", ())


class DiagnosticArray(Message, package="diagnostic_msgs"):
    """States of several components at one stamp."""

    header: Header = line("std_msgs/Header header", Header())
    status: tuple[DiagnosticStatus, ...] = line("DiagnosticStatus[] status", ())


class ColorRGBA(Message, package="std_msgs"):
    """A colour, 0 to 1."""

    r: float = line("float32 r", 0.0)
    g: float = line("float32 g", 0.0)
    b: float = line("float32 b", 0.0)
    a: float = line("float32 a", 0.0)


class CompressedImage(Message, package="sensor_msgs"):
    """A picture; none in a marker here."""

    header: Header = line("std_msgs/Header header", Header())
    format: str = line("string format", "")
    data: tuple[int, ...] = line("uint8[] data", ())


class UVCoordinate(Message, package="visualization_msgs"):
    """Where a point is in a marker's picture."""

    u: float = line("float32 u", 0.0)
    v: float = line("float32 v", 0.0)


class MeshFile(Message, package="visualization_msgs"):
    """A mesh; none in a marker here."""

    filename: str = line("string filename", "")
    data: tuple[int, ...] = line("uint8[] data", ())


_OF_MARKERS = (
    "ARROW=0 CUBE=1 SPHERE=2 CYLINDER=3 LINE_STRIP=4 LINE_LIST=5 CUBE_LIST=6 SPHERE_LIST=7 "
    "POINTS=8 TEXT_VIEW_FACING=9 MESH_RESOURCE=10 TRIANGLE_LIST=11 ARROW_STRIP=12 "
    "ADD=0 MODIFY=0 DELETE=2 DELETEALL=3"
)


class MarkerShape(IntEnum):
    """What a marker draws; names and values of visualization_msgs/msg/Marker."""

    ARROW = 0
    CYLINDER = 3
    LINE_STRIP = 4
    TEXT_VIEW_FACING = 9


class Marker(Message, package="visualization_msgs"):
    """Something to be drawn, `type` as in `MarkerShape`; sizes [m]."""

    constants = tuple(f"int32 {each}" for each in _OF_MARKERS.split())
    header: Header = line("std_msgs/Header header", Header())
    ns: str = line("string ns", "")
    id: int = line("int32 id", 0)
    type: int = line("int32 type", 0)
    action: int = line("int32 action", 0)
    pose: Pose = line("geometry_msgs/Pose pose", Pose())
    scale: Vector3 = line("geometry_msgs/Vector3 scale", Vector3())
    color: ColorRGBA = line("std_msgs/ColorRGBA color", ColorRGBA())
    lifetime_ns: int = line("builtin_interfaces/Duration lifetime", 0)
    frame_locked: bool = line("bool frame_locked", False)
    points: tuple[Point, ...] = line("geometry_msgs/Point[] points", ())
    colors: tuple[ColorRGBA, ...] = line("std_msgs/ColorRGBA[] colors", ())
    texture_resource: str = line("string texture_resource", "")
    texture: CompressedImage = line("sensor_msgs/CompressedImage texture", CompressedImage())
    uv_coordinates: tuple[UVCoordinate, ...] = line("UVCoordinate[] uv_coordinates", ())
    text: str = line("string text", "")
    mesh_resource: str = line("string mesh_resource", "")
    mesh_file: MeshFile = line("MeshFile mesh_file", MeshFile())
    mesh_use_embedded_materials: bool = line("bool mesh_use_embedded_materials", False)


class MarkerArray(Message, package="visualization_msgs"):
    """Things to be drawn at once."""

    markers: tuple[Marker, ...] = line("Marker[] markers", ())
