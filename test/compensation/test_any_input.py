"""Whatever arrives, a stream answers or raises a WristError: nothing else may reach a node."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.monitor import MonitorSettings
from wrist_stiffness.compensation.monitor_stream import MonitorStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.compensation.trajectory import planned_point
from wrist_stiffness.errors import WristError

pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered", "ignore:invalid value")

NAMES = st.lists(
    st.sampled_from(["motor_1_joint", "motor_2_joint", "gripper", ""]), min_size=0, max_size=4
) | st.just(["motor_1_joint", "motor_2_joint"])
# Plausible numbers and all others.
NUMBERS = st.floats(-1.0, 1.0) | st.floats()
STAMPS = st.integers(0, 5_000_000_000) | st.integers(-(2**62), 2**62)
FRAMES = st.sampled_from(["wrist_base", "wrist_platform", "wrist_corrected", "", "tool0"])
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS)
POSITIONS = st.lists(NUMBERS, min_size=2, max_size=2) | st.lists(NUMBERS, max_size=4)

MESSAGES = st.lists(
    st.tuples(st.just("load"), STAMPS, FRAMES, THREE, THREE)
    | st.tuples(st.just("joints"), STAMPS, FRAMES, NAMES, POSITIONS)
    | st.tuples(st.just("trajectory"), STAMPS, FRAMES, NAMES, st.lists(POSITIONS, max_size=3))
    | st.tuples(st.just("pose"), STAMPS, FRAMES, THREE, st.tuples(*[NUMBERS] * 4))
    | st.tuples(st.just("temperature"), STAMPS, FRAMES, NUMBERS, st.none()),
    max_size=12,
)


@settings(max_examples=150, deadline=None)
@given(MESSAGES)
def test_only_our_own_errors_come_out(model, messages):
    plain = StreamSettings()
    predicting = PredictionStream(model, plain)
    correcting = CorrectionStream(model, plain, enabled=True)
    monitoring = MonitorStream(model, plain, MonitorSettings(np.full(6, 1e-6)), 0.02, 1.0)
    for kind, stamp, frame, first, second in messages:
        for stream in (predicting, correcting, monitoring):
            with contextlib.suppress(WristError):
                if kind == "load":
                    stream.loads.add(stamp, frame, first, second)
                elif kind == "temperature":
                    stream.temperatures.add(frame, stamp, first)
        if kind == "joints":
            with contextlib.suppress(WristError):
                twist = predicting.on_joint_state(stamp, first, second).prediction.twist
                assert np.all(np.isfinite(twist))
            with contextlib.suppress(WristError):
                sent = correcting.on_command(stamp, frame, first, second)
                assert np.all(np.isfinite(sent.positions))
            with contextlib.suppress(WristError):
                monitoring.on_joint_state(stamp, first, second)
        elif kind == "trajectory":
            with contextlib.suppress(WristError):
                points = [planned_point(len(first), values, values) for values in second]
                sent = correcting.on_trajectory(stamp, frame, first, points)
                for point in sent.points:
                    assert np.all(np.isfinite([point.positions, point.velocities]))
        elif kind == "pose":
            with contextlib.suppress(WristError):
                monitoring.on_pose(stamp, frame, first, second)
            with contextlib.suppress(WristError):
                monitoring.on_frame_pose(stamp, frame, first, second)
            with contextlib.suppress(WristError):
                monitoring.on_markers(stamp, frame, [first] * 3 + [second[:3]] * 4)
