"""The ROS 2 messages of the wrist's topics as frozen dataclasses.

Each field carries its line of the official ``.msg`` file.  Encoding, decoding, the schema text in a
recording and the type hash all follow from these lines, so a message is declared once.

Two conventions differ from ``rclpy``'s classes: stamps and durations are one integer of
nanoseconds (attribute ``stamp_ns`` for the field ``stamp``), and sequences are tuples.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from wrist_stiffness.recording.message import Message, line


@dataclass(frozen=True, slots=True)
class Header(Message):
    """Stamp [ns since the epoch of the recording's clock] and coordinate frame."""

    ros_type = "std_msgs/msg/Header"
    stamp_ns: int = line("builtin_interfaces/Time stamp", 0)
    frame_id: str = line("string frame_id", "")


@dataclass(frozen=True, slots=True)
class String(Message):
    """A text."""

    ros_type = "std_msgs/msg/String"
    data: str = line("string data", "")


@dataclass(frozen=True, slots=True)
class Bool(Message):
    """A truth value."""

    ros_type = "std_msgs/msg/Bool"
    data: bool = line("bool data", False)


@dataclass(frozen=True, slots=True)
class Float64(Message):
    """A number; its unit belongs to the topic."""

    ros_type = "std_msgs/msg/Float64"
    data: float = line("float64 data", 0.0)


@dataclass(frozen=True, slots=True)
class MultiArrayDimension(Message):
    """One dimension of an array: label, length and stride [elements]."""

    ros_type = "std_msgs/msg/MultiArrayDimension"
    label: str = line("string label", "")
    size: int = line("uint32 size", 0)
    stride: int = line("uint32 stride", 0)


@dataclass(frozen=True, slots=True)
class MultiArrayLayout(Message):
    """Dimensions of an array, outermost first, and the offset of its first element."""

    ros_type = "std_msgs/msg/MultiArrayLayout"
    dim: tuple[MultiArrayDimension, ...] = line("MultiArrayDimension[] dim", ())
    data_offset: int = line("uint32 data_offset", 0)


@dataclass(frozen=True, slots=True)
class Float64MultiArray(Message):
    """Numbers with a layout."""

    ros_type = "std_msgs/msg/Float64MultiArray"
    layout: MultiArrayLayout = line("MultiArrayLayout layout", MultiArrayLayout())
    data: tuple[float, ...] = line("float64[] data", ())


@dataclass(frozen=True, slots=True)
class JointState(Message):
    """Positions [rad], velocities [rad/s] and efforts [N m] by joint name; may be empty."""

    ros_type = "sensor_msgs/msg/JointState"
    header: Header = line("std_msgs/Header header", Header())
    name: tuple[str, ...] = line("string[] name", ())
    position: tuple[float, ...] = line("float64[] position", ())
    velocity: tuple[float, ...] = line("float64[] velocity", ())
    effort: tuple[float, ...] = line("float64[] effort", ())


@dataclass(frozen=True, slots=True)
class Temperature(Message):
    """Temperature [°C] with its variance [K²], 0 = unknown."""

    ros_type = "sensor_msgs/msg/Temperature"
    header: Header = line("std_msgs/Header header", Header())
    temperature: float = line("float64 temperature", 0.0)
    variance: float = line("float64 variance", 0.0)


@dataclass(frozen=True, slots=True)
class Vector3(Message):
    """A free vector."""

    ros_type = "geometry_msgs/msg/Vector3"
    x: float = line("float64 x", 0.0)
    y: float = line("float64 y", 0.0)
    z: float = line("float64 z", 0.0)


@dataclass(frozen=True, slots=True)
class Vector3Stamped(Message):
    """A free vector in a frame; its unit belongs to the topic."""

    ros_type = "geometry_msgs/msg/Vector3Stamped"
    header: Header = line("std_msgs/Header header", Header())
    vector: Vector3 = line("Vector3 vector", Vector3())


@dataclass(frozen=True, slots=True)
class Point(Message):
    """A position [m]."""

    ros_type = "geometry_msgs/msg/Point"
    x: float = line("float64 x", 0.0)
    y: float = line("float64 y", 0.0)
    z: float = line("float64 z", 0.0)


@dataclass(frozen=True, slots=True)
class Quaternion(Message):
    """A unit quaternion, scalar last."""

    ros_type = "geometry_msgs/msg/Quaternion"
    x: float = line("float64 x 0", 0.0)
    y: float = line("float64 y 0", 0.0)
    z: float = line("float64 z 0", 0.0)
    w: float = line("float64 w 1", 1.0)


@dataclass(frozen=True, slots=True)
class Pose(Message):
    """Position [m] and orientation."""

    ros_type = "geometry_msgs/msg/Pose"
    position: Point = line("Point position", Point())
    orientation: Quaternion = line("Quaternion orientation", Quaternion())


@dataclass(frozen=True, slots=True)
class PoseWithCovariance(Message):
    """A pose and the row-major 6×6 covariance [m, rad], translation first, fixed axes."""

    ros_type = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = line("Pose pose", Pose())
    covariance: tuple[float, ...] = line("float64[36] covariance", (0.0,) * 36)


@dataclass(frozen=True, slots=True)
class Wrench(Message):
    """Force [N] and moment [N m]."""

    ros_type = "geometry_msgs/msg/Wrench"
    force: Vector3 = line("Vector3 force", Vector3())
    torque: Vector3 = line("Vector3 torque", Vector3())


@dataclass(frozen=True, slots=True)
class WrenchStamped(Message):
    """A wrench with stamp and frame."""

    ros_type = "geometry_msgs/msg/WrenchStamped"
    header: Header = line("std_msgs/Header header", Header())
    wrench: Wrench = line("Wrench wrench", Wrench())


@dataclass(frozen=True, slots=True)
class PoseStamped(Message):
    """A pose with stamp and frame."""

    ros_type = "geometry_msgs/msg/PoseStamped"
    header: Header = line("std_msgs/Header header", Header())
    pose: Pose = line("Pose pose", Pose())


@dataclass(frozen=True, slots=True)
class PoseWithCovarianceStamped(Message):
    """A pose with covariance, stamp and frame."""

    ros_type = "geometry_msgs/msg/PoseWithCovarianceStamped"
    header: Header = line("std_msgs/Header header", Header())
    pose: PoseWithCovariance = line("PoseWithCovariance pose", PoseWithCovariance())


@dataclass(frozen=True, slots=True)
class PoseArray(Message):
    """Several poses of one stamp and frame."""

    ros_type = "geometry_msgs/msg/PoseArray"
    header: Header = line("std_msgs/Header header", Header())
    poses: tuple[Pose, ...] = line("Pose[] poses", ())


@dataclass(frozen=True, slots=True)
class Transform(Message):
    """Translation [m] and rotation from a child frame to its parent."""

    ros_type = "geometry_msgs/msg/Transform"
    translation: Vector3 = line("Vector3 translation", Vector3())
    rotation: Quaternion = line("Quaternion rotation", Quaternion())


@dataclass(frozen=True, slots=True)
class TransformStamped(Message):
    """Where a child frame stands in the header's frame."""

    ros_type = "geometry_msgs/msg/TransformStamped"
    header: Header = line("std_msgs/Header header", Header())
    child_frame_id: str = line("string child_frame_id", "")
    transform: Transform = line("Transform transform", Transform())


@dataclass(frozen=True, slots=True)
class TFMessage(Message):
    """Any number of transforms."""

    ros_type = "tf2_msgs/msg/TFMessage"
    transforms: tuple[TransformStamped, ...] = line(
        "geometry_msgs/TransformStamped[] transforms", ()
    )


@dataclass(frozen=True, slots=True)
class JointTrajectoryPoint(Message):
    """State of the joints [rad, rad/s, rad/s², N m] at a time after the start [ns]."""

    ros_type = "trajectory_msgs/msg/JointTrajectoryPoint"
    positions: tuple[float, ...] = line("float64[] positions", ())
    velocities: tuple[float, ...] = line("float64[] velocities", ())
    accelerations: tuple[float, ...] = line("float64[] accelerations", ())
    effort: tuple[float, ...] = line("float64[] effort", ())
    time_from_start_ns: int = line("builtin_interfaces/Duration time_from_start", 0)


@dataclass(frozen=True, slots=True)
class JointTrajectory(Message):
    """Points of a motion, in the order of `joint_names`."""

    ros_type = "trajectory_msgs/msg/JointTrajectory"
    header: Header = line("std_msgs/Header header", Header())
    joint_names: tuple[str, ...] = line("string[] joint_names", ())
    points: tuple[JointTrajectoryPoint, ...] = line("JointTrajectoryPoint[] points", ())


@dataclass(frozen=True, slots=True)
class KeyValue(Message):
    """One named value of a diagnostic."""

    ros_type = "diagnostic_msgs/msg/KeyValue"
    key: str = line("string key", "")
    value: str = line("string value", "")


class DiagnosticLevel(IntEnum):
    """Severity of a `DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticStatus(Message):
    """State of one component, `level` as in `DiagnosticLevel`."""

    ros_type = "diagnostic_msgs/msg/DiagnosticStatus"
    constants = tuple(f"byte {level.name}={level.value}" for level in DiagnosticLevel)
    level: int = line("byte level", 0)
    name: str = line("string name", "")
    message: str = line("string message", "")
    hardware_id: str = line("string hardware_id", "")
    values: tuple[KeyValue, ...] = line("KeyValue[] values", ())


@dataclass(frozen=True, slots=True)
class DiagnosticArray(Message):
    """States of several components at one stamp."""

    ros_type = "diagnostic_msgs/msg/DiagnosticArray"
    header: Header = line("std_msgs/Header header", Header())
    status: tuple[DiagnosticStatus, ...] = line("DiagnosticStatus[] status", ())


@dataclass(frozen=True, slots=True)
class ColorRGBA(Message):
    """A colour, 0 to 1."""

    ros_type = "std_msgs/msg/ColorRGBA"
    r: float = line("float32 r", 0.0)
    g: float = line("float32 g", 0.0)
    b: float = line("float32 b", 0.0)
    a: float = line("float32 a", 0.0)


@dataclass(frozen=True, slots=True)
class CompressedImage(Message):
    """A picture; none in a marker here."""

    ros_type = "sensor_msgs/msg/CompressedImage"
    header: Header = line("std_msgs/Header header", Header())
    format: str = line("string format", "")
    data: tuple[int, ...] = line("uint8[] data", ())


@dataclass(frozen=True, slots=True)
class UVCoordinate(Message):
    """Where a point is in a marker's picture."""

    ros_type = "visualization_msgs/msg/UVCoordinate"
    u: float = line("float32 u", 0.0)
    v: float = line("float32 v", 0.0)


@dataclass(frozen=True, slots=True)
class MeshFile(Message):
    """A mesh; none in a marker here."""

    ros_type = "visualization_msgs/msg/MeshFile"
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


@dataclass(frozen=True, slots=True)
class Marker(Message):
    """Something to be drawn, `type` as in `MarkerShape`; sizes [m]."""

    ros_type = "visualization_msgs/msg/Marker"
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


@dataclass(frozen=True, slots=True)
class MarkerArray(Message):
    """Things to be drawn at once."""

    ros_type = "visualization_msgs/msg/MarkerArray"
    markers: tuple[Marker, ...] = line("Marker[] markers", ())


MESSAGE_TYPES: dict[str, type[Message]] = {
    each.ros_type: each
    for each in tuple(globals().values())
    if isinstance(each, type) and issubclass(each, Message) and each is not Message
}
