"""Rates of writing, reading and decoding, as ratios to rosbags and to mcap in the same run.

Run as ``python bench/recording_speed.py [MESSAGES]``.  mcap is its own reader and writer with
mcap-ros2-support for the messages.  Processor time, the best of three.  Needs the extra ``verify``.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
import timeit
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from wrist_stiffness.recording import RecordingWriter, open_recording, read_samples
from wrist_stiffness.recording.cdr import decode, encode
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.chunk_writer import Messages
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.messages import (
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    JointState,
    KeyValue,
    Message,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.schema import definition_text

NAMES = ("motor_1_joint", "motor_2_joint")
TOPIC = "/joint_states"


def write_ours(path: Path, angles: np.ndarray) -> None:
    """Make, encode and write joint states."""
    with RecordingWriter(path) as writer:
        for index, pair in enumerate(angles.tolist()):
            writer.write(TOPIC, JointState(Header(index, ""), NAMES, tuple(pair)), index)


def write_rosbags(path: Path, angles: np.ndarray) -> None:
    """Make, encode and write the same joint states with rosbags."""
    store = get_typestore(Stores.ROS2_JAZZY)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = (
        store.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    none = np.empty(0)
    with RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(TOPIC, state.__msgtype__, typestore=store)
        for index, pair in enumerate(angles):
            message = state(header(stamp(0, index), ""), list(NAMES), pair, none, none)
            payload = store.serialize_cdr(message, state.__msgtype__)
            writer.write(connection, index, payload)


def write_mcap(path: Path, angles: np.ndarray) -> None:
    """Encode and write the same with mcap's own writer."""
    with path.open("wb") as stream:
        writer = McapWriter(stream)
        schema = writer.register_msgdef(JointState.ros_type, definition_text(JointState.ros_type))
        for index, pair in enumerate(angles.tolist()):
            header = {"stamp": {"sec": 0, "nanosec": index}, "frame_id": ""}
            message = {"header": header, "name": NAMES, "position": pair}
            writer.write_message(TOPIC, schema, message, index, index)
        writer.finish()


def write_block(path: Path, angles: np.ndarray) -> None:
    """Encode and write the same in blocks, as a replay does."""
    layout = FixedLayout.of(JointState(Header(), NAMES, (0.0, 0.0)))
    with RecordingWriter(path) as writer:
        number = writer.channel_id(channel_of(TOPIC, JointState))
        for begin in range(0, len(angles), 4096):
            part = angles[begin : begin + 4096]
            stamps = np.arange(begin, begin + len(part))
            block = Messages()
            block.add(number, stamps, stamps, layout.rows(stamps, part))
            writer.write_block(block)


def raw_mcap(path: Path) -> int:
    """Read payloads."""
    with path.open("rb") as stream:
        return sum(1 for _ in make_reader(stream).iter_messages())


def decode_mcap(path: Path) -> int:
    """Read and decode one by one."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return sum(each.decoded_message is not None for each in reader.iter_decoded_messages())


def raw_rosbags(path: Path) -> int:
    """Read payloads."""
    with AnyReader([path]) as reader:
        return sum(1 for _ in reader.messages())


def decode_rosbags(path: Path) -> int:
    """Read and decode one by one."""
    with AnyReader([path]) as reader:
        return sum(
            reader.deserialize(payload, connection.msgtype) is not None
            for connection, _, payload in reader.messages()
        )


def _header(theirs: Any) -> Header:
    stamp = theirs.stamp
    return Header(1_000_000_000 * stamp.sec + stamp.nanosec, theirs.frame_id)


def _vector(theirs: Any) -> Vector3:
    return Vector3(theirs.x, theirs.y, theirs.z)


def _pose(theirs: Any) -> PoseWithCovariance:
    place, turn = theirs.pose.position, theirs.pose.orientation
    pose = Pose(Point(place.x, place.y, place.z), Quaternion(turn.x, turn.y, turn.z, turn.w))
    return PoseWithCovariance(pose, tuple(theirs.covariance.tolist()))


def _status(theirs: Any) -> DiagnosticStatus:
    values = tuple(KeyValue(each.key, each.value) for each in theirs.values)
    level, name, text, hardware = theirs.level, theirs.name, theirs.message, theirs.hardware_id
    return DiagnosticStatus(level, name, text, hardware, values)


INTO_OURS: dict[type[Message], Callable[[Any], Message]] = {
    JointState: lambda m: JointState(
        _header(m.header),
        tuple(m.name),
        *(tuple(numbers.tolist()) for numbers in (m.position, m.velocity, m.effort)),
    ),
    WrenchStamped: lambda m: WrenchStamped(
        _header(m.header), Wrench(_vector(m.wrench.force), _vector(m.wrench.torque))
    ),
    PoseWithCovarianceStamped: lambda m: PoseWithCovarianceStamped(
        _header(m.header), _pose(m.pose)
    ),
    DiagnosticArray: lambda m: DiagnosticArray(_header(m.header), tuple(map(_status, m.status))),
}
"""From messages of rosbags to those that the project works with."""


def codecs() -> None:
    """Print how long single messages take here, and how many times as long elsewhere."""
    header = Header(5, "ft")
    store = get_typestore(Stores.ROS2_JAZZY)
    values = tuple(KeyValue(f"key {number}", "value") for number in range(20))
    states = (DiagnosticStatus(0, "node", "fine", "", values),)
    for message in (
        JointState(header, NAMES, (0.1, 0.2), (0.0, 0.0), (0.0, 0.0)),
        WrenchStamped(header),
        PoseWithCovarianceStamped(header),
        DiagnosticArray(header, states),
    ):
        name, text, payload = message.ros_type, definition_text(message.ros_type), encode(message)
        reader, writer = generate_dynamic(name, text)[name], serialize_dynamic(name, text)[name]
        theirs, dynamic = store.deserialize_cdr(payload, name), reader(payload)
        for verb, actions in {
            "decode": (
                partial(decode, type(message), payload),
                partial(store.deserialize_cdr, payload, name),
                partial(reader, payload),
            ),
            "encode": (
                partial(encode, message),
                partial(store.serialize_cdr, theirs, name),
                partial(writer, dynamic),
            ),
        }.items():
            own, rosbags, support = (_microseconds(action) for action in actions)
            own, rosbags, support = (_microseconds(action) for action in actions)
            line = (
                f"{verb} {name.rpartition('/')[2]:27s} {own:5.1f} us, "
                f"rosbags {rosbags / own:4.2f} x, mcap-ros2-support {support / own:5.2f} x"
            )
            if verb == "decode":
                into = INTO_OURS[type(message)]
                if into(theirs) != message:
                    raise SystemExit(f"{name}: rosbags decodes another message")
                both = rosbags + _microseconds(partial(into, theirs))
                line += f"; rosbags and then into the class of here {both / own:4.2f} x"
            print(line)


def _microseconds(action: Callable[[], object]) -> float:
    return 1e3 * min(timeit.repeat(action, number=1000, timer=time.process_time))


def seconds(action: Callable[[], object]) -> float:
    """Return the least processor time of three calls [s]."""
    best = float("inf")
    for _ in range(3):
        begin = time.process_time()
        action()
        best = min(best, time.process_time() - begin)
    return best


def main() -> None:
    """Print one line for each kind of work."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    angles = np.random.default_rng(0).random((count, 2))
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs, plain = (Path(folder) / name for name in ("ours", "theirs", "plain.mcap"))

        def anew(write: Callable[[Path, np.ndarray], None], path: Path) -> Callable[[], None]:
            def run() -> None:
                shutil.rmtree(path, ignore_errors=True)
                path.unlink(missing_ok=True)
                write(path, angles)

            return run

        writes = [
            seconds(anew(write, path))
            for write, path in ((write_ours, ours), (write_rosbags, theirs), (write_mcap, plain))
        ]
        blocks = seconds(anew(write_block, Path(folder) / "block"))
        storage = next(ours.glob("*.mcap"))
        raw = [seconds(lambda: raw_rosbags(ours)), seconds(lambda: raw_mcap(storage))]
        decoded = [seconds(lambda: decode_rosbags(ours)), seconds(lambda: decode_mcap(storage))]
        lines = [
            ("write, one by one", *writes),
            ("write, in blocks", blocks, *writes[1:]),
            (
                "read raw",
                seconds(lambda: sum(1 for _ in open_recording(ours).raw_messages())),
                *raw,
            ),
            (
                "read raw, in blocks",
                seconds(lambda: sum(len(block) for block in open_recording(ours).blocks())),
                *raw,
            ),
            (
                "read messages",
                seconds(lambda: sum(1 for _ in open_recording(ours).messages())),
                *decoded,
            ),
            ("read as arrays", seconds(lambda: read_samples(open_recording(ours))), *decoded),
        ]
    print(f"{count} joint states           here [1/s]   rosbags [1/s]  x      mcap [1/s]  x")
    for name, here, *references in lines:
        others = "".join(f"{count / each:14.0f} {each / here:6.2f}" for each in references)
        print(f"{name:26s} {count / here:12.0f} {others}")


if __name__ == "__main__":
    main()
    codecs()
