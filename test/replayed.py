"""Recordings of a few messages, and what a replay makes of them."""

import numpy as np

from wrist_stiffness.recording.messages import Header, JointState, Vector3, Wrench, WrenchStamped
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.writer import RecordingWriter

MILLISECOND = 1_000_000
MOTORS = ("motor_1_joint", "motor_2_joint")


def joints(stamp_ns, degrees, names=MOTORS):
    return JointState(Header(stamp_ns), names, tuple(np.radians(degrees).tolist()))


def load(stamp_ns, force, frame="wrist_base"):
    return WrenchStamped(Header(stamp_ns, frame), Wrench(Vector3(*force), Vector3()))


def write(path, timeline):
    """Write entries of a time [ms], a topic and a message."""
    with RecordingWriter(path) as writer:
        for at_ms, topic, message in timeline:
            writer.write(topic, message, at_ms * MILLISECOND)
    return path


def first_seconds(source, seconds, target):
    """Write the beginning of a recording."""
    messages = list(open_recording(source).raw_messages())
    end_ns = messages[0].log_time_ns + 1e9 * seconds
    with RecordingWriter(target) as writer:
        for each in messages:
            if each.log_time_ns < end_ns:
                writer.write_raw(each.channel, each.payload, each.log_time_ns)
    return target


def outputs(path, topic):
    return [message for _, _, message in open_recording(path).messages([topic])]


def shifts(path):
    """Predicted shifts (n, 3) of a replay [m]."""
    points = [m.pose.pose.position for m in outputs(path, "/pose_error_predicted")]
    return np.array([(p.x, p.y, p.z) for p in points])
