import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import (
    COMMAND,
    Frames,
    MotorNames,
    SensorFrame,
    frames_from_yaml,
)
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME

NAMES = ["motor_1_joint", "motor_2_joint"]

numbers = st.floats(-10.0, 10.0)
vectors = st.tuples(numbers, numbers, numbers)


@given(st.permutations(["a", "b", *NAMES]))
def test_angles_are_found_by_name(names):
    values = {"a": 7.0, "b": 8.0, "motor_1_joint": 0.1, "motor_2_joint": -0.2}
    theta = MotorNames().angles(names, [values[name] for name in names])
    assert theta.tolist() == [0.1, -0.2]


@pytest.mark.parametrize(
    ("names", "positions", "text"),
    [
        (["motor_1_joint"], [0.0], "motor_2_joint is missing"),
        ([], [], "motor_1_joint is missing among no names"),
        ([*NAMES, "motor_1_joint"], [0.0, 0.0, 0.0], "motor_1_joint is named 2 times"),
        (NAMES, [0.0], "1 positions for 2 names"),
        (NAMES, [0.0, float("nan")], "not finite"),
        (NAMES, [float("inf"), 0.0], "not finite"),
    ],
)
def test_a_joint_state_without_both_angles_is_refused(names, positions, text):
    with pytest.raises(InputError, match=text):
        MotorNames().angles(names, positions)


def test_a_command_is_called_a_command():
    with pytest.raises(InputError, match="command: motor angles"):
        MotorNames().angles(NAMES, [float("nan"), 0.0], COMMAND)


@given(
    vectors,
    vectors,
    vectors,
    vectors,
    vectors,
    vectors,
    st.sampled_from(["platform", "environment"]),
)
def test_moving_a_wrench_to_the_origin_keeps_its_work(
    force, moment, position, turn, velocity, spin, acts_on
):
    """The work on any rigid motion is the same at the sensor and at O, of opposite sign for a
    sensor that reports what the platform does to the environment."""
    rotation = Rotation.from_rotvec(turn).as_matrix()
    frame = SensorFrame(PLATFORM_FRAME, rotation, np.array(position), acts_on)
    load = Frames({"ft": frame}).load("ft", force, moment)
    # Velocity of the sensor's origin, in the sensor's axes.
    at_sensor = rotation.T @ (np.array(velocity) + np.cross(spin, position))
    work = np.dot(force, at_sensor) + np.dot(moment, rotation.T @ np.array(spin))
    sign = 1.0 if acts_on == "platform" else -1.0
    assert load.on_platform
    assert load.wrench @ np.array([*velocity, *spin]) == pytest.approx(sign * work, abs=1e-9)


def test_known_frames_pass_the_wrench_on():
    wrench = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    for frame, on_platform in ((BASE_FRAME, False), (PLATFORM_FRAME, True)):
        load = Frames().load(frame, wrench[:3], wrench[3:])
        assert load.wrench.tolist() == wrench
        assert load.on_platform is on_platform


@pytest.mark.parametrize("frame_id", ["", "tool0", "wrist_corrected"])
def test_an_unknown_frame_is_named_together_with_the_known_ones(frame_id):
    frames = Frames({"ft": SensorFrame(BASE_FRAME)})
    with pytest.raises(FrameError, match=f"'{frame_id}'.*wrist_base, wrist_platform, ft"):
        frames.load(frame_id, [0, 0, 0], [0, 0, 0])


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_a_wrench_that_is_not_finite_is_refused(bad):
    with pytest.raises(InputError, match="not finite"):
        Frames().load(BASE_FRAME, [0, bad, 0], [0, 0, 0])


def test_frames_are_read_in_millimetres_and_degrees():
    frames = frames_from_yaml(
        "{ft: {parent: wrist_base, position_mm: [0, 0, 40], rpy_deg: [0, 0, 90],"
        " acts_on: environment}}"
    )
    load = frames.load("ft", [2.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    # Sensor x is y of the base; the reaction pulls along -y, 40 mm above O.
    assert np.allclose(load.wrench, [0.0, -2.0, 0.0, 0.08, 0.0, 0.0])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[1]", "is not a mapping"),
        ("{ft: {}}", "ft: parent is missing"),
        ("{ft: 3}", "ft: 3 is not a mapping"),
        ("{ft: {parent: tool0}}", "ft.parent: 'tool0'"),
        ("{ft: {parent: wrist_base, yaw: 3}}", "ft: unknown key yaw"),
        ("{ft: {parent: wrist_base, acts_on: robot}}", "ft.acts_on: 'robot'"),
        ("{ft: {parent: wrist_base, position_mm: [1, 2]}}", "ft.position_mm: "),
        ("{ft: {parent: wrist_base, rpy_deg: [1, 2, .nan]}}", "ft.rpy_deg: "),
        ("{wrist_base: {parent: wrist_base}}", "wrist_base: is fixed"),
        ("{", "not a YAML file"),
        ("{ft: {parent: 2001-13-99}}", "'2001-13-99' is not one of"),
        ("[" * 5000, "nested deeper than 32"),
        (
            f"{{ft: {{parent: wrist_base, position_mm: [1, 2, {'9' * 500}]}}}}",
            "not a list of 3 finite",
        ),
        ("a: &a [*a]", "anchor &a is not read"),
        ("a: !!timestamp x", "tag tag:yaml.org,2002:timestamp is not read"),
    ],
)
def test_wrong_frames_are_refused_with_the_reason(text, reason):
    with pytest.raises(InputError, match=reason):
        frames_from_yaml(text)


def test_no_text_is_no_frame():
    assert frames_from_yaml("").sensors == {}
