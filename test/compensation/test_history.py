"""Models with a memory in the streams, and the slow signals that effects need."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.belief import State, SupervisorSettings
from wrist_stiffness.compensation.correction import residual_twist
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.held_signals import HeldSignals
from wrist_stiffness.compensation.monitor import MonitorSettings, MonitorStream
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block, Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law

SECOND = 1_000_000_000
NAMES = ("motor_1_joint", "motor_2_joint")
DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
BACKLASH_MDEG = 40.0
AGE_LIMIT_S = 1.0


@pytest.fixture(scope="module")
def loose(model):
    width = {"width_mdeg": Estimate(BACKLASH_MDEG)}
    return model.with_effects(Effect(find_law("backlash"), "motor_1", width))


@pytest.fixture(scope="module")
def warm(model):
    return model.with_effects(Effect(find_law("thermal_expansion"), "link_1", {}))


def predict_all(stream, stamps, thetas):
    twists = []
    for stamp, theta in zip(stamps, thetas, strict=True):
        stream.loads.add(stamp, "wrist_base", DOWN[:3], DOWN[3:])
        twists.append(stream.on_joint_state(stamp, NAMES, theta).twist)
    return np.array(twists)


def there_and_back(n=20):
    first = np.radians(np.concatenate([np.linspace(0.0, 1.0, n), np.linspace(1.0, 0.0, n)]))
    return np.stack([first, np.zeros(2 * n)], axis=1)


def test_a_stream_remembers_as_a_whole_recording_does(loose):
    thetas = there_and_back()
    stamps = [SECOND + i * SECOND // 100 for i in range(len(thetas))]
    live = predict_all(PredictionStream(loose, StreamSettings()), stamps, thetas)
    block = Block(np.array(stamps) / SECOND, thetas, np.tile(DOWN, (len(thetas), 1)))
    assert np.allclose(live, loose.batch(block).twist, rtol=1e-9, atol=1e-15)
    # On the way back the backlash is on the other side.
    assert np.max(np.abs(live[10, 3:] - live[-11, 3:])) > 0.5 * np.radians(1e-3 * BACKLASH_MDEG)


def test_a_sample_before_the_last_one_is_refused_and_a_jump_begins_anew(loose):
    stream = PredictionStream(loose, StreamSettings())
    thetas = there_and_back(3)
    fresh = predict_all(stream, [100 * SECOND + i for i in range(6)], thetas)
    with pytest.raises(InputError, match="before the last one"):
        stream.on_joint_state(100 * SECOND + 3, NAMES, thetas[0])
    again = predict_all(stream, [SECOND + i for i in range(6)], thetas)
    assert np.array_equal(fresh, again)


def test_a_replaced_model_remembers_nothing(loose):
    stream = PredictionStream(loose, StreamSettings())
    thetas = there_and_back(3)
    fresh = predict_all(stream, [SECOND + i for i in range(6)], thetas)
    stream.model = loose
    assert np.array_equal(fresh, predict_all(stream, [SECOND + i for i in range(6)], thetas))


def test_temperatures_reach_the_model_by_their_stamps(warm, model):
    stream = PredictionStream(warm, StreamSettings())
    cold = predict_all(stream, [SECOND], [[0.1, 0.2]])
    stream.temperatures.add("link_1", SECOND + 10, 60.0)
    earlier = predict_all(stream, [SECOND + 5], [[0.1, 0.2]])
    hot = predict_all(stream, [SECOND + 10], [[0.1, 0.2]])
    assert np.array_equal(cold, earlier)
    sample = Sample(1.0, np.array([0.1, 0.2]), Load(DOWN), temperatures={"link_1": 60.0})
    assert np.array_equal(hot[0], warm.session().advance(sample).twist)
    assert not np.allclose(hot, cold, rtol=1e-3)


def test_commands_are_corrected_from_the_commanded_history(loose):
    """What is sent takes up the backlash on the side on which the motor comes to rest."""
    settings = StreamSettings(
        supervisor=SupervisorSettings(follow=True),
        safety=SafetySettings(slew=1e3, deadband_steps=0.0),
    )
    stream = CorrectionStream(loose, settings, enabled=True)
    truth = loose.session()
    normal = loose.table.geometry.platform.normal
    missed, added = [], []
    # At the end half of the gap back: only the true history knows where in the gap the motor is.
    path = [*there_and_back(10), np.array([np.radians(0.5e-3 * BACKLASH_MDEG), 0.0])]
    for i, theta in enumerate(path):
        stamp = SECOND + i * SECOND // 10
        stream.loads.add(stamp, "wrist_base", DOWN[:3], DOWN[3:])
        command = stream.on_command(stamp, "", NAMES, theta)
        prediction = truth.advance(Sample(stamp / SECOND, command.theta, Load(DOWN)))
        desired = loose.table.mechanism.forward(theta).platform
        twist = residual_twist(prediction, desired)
        missed.append(np.linalg.norm(np.cross(twist[3:], desired @ normal)))
        added.append(command.theta[0] - theta[0])
    half = 0.5 * np.radians(1e-3 * BACKLASH_MDEG)
    # The first command cannot be corrected yet, and at the reversal the slide across takes a step.
    assert max(missed[1:10]) < 1e-9
    assert max(missed[12:]) < 1e-9
    assert added[5] - added[15] == pytest.approx(2.0 * half, rel=0.05)


AT_ONCE = StreamSettings(
    supervisor=SupervisorSettings(follow=True),
    safety=SafetySettings(slew=1e3, deadband_steps=0.0),
)
NOT_CORRECTED = {
    "disabled": (False, AT_ONCE, ""),
    "beyond the limit": (True, replace(AT_ONCE, correction_limit=1e-9), ""),
    "corrected by another": (True, AT_ONCE, "wrist_corrected"),
}


@pytest.mark.parametrize(
    ("enabled", "settings", "frame"), NOT_CORRECTED.values(), ids=NOT_CORRECTED
)
def test_commands_that_were_not_corrected_are_remembered_too(loose, enabled, settings, frame):
    """The motor came from above, which only the memory knows when the correction begins."""
    stream = CorrectionStream(loose, settings, enabled)
    truth = loose.session()

    def send(i, degrees, marked=""):
        theta, stamp = np.radians([degrees, 0.0]), SECOND + i * SECOND // 10
        stream.loads.add(stamp, "wrist_base", DOWN[:3], DOWN[3:])
        command = stream.on_command(stamp, marked, NAMES, theta)
        return theta, command, truth.advance(Sample(stamp / SECOND, command.theta, Load(DOWN)))

    for i in range(5):
        theta, command, _ = send(i, 1.0 - 0.1 * i, frame)
        assert np.array_equal(command.theta, theta)
    stream.enabled, stream.settings = True, AT_ONCE
    theta, command, prediction = send(5, 0.5)
    desired = loose.table.mechanism.forward(theta).platform
    left = residual_twist(prediction, desired)[3:]
    # The residual is moved by the rigid Jacobian: off by 1e-3 of the correction.
    half = 0.5 * np.radians(1e-3 * BACKLASH_MDEG)
    assert np.linalg.norm(command.correction.after[3:] - left) < 0.01 * half
    assert np.linalg.norm(command.correction.prediction.twist[3:]) > 0.5 * half


@pytest.fixture(scope="module")
def speedy(model):
    """A shift of 1 mm along x for every rad/s of motor 1, on top of the elastic error."""
    law = FormulaLaw("speedy", "frame", np.eye(6)[0], "1e-3 * theta_dot_1", [], [])
    return model.with_effects(Effect(law, "frame", {}))


NAN = float("nan")
# 0.01 rad in 0.1 s before the sample.
SPEEDS = {
    "given": (NAMES, (0.3, 0.0), 0.3),
    "other order": (NAMES[::-1], (0.0, 0.3), 0.3),
    "absent": (NAMES, (), 0.1),
    "not finite": (NAMES, (NAN, 0.0), 0.1),
    "too few": (NAMES, (0.3,), 0.1),
}


@pytest.mark.parametrize(("names", "speeds", "wanted"), SPEEDS.values(), ids=SPEEDS)
def test_speeds_are_used_where_given_and_else_differences(model, speedy, names, speeds, wanted):
    predicting = PredictionStream(speedy, StreamSettings())
    correcting = CorrectionStream(speedy, replace(AT_ONCE, objective="tool_point"), enabled=False)
    monitoring = MonitorStream(
        speedy, StreamSettings(), MonitorSettings(np.ones(6), joint_age_limit_s=1.0)
    )
    plain = model.predict(np.array([0.01, 0.0]), Load(DOWN))
    rotation, shift = plain.motion
    quaternion = Rotation.from_matrix(rotation @ plain.configuration.platform).as_quat()
    for stamp, first in ((SECOND, 0.0), (SECOND + SECOND // 10, 0.01)):
        angles = [first, 0.0] if names == NAMES else [0.0, first]
        for stream in (predicting, correcting, monitoring):
            stream.loads.add(stamp, "wrist_base", DOWN[:3], DOWN[3:])
        predicted = predicting.on_joint_state(stamp, names, angles, speeds)
        monitoring.on_joint_state(stamp, names, angles, speeds)
        residual = monitoring.on_pose(stamp, "wrist_base", shift, quaternion).residual
        correcting.enabled = stamp > SECOND
        command = correcting.on_command(stamp, "", names, angles, speeds)
    for found in (predicted.twist - plain.twist, -residual):
        assert found[0] == pytest.approx(1e-3 * wanted, rel=1e-3)
    # The corrector moves motor 1 further, which a difference of the angles knows.
    driven = wanted if wanted == 0.3 else command.theta[0] / 0.1
    elastic = model.predict(command.theta, Load(DOWN)).twist
    found = command.correction.prediction.twist - elastic
    assert found[0] == pytest.approx(1e-3 * driven, rel=1e-3)


def test_a_frozen_contact_comes_back_neither_by_the_residual_nor_by_the_memory(model):
    """Creep would follow the contact force; what is corrected for is the payload alone."""
    parameters = {"delayed_percent": Estimate(80.0), "time_constant_s": Estimate(1.0)}
    creeping = model.with_effects(Effect(find_law("creep"), "joint_3", parameters))
    quick = replace(AT_ONCE.safety, deadband_steps=0.0)
    commands = []
    for push in (0.0, 3.0):
        stream = CorrectionStream(creeping, StreamSettings(safety=quick), enabled=True)
        for i in range(40):
            stamp = SECOND + i * SECOND // 10
            force = DOWN[:3] + [push if i >= 20 else 0.0, 0.0, 0.0]
            stream.loads.add(stamp, "wrist_base", force, DOWN[3:])
            # A motion, by which the contact may have come.
            command = stream.on_command(stamp, "", NAMES, [0.1 + 1e-3 * (i >= 20), 0.2])
        assert stream.supervision.payload is not None
        assert (stream.supervision.state is State.IN_CONTACT) is (push > 0.0)
        commands.append(command)
    free, pushed = commands
    # In contact the payload is learned no further.
    assert np.allclose(free.theta, pushed.theta, rtol=0.0, atol=1e-9)
    assert np.allclose(free.correction.after, pushed.correction.after, rtol=0.0, atol=1e-9)


def test_a_temperature_that_is_too_old_is_dropped_with_a_word(warm, model):
    stream = PredictionStream(warm, StreamSettings(signal_age_limit_s=2.0))
    stream.temperatures.add("link_1", SECOND, 60.0)
    hot = predict_all(stream, [3 * SECOND], [[0.1, 0.2]])
    assert stream.dropped_signals == ()
    cold = predict_all(stream, [3 * SECOND + 1], [[0.1, 0.2]])
    assert stream.dropped_signals == ("link_1: older than 2 s, not used",)
    plain = model.predict(np.array([0.1, 0.2]), Load(DOWN)).twist
    assert np.allclose(cold[0], plain, rtol=1e-9)
    assert not np.allclose(hot[0], plain, rtol=1e-3)
    stream.settings = StreamSettings(signal_age_limit_s=60.0)
    assert np.array_equal(predict_all(stream, [4 * SECOND], [[0.1, 0.2]]), hot)


@given(
    st.lists(st.tuples(st.integers(0, 50), st.floats(-1e3, 1e3)), max_size=20), st.integers(0, 60)
)
def test_the_newest_value_that_is_not_younger_is_held(arriving, asked):
    signals, kept = HeldSignals(AGE_LIMIT_S), {}
    for stamp, value in arriving:
        signals.add("ambient", stamp, value)
        kept = {other: v for other, v in kept.items() if other < stamp} | {stamp: value}
    older = [stamp for stamp in kept if stamp <= asked]
    assert signals.at(asked) == ({"ambient": kept[max(older)]} if older else {})


def test_a_signal_that_is_not_finite_is_refused():
    with pytest.raises(InputError, match="ambient: nan"):
        HeldSignals(AGE_LIMIT_S).add("ambient", 0, float("nan"))


class FewSignals(HeldSignals):
    CAPACITY = 4


STAMPS = st.lists(st.integers(1, 30), max_size=6)
STAMPS |= STAMPS.map(set).map(sorted)


@given(before=STAMPS, ahead=STAMPS, first=st.integers(1, 30))
def test_values_heard_ahead_leave_samples_theirs_where_they_are_said_to(before, ahead, first):
    ours, live = FewSignals(1e9), FewSignals(1e9)
    for signals in (ours, live):
        for stamp in before:
            signals.add("ambient", stamp, float(stamp))
    if not ours.rises_with("ambient", ahead, first):
        return
    for stamp in ahead:
        ours.add("ambient", stamp, float(stamp))
    for sample in range(first, 32):
        for stamp in [stamp for stamp in ahead if stamp <= sample]:
            # As a node hears them: not before the sample that they belong to.
            live.add("ambient", stamp, float(stamp))
        ahead = [stamp for stamp in ahead if stamp > sample]
        assert ours.at(sample) == live.at(sample)
