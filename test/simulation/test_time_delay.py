"""A late stamp shows the very motion of the program as it was, however few samples tell of it."""

import numpy as np
import pytest

from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise
from wrist_stiffness.simulation.laws.time_delay import TimeDelay
from wrist_stiffness.simulation.program import Program, Track

QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))
ROUNDING = 1e-12
PLACES = ("pose_sensor", "load_sensor", "motor_1", "motor_2")
DELAYS = (0.005, 0.08, 0.25)
"""Within a sample at 10 Hz, nearly one and more than two [s]."""

WAVE = 2.0
"""Of the departure from the program [rad/s]."""


class Sensors:
    """What a law is shown, and what it says, of a motion with a smooth departure."""

    def __init__(self, table, size):
        # motors:  rest 0-1 s, move 1-1.5 s, move back 1.5-2.1 s, rest to 4 s
        # load:    none to 2.5 s, on within 0.6 s
        motors = np.array([[0.2, -0.1], [0.2, -0.1], [0.35, 0.1], [0.1, 0.1], [0.1, 0.1]])
        load = np.zeros((4, 6))
        load[2:] = [0.3, -0.5, 0.2, 0.01, 0.02, -0.03]
        self.program = Program(
            Track(np.array([0.0, 1.0, 1.5, 2.1, 4.0]), motors),
            Track(np.array([0.0, 2.5, 3.1, 4.0]), load),
            Track(np.array([0.0, 4.0]), np.zeros((2, 1))),
            4.0,
        )
        self.table, self.size = table, size

    def at(self, time_s):
        """Angles (n, 2), wrench (n, 6), rotation (n, 3, 3) and shift (n, 3) as they are."""
        wave = self.size * np.sin(WAVE * time_s)[:, None]
        theta = self.program.angles(time_s)
        twist = wave * [1e-4, -2e-4, 1e-4, 1e-3, 2e-3, -1e-3]
        bent, shift = exp_twist(twist)
        platform = self.table.mechanism.forward(theta).platform
        return theta + 1e-3 * wave, self.program.load(time_s) + wave, bent @ platform, shift

    def read(self, place, delay_s, time_s, sizes=(1000,)):
        """The same as a late sensor says it, heard in blocks of these sizes in turn."""
        law = TimeDelay(place, delay_s, self.table.mechanism)
        law.told(self.program)
        parts, first = [], 0
        while first < len(time_s):
            now = time_s[first : first + sizes[len(parts) % len(sizes)]]
            theta, wrench, rotation, shift = self.at(now)
            parts.append(
                (
                    law.read_shaft(now, theta),
                    law.read_load(_Stamps(now), wrench),
                    *law.read_pose(_Stamps(now), rotation, shift),
                )
            )
            first += len(now)
        return [np.concatenate(each) for each in zip(*parts, strict=True)]


class _Stamps:
    """Of a block a delay needs the times only."""

    def __init__(self, time_s):
        self.time_s = time_s


def expected(sensors, place, time_s, delay_s):
    """What is at the stamps, and from the late sensor what was at the moments."""
    now, then = sensors.at(time_s), sensors.at(np.maximum(time_s - delay_s, 0.0))
    theta, wrench, rotation, shift = now
    if place == "load_sensor":
        wrench = then[1]
    elif place == "pose_sensor":
        rotation, shift = then[2:]
    else:
        theta[:, PLACES.index(place) - 2] = then[0][:, PLACES.index(place) - 2]
    return theta, wrench, rotation, shift


def ten_hertz(fold=1):
    return np.arange(40 * fold) / (10.0 * fold)


@pytest.mark.parametrize("delay_s", DELAYS)
@pytest.mark.parametrize("place", PLACES)
def test_the_programs_motion_is_shown_as_it_was_to_rounding(place, delay_s, wrist):
    sensors, time_s = Sensors(wrist(), 0.0), ten_hertz()
    read = sensors.read(place, delay_s, time_s)
    for found, wanted in zip(read, expected(sensors, place, time_s, delay_s), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("place", PLACES)
def test_what_departs_from_the_program_converges_with_order_two(place, wrist):
    sensors, errors = Sensors(wrist(), 1.0), []
    for fold in (1, 2, 4):
        # Half a sample late: the middle between two is where the interpolation is worst.
        delay_s, time_s = 0.05 / fold, ten_hertz(fold)
        read = sensors.read(place, delay_s, time_s)
        wanted = expected(sensors, place, time_s, delay_s)
        inside = time_s > delay_s
        errors.append(max(np.max(np.abs(a - b)[inside]) for a, b in zip(read, wanted, strict=True)))
    # Second derivative of the sine times an eighth of the squared interval, where it is largest.
    largest = {"pose_sensor": 2e-3, "load_sensor": 1.0}.get(place, 1e-3)
    assert errors[0] == pytest.approx(largest * (WAVE * 0.1) ** 2 / 8.0, rel=0.3)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("delay_s", DELAYS)
@pytest.mark.parametrize("place", PLACES)
def test_a_delay_heard_in_blocks_says_what_it_says_at_once(place, delay_s, wrist):
    sensors, time_s = Sensors(wrist(), 1.0), ten_hertz()
    whole = sensors.read(place, delay_s, time_s)
    for sizes in ((1,), (3, 1, 7), (13,)):
        parts = sensors.read(place, delay_s, time_s, sizes)
        for one, other in zip(whole, parts, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("place", PLACES)
def test_a_rest_is_a_rest_as_soon_as_the_delay_is_over(place, wrist):
    """No ringing after a motion, and none before it."""
    sensors, time_s, delay_s = Sensors(wrist(), 0.0), ten_hertz(), 0.005
    read = sensors.read(place, delay_s, time_s)
    at = {"load_sensor": 1, "pose_sensor": 2, "motor_1": 0, "motor_2": 0}[place]
    still = {"load_sensor": [(0.0, 2.55), (3.15, 4.0)]}.get(place, [(0.0, 1.05), (2.15, 4.0)])
    for first, last in still:
        shown = read[at][(time_s >= first) & (time_s <= last)]
        assert len(shown) > 7
        np.testing.assert_allclose(shown, np.broadcast_to(shown[0], shown.shape), atol=ROUNDING)


@pytest.mark.parametrize("place", PLACES)
def test_a_late_cell_at_10_hz_says_what_a_fast_one_said_before(place, wrist):
    delay_s, seconds, rate = 0.02, 12.0, 100
    late = cell_says(wrist(), 10.0, seconds, HiddenEffect("time_delay", place, "plain", delay_s, 1))
    now = cell_says(wrist(), 10.0, seconds)
    fast = cell_says(wrist(), float(rate), seconds)
    moments = np.maximum(rate // 10 * np.arange(len(late.encoder)) - round(delay_s * rate), 0)
    then = CellSample(*(values[moments] for values in vars(fast).values()))
    if place == "load_sensor":
        np.testing.assert_allclose(late.wrench, then.wrench, atol=ROUNDING)
        assert np.max(np.abs(then.wrench - now.wrench)) > 0.01
        return
    count = wrist().geometry.limits.encoder_step
    if place == "pose_sensor":
        (error, effect) = (
            log_motion(
                each.measured_rotation @ np.swapaxes(then.measured_rotation, -1, -2),
                np.zeros_like(then.pose_shift),
            )[:, 3:]
            for each in (late, now)
        )
    else:
        column = PLACES.index(place) - 2
        error, effect = ((each.encoder - then.encoder)[:, column] for each in (late, now))
        wrong, change = ((each.speed - then.speed)[:, column] for each in (late, now))
        assert np.max(np.abs(wrong)) < 1e-3 * np.max(np.abs(change))
        counts = late.encoder / count
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    # Where a shaft stops within its count is settled while samples come: fewer tell it later.
    assert np.max(np.abs(error)) < 1.01 * count
    assert np.max(np.abs(effect)) > 30.0 * count


def cell_says(table, rate_hz, seconds, *hidden):
    settings = CellSettings(
        rate_hz=rate_hz, hidden=hidden, instrument="ideal", load_sensor=QUIET, program_seed=101
    )
    cell = VirtualCell(table, settings, np.random.default_rng(0))
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    return cell.run(time_s, cell.desired(time_s))
