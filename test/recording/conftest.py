"""Recordings for the tests of this room, built in code."""

import pytest

from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    String,
    Vector3,
    Wrench,
    WrenchStamped,
)

START_NS = 1_700_000_000_000_000_000


def _timeline(count):
    """Joint states every 1 ms, every second one followed by a load; one note at the start.

    log time [ms]  0      1   2      3   …
    /joint_states  q      q   q      q
    /load_estimate w          w
    /recording_notes n
    """
    yield "/recording_notes", START_NS, String('{"load_source": "ft"}')
    for step in range(count):
        time_ns = START_NS + step * 1_000_000
        angles = (0.001 * step, -0.002 * step)
        names = ("motor_1_joint", "motor_2_joint")
        yield "/joint_states", time_ns, JointState(Header(time_ns, ""), names, angles)
        if step % 2 == 0:
            wrench = Wrench(Vector3(1.0, 2.0, float(step)), Vector3(z=0.5))
            yield "/load_estimate", time_ns, WrenchStamped(Header(time_ns, "wrist_base"), wrench)


def _written(path, entries):
    with RecordingWriter(path) as writer:
        for topic, time_ns, message in entries:
            writer.write(topic, message, time_ns)
    return path


def _mcap_of(path):
    return next(path.glob("*.mcap")) if path.is_dir() else path


def _hidden_in(folder):
    return [entry.name for entry in folder.iterdir() if entry.name.startswith(".")]


@pytest.fixture(scope="session")
def timeline():
    """Return the function that gives (topic, log time, message) of so many joint states."""
    return _timeline


@pytest.fixture(scope="session")
def written():
    """Return the function that writes such entries to a path."""
    return _written


@pytest.fixture(scope="session")
def mcap_of():
    """Return the function that gives the storage file of a folder or bare recording."""
    return _mcap_of


@pytest.fixture(scope="session")
def hidden_in():
    """Return the function that lists what a writer may have left in a folder."""
    return _hidden_in
