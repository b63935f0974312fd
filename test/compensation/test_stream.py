from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import NO_LOAD, State, SupervisorSettings
from wrist_stiffness.compensation.correction import correct, residual_twist
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.load_history import Zero
from wrist_stiffness.compensation.monitor import MonitorSettings, MonitorStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import (
    InputError,
    LoadRangeError,
    SingularPoseError,
    StaleLoadError,
    UnreachablePoseError,
)
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.registry import find_law

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
STEP = SECOND // 100
THETA = np.array([0.2, -0.1])
DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
ROUNDING = 1e-15  # rad

# Loads of these tests are weights; contact has tests of its own.
EVERY_LOAD = StreamSettings(supervisor=SupervisorSettings(follow=True))


class Driver:
    """Sends a stream one command after another, with loads just before."""

    def __init__(self, stream, stamp_ns=10 * SECOND):
        self.stream = stream
        self.stamp_ns = stamp_ns

    def send(self, theta=THETA, load=DOWN, seconds=0.01, frame_id=""):
        self.stamp_ns += round(seconds * SECOND)
        if load is not None:
            self.stream.loads.add(self.stamp_ns, "wrist_base", load[:3], load[3:])
        return self.stream.on_command(self.stamp_ns, frame_id, NAMES, theta)

    def settle(self, **options):
        for _ in range(50):
            command = self.send(**options)
        return command


BIAS = {"fx_N": 0.2, "fy_N": -0.15, "fz_N": 0.2, "mx_Nmm": -4.0, "my_Nmm": 1.0, "mz_Nmm": 2.0}
"""Of a load sensor, as a calibration finds it."""
READS = np.array([*list(BIAS.values())[:3], *(1e-3 * each for each in list(BIAS.values())[3:])])
MONITORING = MonitorSettings(np.full(6, 1e-6), joint_age_limit_s=1.0)


@pytest.mark.parametrize(
    "made",
    [PredictionStream, lambda *given: MonitorStream(*given, MONITORING)],
    ids=["prediction", "monitor"],
)
def test_what_a_tare_takes_away_is_not_taken_away_twice(model, made):
    """An empty platform, a sensor that reads its bias, a model that knows it: before and after."""
    biased = model.with_effects(effect_at(find_law("load_bias"), "load_sensor", BIAS))
    stream = made(biased, EVERY_LOAD)

    def predicted():
        stream.loads.add(SECOND, "wrist_base", READS[:3], READS[3:])
        return stream.running_model().advance(SECOND, THETA, stream.loads.at(SECOND)[1]).twist

    empty = model.predict(THETA, Load(np.zeros(6))).twist
    assert predicted() == pytest.approx(empty, abs=ROUNDING)
    stream.use_zero(Zero(Load(READS), np.zeros(6)))
    assert predicted() == pytest.approx(empty, abs=ROUNDING)
    stream.use_zero(None)
    assert predicted() == pytest.approx(empty, abs=ROUNDING)


def test_a_tared_corrector_knows_an_empty_platform(model):
    biased = model.with_effects(effect_at(find_law("load_bias"), "load_sensor", BIAS))
    driver, sound = corrector(biased), corrector(model)
    driver.stream.use_zero(Zero(Load(READS), np.zeros(6)))
    command = driver.settle(load=READS)
    assert command.theta == pytest.approx(sound.settle(load=np.zeros(6)).theta, abs=ROUNDING)


def corrected(model, theta, load, objective):
    return correct(
        lambda angles: model.predict(angles, load), model.table.workspace, theta, objective
    )


def corrector(model, enabled=True, settings=EVERY_LOAD):
    return Driver(CorrectionStream(model, settings, enabled))


def target(model, objective, theta=THETA, load=DOWN):
    return corrected(model, np.asarray(theta), Load(load), objective("pointing")).delta


@pytest.fixture(scope="module")
def model(make_table):
    """Return a model so soft that its corrections are several encoder steps."""
    return ErrorModel("soft", make_table(softness=60.0), "closed_form")


@pytest.fixture
def band(model):
    """Half width of the hysteresis [rad]."""
    step = model.table.geometry.limits.encoder_step
    return EVERY_LOAD.safety.deadband_steps * step


def test_prediction_is_the_models_with_the_load_of_the_stamp(model):
    stream = PredictionStream(model, StreamSettings())
    for stamp, force in ((SECOND, -1.0), (SECOND + 10, -2.0)):
        stream.loads.add(stamp, "wrist_base", (0, 0, force), (0, 0, 0))
    prediction = stream.on_joint_state(SECOND + 9, NAMES, THETA)
    assert np.array_equal(prediction.twist, model.predict(THETA, Load(DOWN)).twist)


def test_samples_without_effects_leave_no_trace_not_even_in_the_last_bit(model):
    """Whatever was predicted before, the flanges in contact are found anew."""
    rng = np.random.default_rng(9)
    stream = PredictionStream(model, StreamSettings())
    for i in range(200):
        load = rng.normal(size=6) * np.repeat([0.8, 0.02], 3)
        theta, stamp = rng.uniform(-0.6, 0.6, 2), SECOND + i
        stream.loads.add(stamp, "wrist_base", load[:3], load[3:])
        found = stream.on_joint_state(stamp, NAMES, theta)
        assert np.array_equal(found.twist, model.predict(theta, Load(load)).twist)


def test_without_a_model_nothing_is_predicted_and_commands_pass():
    stream = PredictionStream(None, StreamSettings())
    stream.loads.add(SECOND, "wrist_base", (0, 0, 0), (0, 0, 0))
    with pytest.raises(InputError, match="no model is loaded"):
        stream.on_joint_state(SECOND, NAMES, THETA)
    command = corrector(None).send()
    assert "no model is loaded" in str(command.fault)
    assert command.theta.tolist() == THETA.tolist()


def test_the_correction_ramps_from_zero_to_its_target(model, objective, band):
    driver = corrector(model)
    wanted = target(model, objective)
    slew = EVERY_LOAD.safety.slew
    before = np.zeros(2)
    assert driver.send().correction.delta.tolist() == [0.0, 0.0]
    for _ in range(40):
        delta = driver.send().correction.delta
        assert np.all(np.abs(delta - before) <= slew * 0.01 + ROUNDING)
        before = delta
    assert np.all(np.abs(before - wanted) <= band + ROUNDING)
    assert np.any(np.abs(wanted) > 3 * slew * 0.01)


def test_disabled_commands_pass_unchanged_to_the_bit(model):
    driver = corrector(model, enabled=False)
    for theta in np.random.default_rng(1).uniform(-0.5, 0.5, (20, 2)):
        command = driver.send(theta, frame_id="plan")
        assert command.theta.tolist() == theta.tolist()
        assert command.frame_id == "plan"
        assert command.correction is None


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"load": None, "seconds": 0.6}, StaleLoadError),
        ({"theta": np.array([1.35, 0.0])}, UnreachablePoseError),
        ({"load": 20.0 * DOWN}, None),
    ],
    ids=["stale load", "out of the domain", "load beyond range"],
)
def test_after_a_fault_the_correction_fades_and_then_commands_pass_unchanged(model, options, fault):
    driver = corrector(model)
    driver.settle()
    slew = EVERY_LOAD.safety.slew
    theta = options.get("theta", THETA)
    before = driver.send().correction.delta
    first = driver.send(**options)
    assert first.fault is not None
    assert fault is None or isinstance(first.fault, fault)
    options = {**options, "seconds": 0.01}
    for _ in range(60):
        command = driver.send(**options)
        delta = command.theta - theta
        assert np.all(np.abs(delta) <= np.abs(before) + ROUNDING)
        assert np.all(np.abs(delta - before) <= slew * 0.11 + ROUNDING)
        before = delta
    assert command.theta.tolist() == theta.tolist()
    assert command.frame_id == "wrist_corrected"


def test_load_beyond_the_table_is_a_fault_even_where_contact_is_frozen(model):
    """The payload stands in for the load of a contact, but not for one that nobody can believe."""
    driver = corrector(model, settings=StreamSettings())
    driver.settle()
    first = driver.send(load=20.0 * DOWN)
    assert isinstance(first.fault, LoadRangeError)
    for _ in range(60):
        command = driver.send(load=20.0 * DOWN, seconds=0.01)
    assert command.theta.tolist() == THETA.tolist()


def test_a_command_without_a_stamp_is_not_corrected(model):
    stream = CorrectionStream(model, EVERY_LOAD, enabled=True)
    stream.loads.add(0, "wrist_base", DOWN[:3], DOWN[3:])
    command = stream.on_command(0, "", ("motor_1_joint", "motor_2_joint"), THETA)
    assert isinstance(command.fault, StaleLoadError)
    assert "no stamp" in str(command.fault)
    assert command.theta.tolist() == THETA.tolist()


@pytest.mark.parametrize("enabled", [True, False])
def test_without_stamps_the_correction_fades_by_the_time_of_arrival(model, enabled):
    driver = corrector(model)
    added = [driver.settle().theta - THETA]
    driver.stream.enabled = enabled
    for i in range(1, 51):
        came_ns = driver.stamp_ns + i * STEP
        added.append(driver.stream.on_command(0, "", NAMES, THETA, (), came_ns).theta - THETA)
    slew = EVERY_LOAD.safety.slew * STEP / SECOND
    assert np.abs(np.diff(added, axis=0)).max() == pytest.approx(slew)
    assert added[-1].tolist() == [0.0, 0.0]
    driver.stamp_ns = came_ns
    again = driver.send().theta - THETA
    assert np.abs(again).max() <= slew + ROUNDING


def test_a_load_in_another_frame_than_the_tare_is_no_known_load(model):
    driver = corrector(model)
    driver.stream.use_zero(Zero(Load(np.zeros(6)), np.zeros(6)))
    driver.settle()
    driver.stream.loads.add(driver.stamp_ns + STEP, "wrist_platform", DOWN[:3], DOWN[3:])
    assert "another frame" in str(driver.send(load=None).fault)
    told = driver.stream.supervision
    assert (told.state, told.valid, told.text) == (State.UNSURE, False, NO_LOAD)


def test_switching_off_fades_too(model):
    driver = corrector(model)
    delta = driver.settle().correction.delta
    driver.stream.enabled = False
    fading = driver.send()
    assert np.any(fading.theta != THETA)
    assert np.all(np.abs(fading.theta - THETA) <= np.abs(delta) + ROUNDING)
    assert fading.frame_id == "wrist_corrected"
    command = driver.settle()
    assert command.theta.tolist() == THETA.tolist()
    assert command.frame_id == ""


def test_noise_within_the_hysteresis_does_not_move_a_held_correction(model):
    driver = corrector(model)
    driver.settle()
    rng = np.random.default_rng(2)

    def sent(force):
        noise = np.repeat([force, 0.02 * force], 3)
        commands = [driver.send(load=DOWN + noise * rng.normal(size=6)) for _ in range(200)]
        return {tuple(command.theta) for command in commands}

    # The first noise still pushes the hysteresis until its peaks fit inside.
    sent(1e-3)
    assert len(sent(5e-4)) == 1
    assert len(sent(5e-2)) > 100


def test_residual_is_that_of_what_is_applied(model, objective):
    driver = corrector(model)
    driver.send()
    desired = model.table.mechanism.forward(THETA).platform
    before = model.predict(THETA, Load(DOWN)).twist
    for seconds in (0.01, 0.01, 0.1):
        correction = driver.send(seconds=seconds).correction
        wanted = residual_twist(model.predict(THETA + correction.delta, Load(DOWN)), desired)
        # The residual is moved by the rigid Jacobian alone; this wrist is very soft.
        scale = 3e-3 * np.abs(before)
        assert np.allclose(correction.after[:3], wanted[:3], rtol=0, atol=scale[:3].max())
        assert np.allclose(correction.after[3:], wanted[3:], rtol=0, atol=scale[3:].max())


def test_a_marked_command_passes_unchanged_with_an_error(model):
    driver = corrector(model)
    driver.settle()
    command = driver.send(frame_id="wrist_corrected")
    assert command.theta.tolist() == THETA.tolist()
    assert "not corrected twice" in str(command.fault)
    # The own correction begins at zero again.
    ramp = EVERY_LOAD.safety.slew * 0.02
    assert np.all(np.abs(driver.send().theta - THETA) <= ramp + ROUNDING)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize("enabled", [True, False])
def test_a_command_that_is_not_finite_is_never_forwarded(model, bad, enabled):
    driver = corrector(model, enabled)
    with pytest.raises(InputError, match="not finite"):
        driver.send([bad, 0.0])
    with pytest.raises(InputError, match="not finite"):
        driver.stream.on_command(SECOND, "", (*NAMES, "gripper"), [0.0, 0.0, bad])


def test_the_correction_does_not_drive_past_a_joint_limit(model, objective):
    wanted = target(model, objective)
    lower, upper = (np.degrees(THETA + sign * 0.25 * np.abs(wanted)) for sign in (-1, 1))
    table = model.table
    header = replace(table.header, geometry=dict(table.header.geometry))
    header.geometry["limits"] = {
        **header.geometry["limits"],
        "joint_lower_deg": lower.tolist(),
        "joint_upper_deg": upper.tolist(),
    }
    # The domain follows from the tilt, not from the joint limits.
    narrow = ErrorModel("narrow", replace(table, header=header), "closed_form")
    command = corrector(narrow).settle()
    assert np.all(np.degrees(command.theta) >= lower - 1e-9)
    assert np.all(np.degrees(command.theta) <= upper + 1e-9)
    assert np.allclose(np.abs(command.theta - THETA), 0.25 * np.abs(wanted), rtol=1e-6)
    within_a_step = 0.25 * abs(wanted[0]) + 0.5 * table.geometry.limits.encoder_step
    outside = THETA + np.array([1.0, 0.0]) * np.sign(wanted[0]) * within_a_step
    moved = corrector(narrow).settle(theta=outside).theta
    assert np.abs(moved[0]) <= np.abs(outside[0]) + ROUNDING


def test_towards_the_border_of_the_domain_the_correction_fades(model, objective):
    """No correction differs from that of its neighbour by more than a smooth fade explains."""
    free = StreamSettings(
        supervisor=EVERY_LOAD.supervisor,
        safety=replace(EVERY_LOAD.safety, slew=1e3, deadband_steps=0.0),
    )
    driver = corrector(model, settings=free)
    lower, upper = model.table.workspace.rectangle
    path = np.linspace(upper[0] - np.radians(4.0), upper[0] + np.radians(0.5), 200)
    driver.send(np.array([path[0], 0.0]))
    deltas = []
    for first in path:
        command = driver.send(np.array([first, 0.0]), seconds=0.1)
        deltas.append(command.theta - [first, 0.0])
    deltas = np.array(deltas)
    assert np.max(np.abs(deltas[0])) > 1e-6
    assert deltas[path > upper[0]].tolist() == np.zeros((np.sum(path > upper[0]), 2)).tolist()
    # A smooth step over 2 deg changes by at most 1.5 of its height per width.
    steps = np.abs(np.diff(deltas, axis=0)).max()
    spacing = np.degrees(path[1] - path[0])
    assert steps < 3.0 * np.abs(deltas).max() * spacing / 2.0


def test_towards_a_singular_pose_the_correction_fades_and_beyond_it_there_is_none(model):
    """The same wrist, whose geometry calls poses singular long before the border of the domain."""
    table = model.table
    header = replace(table.header, geometry=dict(table.header.geometry))
    header.geometry["limits"] = {**header.geometry["limits"], "singularity": 0.6}
    near = ErrorModel("near", replace(table, header=header), "closed_form")
    free = StreamSettings(
        supervisor=EVERY_LOAD.supervisor,
        safety=replace(EVERY_LOAD.safety, slew=1e3, deadband_steps=0.0),
    )
    driver = corrector(near, settings=free)
    driver.send(np.zeros(2))
    deltas, faults = [], []
    for share in np.linspace(0.0, 1.0, 100):
        theta = share * np.array([1.1, -1.1])
        command = driver.send(theta, seconds=0.1)
        deltas.append(command.theta - theta)
        faults.append(command.fault)
    refused = [isinstance(fault, SingularPoseError) for fault in faults]
    assert any(refused)
    assert not refused[0]
    deltas = np.abs(deltas).max(axis=1)
    assert np.all(deltas[refused] == 0.0)
    # It comes to the limit without a step: the last corrections are small, and no change is large.
    assert deltas[np.argmax(refused) - 1] < 0.1 * deltas.max()
    assert np.abs(np.diff(deltas)).max() < 0.2 * deltas.max()


def test_a_clock_that_jumps_back_does_not_move_the_correction(model):
    driver = corrector(model)
    delta = driver.settle().correction.delta
    driver.stamp_ns = 2 * SECOND
    assert np.allclose(driver.send().theta - THETA, delta, rtol=0, atol=ROUNDING)
    assert np.allclose(driver.settle().theta - THETA, delta, rtol=0, atol=1e-9)


def test_a_clock_that_jumps_back_does_not_move_a_correction_on_its_way(model):
    driver = corrector(model)
    driver.send()
    delta = driver.send().theta - THETA
    driver.stamp_ns = 2 * SECOND
    assert np.allclose(driver.send().theta - THETA, delta, rtol=0, atol=ROUNDING)
    assert np.max(np.abs(driver.send().theta - THETA - delta)) > 1e-6


def test_a_trajectory_is_corrected_whole_or_not_at_all(model, objective):
    driver = corrector(model)
    driver.send()
    points = [[0.0, 0.0], [0.2, -0.3]]

    def answer(points, frame_id=""):
        planned = [planned_point(2, point) for point in points]
        return driver.stream.on_trajectory(driver.stamp_ns, frame_id, NAMES, planned)

    def positions(trajectory):
        return [point.positions.tolist() for point in trajectory.points]

    good = answer(points)
    wanted = [point + target(model, objective, point) for point in points]
    assert np.allclose(positions(good), wanted, rtol=0, atol=ROUNDING)
    assert good.fault is None
    bad = answer([*points, [1.35, 0.0]])
    assert positions(bad) == [*points, [1.35, 0.0]]
    assert isinstance(bad.fault, UnreachablePoseError)
    twice = answer(points, "wrist_corrected")
    assert positions(twice) == points
    assert "not corrected twice" in str(twice.fault)
    with pytest.raises(InputError, match="trajectory: motor_2_joint is missing"):
        driver.stream.on_trajectory(driver.stamp_ns, "", NAMES[:1], [])


def test_the_same_samples_give_the_same_commands_to_the_bit(model):
    def run():
        driver = corrector(model)
        rng = np.random.default_rng(4)
        return [
            driver.send(rng.uniform(-0.4, 0.4, 2), DOWN * rng.uniform(), 0.01).theta.tolist()
            for _ in range(50)
        ]

    assert run() == run()
