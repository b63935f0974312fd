"""What rclpy sends, stored as other recorders do: rosbag2's folder, and Foxglove's bare file."""

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from undamaged import undamaged

from wrist_stiffness.commands.replay import replay
from wrist_stiffness.recording import read_samples
from wrist_stiffness.ros.qos import RELIABLE_QOS

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = {
    "/joint_states": JointState,
    "/motor_commands": JointState,
    "/load_estimate": WrenchStamped,
}
COUNT = 30
STEP_NS = 10_000_000


def name_of(topic):
    package, kind = TYPES[topic].__module__.split(".")[0], TYPES[topic].__name__
    return f"{package}/msg/{kind}"


def as_rosbag2(path, heard):
    """Store serialized messages as rosbag2 does: a folder with metadata, qualities of service."""
    with BagWriter(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            topic: writer.add_connection(topic, name_of(topic), typestore=TYPESTORE)
            for topic in TYPES
        }
        for topic, time_ns, payload in heard:
            writer.write(topics[topic], time_ns, payload)
    return path


def as_foxglove(path, heard, compression):
    """Store them with the mcap library: its profile for ROS 2, definitions as text, two times."""
    path = path.with_suffix(".mcap")
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=4096, compression=compression)
        writer.start("ros2", "foxglove")
        channels = {}
        for topic in TYPES:
            text = TYPESTORE.generate_msgdef(name_of(topic), ros_version=2)[0]
            schema = writer.register_schema(name_of(topic), "ros2msg", text.encode())
            offered = {"offered_qos_profiles": "- history: 1\n  depth: 10\n"}
            channels[topic] = writer.register_channel(topic, "cdr", schema, offered)
        for number, (topic, time_ns, payload) in enumerate(heard):
            writer.add_message(channels[topic], time_ns, payload, time_ns - 1000, number)
        writer.finish()
    return path


STORES = {
    "rosbag2": as_rosbag2,
    **{
        f"mcap {kind.name}": lambda path, heard, kind=kind: as_foxglove(path, heard, kind)
        for kind in CompressionType
    },
}


@pytest.fixture
def heard(graph):
    """Send through rclpy and take the bytes as they come from the wire."""
    found = []
    for topic, kind in TYPES.items():
        graph.probe.create_subscription(
            kind,
            topic,
            lambda payload, topic=topic: found.append((topic, payload)),
            RELIABLE_QOS,
            raw=True,
        )
    for step in range(COUNT):
        stamp_ns = STEP_NS * (step + 1)
        theta = (0.3 * np.sin(0.1 * step), 0.2 * np.cos(0.1 * step))
        graph.load(stamp_ns, (0.0, 0.0, -0.01 * step, 0.001, 0.0, 0.0))
        graph.joints("/joint_states", stamp_ns, theta)
        graph.joints("/motor_commands", stamp_ns, theta)
        graph.until(lambda step=step: len(found) == 3 * (step + 1), "message")
    return [
        (topic, STEP_NS * (1 + number // 3) + number % 3, payload)
        for number, (topic, payload) in enumerate(found)
    ]


@pytest.mark.parametrize("store", STORES.values(), ids=STORES)
def test_what_rclpy_sends_is_read_whole_from_every_recorder(tmp_path, heard, model_path, store):
    path = store(tmp_path / "foreign", heard)
    recording = undamaged(path)
    raw = list(recording.raw_messages())
    assert {topic.name: topic.count for topic in recording.topics} == dict.fromkeys(TYPES, COUNT)
    assert [(each.channel.topic, each.log_time_ns, each.payload) for each in raw] == heard
    step = np.arange(COUNT)
    samples = read_samples(recording)
    theta = np.stack([0.3 * np.sin(0.1 * step), 0.2 * np.cos(0.1 * step)], axis=1)
    assert np.array_equal(samples.joints.position, theta)
    assert np.array_equal(samples.joints.time_ns, STEP_NS * (step + 1))
    assert np.array_equal(samples.loads.wrench[:, 2], -0.01 * step)
    summary = replay(path, model_path, tmp_path / "out.mcap")
    assert (summary.predictions, summary.corrections, summary.damage) == (COUNT, COUNT, "")
