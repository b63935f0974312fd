"""The size that was asked for is the size in the data, by a formula of its own."""

import re
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.base import base_laws
from wrist_stiffness.simulation.catalogue import ALL, CATALOGUE, HiddenEffect, is_plausible
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument
from wrist_stiffness.simulation.size import Scale, base_pose, departure, draw, magnitude_for

SECONDS, RATE = 20.0, 20.0
SETTINGS = CellSettings(rate_hz=RATE, program_seconds=SECONDS)
ASKED = 0.02
FIRST = [
    HiddenEffect(effect, entry.components[0], entry.forms[0], entry.plausible, 5)
    for effect, entry in ALL.items()
]
SAMPLES = [
    HiddenEffect(effect, component, form, CATALOGUE[effect].plausible, 5)
    for effect, component, form in (
        ("joint_clearance", "joint_3", "exponential"),
        ("time_delay", "motor_2", "plain"),
        ("cable_wrench", "platform", "rubbing"),
        ("drift", "pose_sensor", "daily"),
        ("load_cross_talk", "load_sensor", "plain"),
    )
]
WANTED = 3.0


def measured_size(table, hidden, settings):
    """Noisy runs with the same seed: their noise cancels in the difference."""
    time_s = np.arange(round(SECONDS * RATE)) / RATE
    runs = []
    for effects in ((), (hidden,)):
        cell = VirtualCell(table, replace(settings, hidden=effects), np.random.default_rng(9))
        runs.append(cell.run(time_s, cell.desired(time_s)))
    without, true = runs
    xi = residual(table, true) - residual(table, without)
    load = cell.program.load(time_s)
    moved = np.diff(without.encoder, axis=0, prepend=without.encoder[:1])
    counted = np.any(load != 0.0, axis=1) | np.any(moved != 0.0, axis=1)
    jacobian = table.mechanism.jacobian(table.mechanism.forward(without.encoder))
    step = table.geometry.limits.encoder_step
    total, xi = 0.0, xi - xi[counted].mean(axis=0)
    for i in np.flatnonzero(counted):
        covariance = np.diag(instrument(settings.instrument).sigma ** 2)
        covariance[3:, 3:] += jacobian[i] @ jacobian[i].T * step**2 / 12.0
        total += xi[i] @ np.linalg.solve(covariance, xi[i]) / 6.0
    return np.sqrt(total / np.count_nonzero(counted))


def residual(table, sample):
    """Return what the base leaves of measured poses, (n, 6) [m, rad]."""
    base = base_pose(table, sample.encoder, sample.wrench)
    return departure(sample.measured_rotation, sample.measured_shift, base)


@pytest.fixture(scope="module")
def scale(wrist):
    return Scale(wrist(), SETTINGS, SECONDS)


def largest_told(scale, start):
    """Return the largest size that the refusal names, None where the wanted one can be had."""
    try:
        scale.sized(start, WANTED)
    except InputError as error:
        return float(re.search(r"simulated, .*, it is (\S+)", str(error)).group(1))
    return None


@pytest.mark.slow
@pytest.mark.parametrize("start", FIRST + SAMPLES, ids=lambda h: f"{h.effect}-{h.component}")
def test_asked_size_is_in_the_data(start, scale, wrist):
    """What cannot be as large as wanted says how large it can be, and that is in the data."""
    table, largest = wrist(), largest_told(scale, start)
    size = WANTED
    if largest is not None:
        assert largest < WANTED
        if start.effect == "measurement_frame":
            return  # its size is without a constant: nothing but what noise does to 10 mm is left
        whole = replace(start, magnitude=ALL[start.effect].limit)
        assert measured_size(table, whole, SETTINGS) == pytest.approx(largest, rel=ASKED)
        size = 0.5 * largest
    hidden = scale.sized(start, size)
    assert measured_size(table, hidden, SETTINGS) == pytest.approx(size, rel=ASKED)


def test_size_out_of_reach_is_refused_with_the_largest_one(scale):
    start = HiddenEffect("creep", "joint_3", "standard_solid", 0.2, 0)
    with pytest.raises(InputError, match=r"size 1e\+06 is out of reach: .*simulated, 2, it is \d"):
        scale.sized(start, 1e6)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_magnitude_is_found_for_powers_and_thresholds(power):
    def law(x):
        return 3.0 * max(x - 0.1, 0.0) ** power

    found = magnitude_for(law, 1e-3, 2.0, 10.0)
    assert law(found) == pytest.approx(2.0, rel=5e-3)
    assert magnitude_for(law, 1e-3, 2.0, 0.2) is None


def test_seed_draws_the_same_secret_and_seeds_differ(wrist):
    short = replace(SETTINGS, rate_hz=10.0)
    one, again = (draw(3, wrist(), short, 20.0) for _ in range(2))
    assert one == again
    others = {draw(seed, wrist(), short, 20.0).hidden.effect for seed in (4, 5)}
    assert len(others | {one.hidden.effect}) > 1
    with pytest.raises(InputError, match="-1"):
        draw(-1, wrist(), short, 20.0)


def test_a_riddle_is_a_wrist_that_works_and_has_something_to_find(wrist):
    """Seed 2 drew a link five times as soft; seed 8 a target, which every session mounts anew."""
    short = replace(SETTINGS, rate_hz=10.0)
    for seed in (2, 8):
        hidden = draw(seed, wrist(), short, 20.0, without={"target_mounting"}).hidden
        assert is_plausible(hidden)
        assert hidden.effect != "target_mounting"


def test_wrong_base_is_wrong_by_what_it_says_and_shimmed_at_home(wrist):
    table = wrist()
    laws = base_laws("wrong", table, 2, 0)
    parts = table.components
    for law in laws:
        parts = law.parts(parts)
    ratio = parts.flexibility[:, 0, 0] / table.components.flexibility[:, 0, 0]
    assert np.all(np.abs(ratio - 1.0) <= 0.3)
    assert np.ptp(ratio) > 0.1
    settings = replace(SETTINGS, instrument="ideal", base="wrong", base_seed=2)
    cell = VirtualCell(table, settings, np.random.default_rng(0))
    sample = cell.run(np.zeros(1), np.zeros((1, 2)))
    shift, turn = np.split(residual(table, sample)[0], 2)
    assert 1e-4 < np.linalg.norm(shift) < 4e-3
    assert np.linalg.norm(turn) < np.radians(1.0)
    with pytest.raises(InputError, match="shaky"):
        base_laws("shaky", table, 2, 0)
