"""Tools of bench/hidden_effects on which its scores rest."""

import numpy as np
import pytest
from scipy.stats import binomtest, kstest

from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.simulation.size import BasePose


@pytest.mark.parametrize("sees", ["pose", "points", "pointing"])
def test_registration_of_a_badly_placed_sensor_is_found_to_rounding(sees, bench):
    tools = bench("registered")
    rng = np.random.default_rng(3)
    rotation, _ = exp_twist(np.concatenate([np.zeros((60, 3)), rng.normal(size=(60, 3))], axis=1))
    base = BasePose(rotation, 2e-5 * rng.normal(size=(60, 3)))
    size = np.repeat([1e-3, np.radians(0.2)], 3)
    (x, x_shift), (y, y_shift) = (exp_twist(size * rng.uniform(-1, 1, 6)) for _ in range(2))
    seen = tools.Registration((x, y), (x_shift, y_shift)).seen(base)
    turned, moved = seen.rotation.copy(), seen.shift.copy()
    if sees == "points":
        turned[:] = np.nan
    if sees == "pointing":
        moved[:] = np.nan
    moved[7], turned[7] = np.nan, np.nan
    found = tools.register(turned, moved, base).seen(base)
    left = tools.difference(turned, moved, found)
    assert np.isnan(left[7]).all()
    assert np.nanmax(np.abs(left)) < 1e-10


@pytest.mark.parametrize(("hits", "trials"), [(0, 6), (3, 10), (97, 100), (20, 20)])
def test_interval_of_a_rate_is_wilsons(hits, trials, bench):
    low, high = binomtest(hits, trials).proportion_ci(0.95, method="wilson")
    assert bench("score").wilson(hits, trials) == pytest.approx((low, high), abs=1e-4)


def test_interval_of_a_paired_difference_is_newcombes(bench):
    """Newcombe, Statist. Med. 17 (1998) 2635: 36, 12, 2 and 0 of 50 pairs, method 10."""
    one = np.repeat([True, False], [48, 2])
    two = np.repeat([True, False, True], [36, 12, 2])
    assert bench("tables").newcombe(one, two) == pytest.approx((0.0569, 0.3404), abs=1e-4)


def test_best_baseline_counts_and_what_was_not_run_says_so(bench):
    aims = bench("aims")
    usual = {"main": True, "kind": "none", "size": 0.0, "spurious": 0, "after": 1.0}
    lines = [
        usual | {"key": str(k), "solver": solver, "named": [["x"]] if k < hits else []}
        for solver, hits in (("own_diagnosis", 1), ("elastic_net", 3), ("stepwise_bic", 9))
        for k in range(10)
    ]
    rows = {row.split("|")[1].strip(): row for row in aims.aims(lines).splitlines()}
    alarms = rows["nothing hides: names an effect in 2 % at most"]
    assert "10 % (2–40)" in alarms
    assert "missed" in alarms
    best = rows["nothing hides: fewer false alarms than any baseline"]
    assert "0.10, elastic_net 0.30" in best
    assert "met" in best
    assert "not run" in rows["two effects: both in 88 %"]


def test_proposed_numbers_spread_as_a_generators_do(bench):
    numbers = bench("ceiling").Numbers(np.random.default_rng(5).standard_normal(3000))
    even = np.array([numbers.uniform(2.0, 4.0) for _ in range(1000)])
    assert kstest(even, "uniform", (2.0, 2.0)).pvalue > 1e-3
    whole = [numbers.integers(5, 8) for _ in range(1000)]
    assert sorted(set(whole)) == [5, 6, 7]
    assert numbers.normal(size=(2, 3)).shape == (2, 3)
    assert numbers.used == 2006


def test_cases_have_names_of_their_own_and_cover_the_catalogue(bench):
    cases = bench("cases").full_cases()
    assert len({case.key for case in cases}) == len(cases)
    assert sum(case.kind == "none" for case in cases) >= 150
    sizes = {case.size for case in cases if case.kind == "single"}
    assert {0.05, 0.5, 1.0, 3.0, 30.0, 100.0} <= sizes
    hidden = {place for case in cases if case.kind == "single" for place in case.effects}
    assert hidden == set(bench("cases").searched(bench("cases").CATALOGUE))
    assert sum(case.path == "exact" for case in cases) >= 60
    asked = [case for case in cases if case.asked("knows_the_laws")]
    assert len(asked) >= 60
    assert all(case.main and case.kind in ("single", "double") for case in asked)
    stages = [bench("cases").stage_of(case) for case in cases]
    assert stages == sorted(stages)


ROUNDING = 1e-12
"""Of quaternions in a recording, and of stamps since 1970 [-]."""


@pytest.fixture
def half_a_minute(bench):
    """Return a function that makes a case of 30 s in which nothing hides."""
    cases = bench("cases")

    class Short(cases.Case):
        seconds = 30.0

    return lambda **how: Short((), 0.0, **how)


@pytest.mark.parametrize(
    "how",
    [
        {"lost_beams": 0.05},
        {"lost_beams": 0.05, "instrument": "tracker"},
        {"lost_beams": 0.05, "sees": "points"},
        {"instrument": "cmm"},
    ],
    ids=["interferometer", "tracker", "points", "at rests"],
)
def test_the_own_diagnosis_gets_what_reading_the_recording_gives(
    how, bench, half_a_minute, tmp_path
):
    observe, case = bench("observe"), half_a_minute(**how)
    day = observe.observe(case, (), 0)
    path, table = tmp_path / "day.mcap", bench("bench_wrist").wrist()
    settings, seed = observe.settings_of(case, 0), observe.noise_seed(case, 0)
    simulate_recording(path, table, settings, case.seconds, seed)
    read, wanted = day.read, read_session(path, table)
    assert len(read) < len(day.recorded)  # rows without a pose tell nothing new
    assert (read.name, read.notes) == (day.recorded.name, day.recorded.notes)
    assert read.remarks == wanted.remarks
    assert any("lost beams: left out" in remark for remark in read.remarks) == ("lost_beams" in how)
    assert np.array_equal(read.measured, wanted.measured)
    for found, right in (
        (read.shift, wanted.shift),
        (read.rotation, wanted.rotation),
        (read.block.theta, wanted.block.theta),
        (read.block.theta_dot, wanted.block.theta_dot),
        (read.block.load, wanted.block.load),
        *((read.block.temperatures[name], v) for name, v in wanted.block.temperatures.items()),
    ):
        np.testing.assert_allclose(found, right, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(
        read.block.time - read.block.time[0], wanted.block.time - wanted.block.time[0], atol=1e-6
    )


@pytest.mark.parametrize("sees", ["pose", "points", "pointing"])
def test_a_session_without_lost_beams_is_read_as_it_was_recorded(sees, bench, half_a_minute):
    day = bench("observe").observe(half_a_minute(sees=sees), (), 0)
    read, recorded = day.read, day.recorded
    assert read.remarks == ()
    for name in ("shift", "rotation", "covariance"):
        assert np.array_equal(getattr(read, name), getattr(recorded, name), equal_nan=True)
    for name in ("time", "theta", "theta_dot", "load"):
        assert np.array_equal(getattr(read.block, name), getattr(recorded.block, name))
    for name, values in recorded.block.temperatures.items():
        assert np.array_equal(read.block.temperatures[name], values)


def test_the_own_diagnosis_is_asked_about_what_was_read(bench, half_a_minute, monkeypatch):
    own, observe = bench("own_diagnosis"), bench("observe")
    riddle = observe.pose_riddle(half_a_minute(lost_beams=0.05))
    monkeypatch.setattr(own, "diagnosed", lambda riddle, session: session)
    assert own.own_diagnosis(riddle) is riddle.days[0].read


@pytest.mark.parametrize("solver", ["own_diagnosis", "own_diagnosis_mcap", "always_none"])
def test_another_reading_or_delay_makes_old_answers_stale(solver, bench, monkeypatch):
    run, tools = bench("run"), bench("bench_wrist")
    asked = []
    monkeypatch.setattr(run, "code_version", lambda modules, files: asked.append((modules, files)))
    run.version_of(solver)
    [(modules, files)] = asked
    sources = {path.relative_to(tools.PACKAGE).as_posix() for path in tools._sources(modules)}
    assert {"sessions/reading/lost_beams.py", "simulation/laws/time_delay.py"} <= sources
    assert {"observe.py", "own_diagnosis.py"} <= set(files)


CODE = """LIMIT = 3.0


def far(value):
    return value > LIMIT
"""
EXPLAINED = """'''What is far.'''

LIMIT = 3.0  # of the noise
'''In deviations.'''

def far(
    value,
):
    '''Tell whether it is.'''
    return value > LIMIT
"""


def test_only_what_code_does_makes_old_answers_stale(bench, monkeypatch, tmp_path):
    tools = bench("bench_wrist")
    monkeypatch.setattr(tools, "__file__", str(tmp_path / "bench_wrist.py"))
    digests = []
    for number, text in enumerate((CODE, EXPLAINED, CODE.replace("3.0", "3.5"))):
        name = f"file_{number}.py"
        (tmp_path / name).write_text(text)
        digests.append(tools.code_version((), (name,)))
    assert digests[0] == digests[1] != digests[2]


@pytest.fixture
def twelve_units(bench):
    """Session of twelve units, and a dictionary of one zero and one direction of a wrong base."""
    rng, units = np.random.default_rng(8), 12
    zero, base = rng.normal(size=(2, units, 6, 1))
    session = bench("observe").Session(
        residual=np.zeros((units, 6)),
        measured=np.ones((units, 6), dtype=bool),
        covariance=np.tile(np.eye(6), (units, 1, 1)),
        wander=np.zeros((6 * units, 6 * units)),
        conditions=np.zeros((units, 14)),
    )
    word, tools = bench("dictionary").Word, bench("dictionary")
    name = tools.nuisance_names()[0]
    words = tools.Dictionary((word(name, zero, zero),), word("base", 2.0 * base, 2.0 * base))
    return session, words, zero[..., 0], base[..., 0]


def test_what_zeros_take_up_is_unexcited_and_what_a_base_takes_up_is_absorbed(bench, twelve_units):
    session, words, zero, base = twelve_units
    whole, known_base = (
        bench("whitened").Whitened(session, words, with_base=flag) for flag in (True, False)
    )
    for change, excitation, detectability in (
        (30.0 * zero, 0.1, 0.1),
        # With the zero known: the part of the base across it; else a prior of two standard ones.
        (1.0 * base, np.linalg.norm(base - zero * np.sum(base * zero) / np.sum(zero**2)), 0.5),
    ):
        assert np.linalg.norm(known_base.white(change)) == pytest.approx(excitation, abs=0.11)
        assert np.linalg.norm(whole.white(change)) == pytest.approx(detectability, abs=0.11)
