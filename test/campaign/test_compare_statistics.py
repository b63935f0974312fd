"""Headroom, sentences and worst poses on a table made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.campaign.comparing.comparison import ComparedModel, Comparison, sizes
from wrist_stiffness.campaign.comparing.conditions import conditions
from wrist_stiffness.campaign.comparing.headroom import held_out_process, left_by_others
from wrist_stiffness.campaign.comparing.sentences import Told, tell
from wrist_stiffness.campaign.comparing.worst_poses import worst_poses
from wrist_stiffness.campaign.noise_floor import (
    NoiseFloor,
    against_floor,
    is_at_floor,
    noise_floor,
)

N = 400
SIGMA = np.repeat([1e-6, 1e-4], 3)


def told(observations, seed=0):
    return tell(observations, noise_floor(observations), np.random.default_rng(seed))


def along(component, values):
    out = np.zeros((len(values), 6))
    out[:, component] = values
    return out


def test_noise_depends_on_nothing_and_every_topic_is_named(dwells):
    found = told(dwells(np.random.default_rng(0)))
    assert found.statements == ()
    assert set(found.silent) >= {"approach direction", "load direction", "hold time", "humidity"}
    assert found.not_varied == ("speed",)
    assert found.sentences[0].startswith("Nothing depends beyond chance on approach direction")


def test_backlash_is_told_as_a_gap_that_grows_with_the_load(dwells):
    def lost_motion(c):
        return along(2, c["approach_2"] * (1.6e-6 + 1.2e-6 * (c["force"] - c["force"].mean())))

    found = told(dwells(np.random.default_rng(1), lost_motion))
    gap, growth = found.statements
    # 2 * 1.6 um between both sides; two groups of 200 units with 1 um each: 0.1 um.
    assert gap.condition.name == "approach of motor 2"
    # No chance of 999 comes near, and fast and slow conditions are asked apart: twice 1 in 1000.
    assert gap.p_value == pytest.approx(0.002)
    (change,) = gap.changes
    assert change.size == pytest.approx(3.2, abs=4 * change.uncertainty)
    assert change.uncertainty == pytest.approx(0.1, rel=0.4)
    assert change.where == "+z"
    assert growth.condition.name == "approach of motor 2 with load"
    assert growth.changes[0].size == pytest.approx(2.4, abs=4 * growth.changes[0].uncertainty)
    assert "rather than falling angle, the platform stands 3." in gap.sentence
    assert "the gap between both approaches of motor 2 grows by" in growth.sentence


def change_of(name, component, size):
    return lambda c: along(component, size * c[name])


@pytest.mark.parametrize(
    ("change", "name", "size"),
    [
        (change_of("fy", 1, 2e-6), "force along y", 2.0),
        (change_of("force", 0, 3e-6), "size of the force", 3.0),
        (change_of("humidity", 2, 0.1e-6), "humidity", 0.1),
        (lambda c: along(0, 2e-6 * np.log10(c["held_s"])), "hold time", 2.0),
        (lambda c: along(1, 4e-6 * (c["force"] == 0)), "zero load", 4.0),
        (
            lambda c: along(2, 2e-6 * (c["loaded_at_rest"] - 0.5) * (c["force"] > 0)),
            "loaded at rest",
            2.0,
        ),
        (lambda c: along(0, 1e-6 * c["T_link_1"]), "temperature of link 1", 1.0),
        (lambda c: along(2, 5e-6 * np.cos(4 * c["theta_1"])), "angle of motor 1, four times", 5.0),
    ],
    ids=["direction", "size", "covariate", "hold", "zero", "at rest", "temperature", "harmonic"],
)
def test_each_kind_of_condition_is_found_first_with_its_size(dwells, change, name, size):
    first = told(dwells(np.random.default_rng(2), change)).statements[0]
    assert first.condition.name.startswith(name)
    (shift,) = (each for each in first.changes if each.quantity == "s")
    assert shift.size == pytest.approx(size, abs=4 * shift.uncertainty)
    assert shift.uncertainty < 0.3 * size


def test_of_a_wave_only_the_part_that_was_seen_is_told(dwells):
    """A motor that turns by 0.8 rad either way goes through little of a cosine once a turn."""
    found = told(
        dwells(np.random.default_rng(15), lambda c: along(2, 50e-6 * np.cos(c["theta_2"])))
    )
    first = found.statements[0]
    assert first.condition.name == "angle of motor 2, once a turn"
    (shift,) = (each for each in first.changes if each.quantity == "s")
    assert shift.size == pytest.approx(0.5 * 50.0 * (1.0 - np.cos(0.8)), rel=0.05)


def test_a_temperature_is_felt_late_by_its_time_constant(dwells):
    observations = dwells(np.random.default_rng(16))
    step = (observations.times >= 300.0).astype(float)
    asked, _ = conditions(
        replace(observations, covariates={**observations.covariates, "T_link_1": step})
    )
    (late,) = (each for each in asked if each.name == "temperature of link 1, 5 min late")
    after = observations.times - 300.0
    expected = np.where(after < 0.0, 0.0, -np.exp(-(after + 3.0) / 300.0))
    assert late.columns[:, 0] == pytest.approx(expected, abs=1e-12)


def test_of_a_condition_that_is_constant_but_for_rounding_nothing_is_asked(dwells):
    """A constant load as a sensor's frame turns it, and a room at 0.1 + 0.2 degrees."""
    rng = np.random.default_rng(14)
    observations = dwells(rng)
    rounding = 1.0 + 2e-16 * rng.integers(-1, 2, N)
    still = {"force": rounding, "fz": -rounding, "T_link_1": 0.3 * rounding}
    zero = dict.fromkeys(("fx", "fy", "mx", "my", "mz", "moment"), np.zeros(N))
    constant = replace(observations, covariates={**observations.covariates, **still, **zero})
    asked, not_varied = conditions(constant)
    assert {"load direction", "load size", "zero load", "temperature"} <= set(not_varied)
    assert not any("with load" in each.name or "temperature" in each.name for each in asked)


def test_what_only_went_with_another_condition_has_the_chance_that_is_left_to_it(dwells):
    """A speed that follows the side of approach looks like its backlash at first."""
    rng = np.random.default_rng(15)
    observations = dwells(rng, lambda c: along(3, 5e-3 * c["approach_1"]))
    speed = np.radians(5.0) * (observations.covariates["approach_1"] + rng.normal(0, 1.0, N))
    found = told(replace(observations, covariates={**observations.covariates, "speed_1": speed}))
    assert [each.condition.topic for each in found.statements] == ["approach direction"]
    assert found.silent["speed"] > 0.02


def test_twins_are_named(dwells):
    def with_twin(c):
        c["spindle"] = 2 * c["humidity"] + 5
        return along(0, 0.2e-6 * c["humidity"])

    first = told(dwells(np.random.default_rng(3), with_twin)).statements[0]
    assert {first.condition.name, *first.twins} == {"humidity", "spindle"}
    assert "the same as: " in first.sentence


def test_slow_conditions_of_a_short_recording_are_not_told_from_wander(dwells):
    short = dwells(np.random.default_rng(4), lambda c: along(0, 5e-6 * c["T_link_1"]), n=100)
    found = told(short)
    assert "temperature" in found.too_short
    assert "temperature" not in {each.condition.topic for each in found.statements}
    assert "10 minutes" in found.sentences[-1]


@pytest.mark.parametrize("beside", [0.0, 2e-3], ids=["a sentence", "named only"])
def test_a_topic_is_too_short_to_be_told_or_told_and_never_both(dwells, beside):
    """The swing of an angle grows with time; the temperature does as well and says no more."""

    def growing(c):
        large = along(0, beside * np.sin(c["theta_2"]))
        return large + along(1, 20e-6 * (c["T_link_1"] - 20.0) * np.sin(c["theta_1"]))

    found = told(dwells(np.random.default_rng(4), growing, n=150))
    assert set(found.too_short) == {"temperature", "temperature lag", "time in the session"}
    topics = {each.condition.topic for each in found.statements}
    assert not set(found.too_short) & (topics | set(found.minor) | found.silent.keys())
    assert not any("temperature" in text for text in found.sentences[:-1])


def test_of_a_topic_that_is_slow_in_part_the_rest_is_told(dwells):
    def law(c):
        c["theta_2"] = np.linspace(-0.8, 0.8, len(c["theta_2"]))
        return along(0, 20e-6 * np.cos(c["theta_1"]))

    found = told(dwells(np.random.default_rng(4), law, n=100))
    assert found.statements[0].condition.name.startswith("angle of motor 1")
    assert "motor angle" not in found.too_short
    assert "angle of motor 2, once a turn" in found.too_short


def test_a_process_learns_a_law_of_pose_and_load_down_to_the_noise(dwells):
    def law(c):
        return along(2, 4e-6 * c["fz"] * np.cos(c["theta_1"]) + 3e-6 * np.sin(2 * c["theta_2"]))

    observations = dwells(np.random.default_rng(5), law, n=1200)
    left = observations.with_values(held_out_process(observations, np.random.default_rng(0)))
    before, after = sizes(observations)["s_um"].rms, sizes(left)["s_um"].rms
    assert before > 3
    # The noise of three components of 1 um.
    assert np.sqrt(3) * 0.97 < after < np.sqrt(3) * 1.15


def test_each_block_is_predicted_by_the_others_alone():
    rng = np.random.default_rng(20)
    columns, values = rng.normal(size=(40, 5)), rng.normal(size=(40, 2))
    known, blocks = np.arange(40) % 7 != 0, np.arange(40) // 10
    left = left_by_others(columns, values, values, known, blocks, 0.3)
    for block in range(4):
        own, rest = blocks == block, (blocks != block) & known
        # Ridge regression as least squares with a row of its own for every prior.
        rows = np.vstack([columns[rest], np.eye(5) / np.sqrt(0.3)])
        weights = np.linalg.lstsq(rows, np.vstack([values[rest], np.zeros((5, 2))]), rcond=None)[0]
        expected = known[own, None] * (values[own] - columns[own] @ weights)
        np.testing.assert_allclose(left[own], expected, atol=1e-12)


def test_a_process_makes_nothing_of_noise(dwells):
    observations = dwells(np.random.default_rng(6))
    left = observations.with_values(held_out_process(observations, np.random.default_rng(0)))
    before, after = sizes(observations)["s_um"].rms, sizes(left)["s_um"].rms
    # The best of eight settings may look better by chance, by less than one unit in fifty.
    assert 0.98 * before < after <= before


def test_a_process_makes_nothing_of_slow_wander_under_slow_conditions(dwells):
    """Neighbours in time tell each other's wander; blocks that were not seen do not."""
    rng = np.random.default_rng(23)
    observations = dwells(rng)
    walk = np.cumsum(rng.normal(size=(N, 7)), axis=0) / np.sqrt(N)
    conditions = {name: np.zeros(N) for name in observations.covariates}
    conditions |= {"T_link_1": 20.0 + walk[:, 6], "time_s": observations.times}
    slow = replace(observations, covariates=conditions, values=20e-6 * walk[:, :6])
    left = slow.with_values(held_out_process(slow, np.random.default_rng(0)))
    assert sizes(left)["s_um"].rms > 0.5 * sizes(slow)["s_um"].rms


def test_blanks_stay_blanks_in_what_a_process_leaves(dwells):
    observations = dwells(np.random.default_rng(7), change_of("fz", 2, 3e-6))
    values = observations.values.copy()
    values[::3, 3:], values[:, 0] = np.nan, np.nan
    left = held_out_process(observations.with_values(values), np.random.default_rng(0))
    np.testing.assert_array_equal(np.isnan(left), np.isnan(values))
    assert np.nanstd(left[:, 2]) < 0.7 * np.std(values[:, 2])


def compared(dwells, levels, process):
    rng = np.random.default_rng(13)
    noise = dwells(rng)
    quiet = Told((), (), {}, (), ())
    models = tuple(
        ComparedModel(f"m{place}", noise, noise.with_values(noise.values * level), (), quiet)
        for place, level in enumerate(levels)
    )
    floor = NoiseFloor(np.broadcast_to(SIGMA**2, (N, 6)), "instrument")
    unit = sizes(noise)
    left = {key: process * size.rms for key, size in unit.items()}
    return Comparison(("day",), models, floor, {}, {}, left)


def test_headroom_is_the_share_of_what_could_fall(dwells):
    found = compared(dwells, (10.0, 4.0, 1.0), 1.0)
    assert found.headroom(found.models[1], "s_um") == pytest.approx(6 / 9)
    assert found.headroom(found.models[2], "phi_mdeg") == pytest.approx(1.0)
    assert "67 %" in compared(dwells, (10.0, 4.0), 1.0).verdict[-1]
    assert "all that the conditions could explain" in compared(dwells, (10.0, 1.0), 3.0).verdict[-1]


def test_no_headroom_is_claimed_where_nothing_could_fall(dwells):
    found = compared(dwells, (1.0, 0.99), 0.995)
    assert found.headroom(found.models[1], "s_um") is None
    assert "a curve over the conditions alone reaches 1." in found.verdict[-2]


@pytest.mark.parametrize(
    ("level", "moves"), [(0.5, "s falls from"), (1.0, "s stays at"), (2.0, "s rises from")]
)
def test_an_error_that_shows_no_change_stays(dwells, level, moves):
    assert moves in compared(dwells, (1.0, level), 0.5).verdict[-2]


def test_verdict_says_whether_it_is_noise(dwells):
    found = compared(dwells, (5.0, 1.0), 1.0)
    assert "5.1 x the noise" in found.verdict[0] or "5.0 x the noise" in found.verdict[0]
    assert "no more than the noise" in found.verdict[1]


def test_half_more_than_the_floor_is_more_than_noise():
    assert against_floor(1.1, "replicates") == "no more than the noise"
    assert against_floor(1.5, "replicates") == "1.5 x the noise"
    assert not is_at_floor(1.2, "replicates")


def test_without_repeats_wander_may_be_the_rest():
    assert against_floor(1.1, "instrument") == "no more than the noise"
    assert "slow wander of the instrument, which may be the rest" in against_floor(
        1.4, "instrument"
    )
    assert against_floor(1.6, "instrument").startswith("1.6 x the noise without slow wander")
    assert is_at_floor(1.4, "instrument")
    assert not is_at_floor(1.6, "instrument")


def test_without_a_known_floor_nothing_is_called_noise(dwells):
    found = compared(dwells, (1.0,), 1.0)
    unknown = replace(found, noise=replace(found.noise, source="unpredictable"))
    assert "the noise is not known" in unknown.verdict[0]
    none = replace(found, noise=NoiseFloor(np.zeros((N, 6)), "instrument"))
    assert "the instrument has no noise" in none.verdict[0]


def test_worst_poses_are_apart_and_in_order(dwells):
    rng = np.random.default_rng(14)
    observations = dwells(rng)
    values = observations.values.copy()
    values[100, 2], values[200, 4], values[300, 0] = 50e-6, 3e-3, 20e-6
    floor = {"s_um": 1.7, "phi_mdeg": 9.9}
    worst = worst_poses(observations.with_values(values), floor, ("day",), most=3)
    assert [each.time_s for each in worst] == [300, 600, 900]
    assert worst[0].errors["s_um"] == pytest.approx(50, rel=0.05)
    assert worst[1].errors["phi_mdeg"] == pytest.approx(np.degrees(3e-3) * 1e3, rel=0.05)
    bad = observations.with_values(values)
    close = replace(bad, time_s=0.001 * np.arange(N))
    assert len(worst_poses(close, floor, ("day",), most=3)) == 1
    same = {name: np.zeros(N) for name in ("theta_1", "theta_2", "fx", "fy", "fz")}
    once = replace(bad, covariates={**bad.covariates, **same})
    assert len(worst_poses(once, floor, ("day",), most=3)) == 1


@pytest.mark.parametrize(("n", "lags"), [(90, []), (150, ["5 min"]), (400, ["5 min", "15 min"])])
def test_a_session_is_asked_for_no_longer_lag_than_itself(dwells, n, lags):
    """Three seconds from one dwell to the next: 4.5, 7.5 and 20 minutes."""
    asked, _ = conditions(dwells(np.random.default_rng(8), n=n))
    names = [each.name for each in asked if each.topic == "temperature lag"]
    assert names == [f"temperature of link 1, {lag} late" for lag in lags]
