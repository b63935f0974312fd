"""Whatever arrives, a stream answers or raises a WristError: nothing else may reach a node."""

import contextlib
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.intake import static_transform
from wrist_stiffness.compensation.monitor import MonitorSettings, MonitorStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import WristError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law

pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered", "ignore:invalid value")

MOTORS = ["motor_1_joint", "motor_2_joint"]
QUATERNION = st.just((0.0, 0.0, 0.0, 1.0))


def messages_of(stamps, frames, names, numbers, moments, positions, quaternions):
    """Return a strategy of one message of any kind: kind, stamp, frame and two of its fields."""
    three = st.tuples(numbers, numbers, numbers)
    moment = st.tuples(moments, moments, moments)
    plans = st.lists(positions, max_size=3)
    return (
        st.tuples(st.just("load"), stamps, frames, three, moment)
        | st.tuples(st.just("joints"), stamps, frames, names, positions)
        | st.tuples(st.just("trajectory"), stamps, frames, names, plans)
        | st.tuples(st.just("pose"), stamps, frames, three, quaternions)
        | st.tuples(st.just("temperature"), stamps, st.just("link_1"), numbers, st.none())
    )


USUAL = messages_of(
    st.integers(1_000_000_000, 1_200_000_000),
    st.just("wrist_base"),
    st.just(MOTORS),
    st.floats(-1.0, 1.0),
    st.floats(-0.02, 0.02),
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2),
    QUATERNION,
)
NUMBERS = st.floats(-1.0, 1.0) | st.floats()
WILD = messages_of(
    st.integers(0, 5_000_000_000) | st.integers(-(2**62), 2**62),
    st.sampled_from(["wrist_base", "wrist_platform", "wrist_corrected", "", "tool0"]),
    st.lists(st.sampled_from([*MOTORS, "gripper", ""]), max_size=4) | st.just(MOTORS),
    NUMBERS,
    NUMBERS,
    st.lists(NUMBERS, min_size=2, max_size=2) | st.lists(NUMBERS, max_size=4),
    QUATERNION | st.tuples(*[NUMBERS] * 4),
)
SPEEDS = st.lists(NUMBERS, max_size=3)
MESSAGES = st.lists(st.tuples(USUAL | USUAL | USUAL | WILD, SPEEDS), max_size=12)
# With these before them, most of the usual ones get an answer.
NOW = 1_000_000_000
FIRST = [
    (("load", NOW, "wrist_base", (0.1, 0.0, -1.0), (0.0, 0.01, 0.0)), []),
    (("joints", NOW, "", MOTORS, [0.1, -0.2]), []),
    (("trajectory", NOW, "", MOTORS, [[0.1, -0.2]]), []),
    (("pose", NOW, "wrist_base", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), []),
]
EXAMPLES = 100


# Every effect that a node can meet with a memory, with speeds or with signals.
EFFECTS = [
    ("backlash", "motor_1"),
    ("creep", "joint_3"),
    ("inertia", "platform"),
    ("joint_friction", "joint_2"),
    ("joint_clearance", "joint_4"),
    ("thermal_expansion", "link_1"),
    ("time_delay", "motor_2"),
    ("cable_wrench", "platform"),
]


@pytest.mark.parametrize("effects", [[], EFFECTS], ids=["plain", "with effects"])
def test_only_our_own_errors_come_out(model, effects):
    found = model.with_effects(*(Effect(find_law(name), place, {}) for name, place in effects))
    answers = Counter()

    @settings(max_examples=EXAMPLES)
    @given(MESSAGES)
    def check(messages):
        answers.update(answers_of(found, messages))

    check()
    # The wild ones met streams at work, not ones that refuse everything.
    for kind in ("predicted", "corrected", "planned", "judged"):
        assert answers[kind] >= EXAMPLES


def answers_of(model, messages):
    """Send messages to the streams; every number that comes out is finite.  Return what came."""
    plain = StreamSettings()
    predicting = PredictionStream(model, plain)
    correcting = CorrectionStream(model, plain, enabled=True)
    monitoring = MonitorStream(
        model, plain, MonitorSettings(np.full(6, 1e-6), joint_age_limit_s=0.5)
    )
    answers = Counter()

    def came(kind, *numbers):
        assert all(np.all(np.isfinite(number)) for number in numbers)
        answers[kind] += 1

    for (kind, stamp, frame, first, second), speeds in FIRST + messages:
        for stream in (predicting, correcting, monitoring):
            with contextlib.suppress(WristError):
                if kind == "load":
                    stream.loads.add(stamp, frame, first, second)
                elif kind == "temperature":
                    stream.temperatures.add(frame, stamp, first)
                    stream.covariates.add(frame, stamp, first)
        if kind == "joints":
            with contextlib.suppress(WristError):
                prediction = predicting.on_joint_state(stamp, first, second, speeds)
                came("predicted", prediction.twist, prediction.covariance)
            with contextlib.suppress(WristError):
                sent = correcting.on_command(stamp, frame, first, second, speeds)
                came("corrected" if sent.correction else "passed", sent.positions)
            with contextlib.suppress(WristError):
                monitoring.on_joint_state(stamp, first, second, speeds)
        elif kind == "trajectory":
            with contextlib.suppress(WristError):
                points = [planned_point(len(first), values, values) for values in second]
                sent = correcting.on_trajectory(stamp, frame, first, points)
                for point in sent.points:
                    came("planned", point.positions, point.velocities)
        elif kind == "pose":
            with contextlib.suppress(WristError):
                came("judged", monitoring.on_pose(stamp, frame, first, second).residual)
            with contextlib.suppress(WristError):
                came(
                    "markers",
                    monitoring.on_markers(stamp, frame, [first] * 3 + [second[:3]] * 4).residual,
                )
            with contextlib.suppress(WristError):
                predicting.on_static_transforms(
                    [static_transform("wrist_base", "ft", first, second)]
                )
            with contextlib.suppress(WristError):
                monitoring.on_frame_pose(stamp, frame, first, second)
    return answers
