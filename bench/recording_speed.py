"""Rates of writing, reading and decoding, as ratios to rosbags in the same run.

Run as ``python bench/recording_speed.py [MESSAGES]``.  Needs the packages of the extra ``dev``.
"""

from __future__ import annotations

import sys
import tempfile
import time
import timeit
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from wrist_stiffness.recording import RecordingWriter, open_recording, read_samples
from wrist_stiffness.recording.cdr import decode, encode
from wrist_stiffness.recording.messages import (
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    JointState,
    KeyValue,
    PoseWithCovarianceStamped,
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
            print(
                f"{verb} {name.rpartition('/')[2]:27s} {own:5.1f} us, "
                f"rosbags {rosbags / own:4.2f} x, mcap-ros2-support {support / own:5.2f} x"
            )


def _microseconds(action: Callable[[], object]) -> float:
    return 1e3 * min(timeit.repeat(action, number=1000, timer=time.process_time))


def seconds(action: Callable[[], object]) -> float:
    """Return the time of one call [s]."""
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin


def main() -> None:
    """Print one line for each kind of work."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    angles = np.random.default_rng(0).random((count, 2))
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = Path(folder) / "ours", Path(folder) / "theirs"
        write = seconds(lambda: write_ours(ours, angles))
        write_reference = seconds(lambda: write_rosbags(theirs, angles))
        raw_reference = seconds(lambda: raw_rosbags(ours))
        decode_reference = seconds(lambda: decode_rosbags(ours))
        lines = [
            ("write", write, write_reference),
            (
                "read raw",
                seconds(lambda: sum(1 for _ in open_recording(ours).raw_messages())),
                raw_reference,
            ),
            (
                "read messages",
                seconds(lambda: sum(1 for _ in open_recording(ours).messages())),
                decode_reference,
            ),
            (
                "read as arrays",
                seconds(lambda: read_samples(open_recording(ours))),
                decode_reference,
            ),
        ]
    print(f"{count} joint states     here [1/s]  rosbags [1/s]  ratio")
    for name, here, reference in lines:
        rates = f"{count / here:12.0f} {count / reference:14.0f}"
        print(f"{name:22s} {rates} {reference / here:6.2f}")


if __name__ == "__main__":
    main()
    codecs()
