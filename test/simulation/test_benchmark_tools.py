"""Tools of bench/hidden_effects on which its scores rest."""

import numpy as np
import pytest
from scipy.stats import binomtest

from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.sessions.reading.session import read_session


@pytest.mark.parametrize(("hits", "trials"), [(0, 6), (3, 10), (97, 100), (20, 20)])
def test_interval_of_a_rate_is_wilsons(hits, trials, bench):
    low, high = binomtest(hits, trials).proportion_ci(0.95, method="wilson")
    assert bench("rates").wilson(hits, trials) == pytest.approx((low, high), abs=1e-4)


def test_interval_of_a_paired_difference_is_newcombes(bench):
    """Newcombe, Statist. Med. 17 (1998) 2635: 36, 12, 2 and 0 of 50 pairs, method 10."""
    one = np.repeat([True, False], [48, 2])
    two = np.repeat([True, False, True], [36, 12, 2])
    assert bench("rates").newcombe(one, two) == pytest.approx((0.0569, 0.3404), abs=1e-4)


def test_cases_have_names_of_their_own_and_cover_the_catalogue(bench):
    cases = bench("cases").singles()
    assert len({case.key for case in cases}) == len(cases)
    assert {case.size for case in cases} == {0.5, 1.0, 3.0, 30.0, 100.0}
    hidden = {place for case in cases for place in case.effects}
    assert hidden == set(bench("cases").searched(bench("cases").CATALOGUE))


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
    recorded = observe.measured_session(case, 0, observe.run_cell(case, (), 0))
    path, table = tmp_path / "day.mcap", bench("bench_wrist").wrist()
    settings, seed = observe.settings_of(case, 0), observe.noise_seed(case, 0)
    simulate_recording(path, table, settings, case.seconds, seed)
    read, wanted = observe.as_read(recorded), read_session(path, table)
    assert len(read) < len(recorded)  # rows without a pose tell nothing new
    assert (read.name, read.notes) == (recorded.name, recorded.notes)
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
    observe, case = bench("observe"), half_a_minute(sees=sees)
    recorded = observe.measured_session(case, 0, observe.run_cell(case, (), 0))
    read = observe.as_read(recorded)
    assert read.remarks == ()
    for name in ("shift", "rotation", "covariance"):
        assert np.array_equal(getattr(read, name), getattr(recorded, name), equal_nan=True)
    for name in ("time", "theta", "theta_dot", "load"):
        assert np.array_equal(getattr(read.block, name), getattr(recorded.block, name))
    for name, values in recorded.block.temperatures.items():
        assert np.array_equal(read.block.temperatures[name], values)


def test_another_reading_or_delay_makes_old_answers_stale(bench, monkeypatch):
    own, tools = bench("own_diagnosis"), bench("bench_wrist")
    asked = []
    monkeypatch.setattr(own, "code_version", lambda modules, files: asked.append((modules, files)))
    own.version_of_own()
    [(modules, files)] = asked
    sources = {path.relative_to(tools.PACKAGE).as_posix() for path in tools._sources(modules)}
    assert {"sessions/reading/lost_beams.py", "simulation/laws/time_delay.py"} <= sources
    assert {"observe.py", "own_diagnosis.py"} <= set(files)


@pytest.mark.parametrize(
    ("verdict", "named", "right"),
    [
        ("effect", [["backlash@motor_1", "time_delay@motor_1"]], True),
        ("effect", [["backlash@motor_2"]], False),
        ("effect", [["backlash@motor_1"], ["gravity@platform"]], False),
        ("unknown", [], False),
        ("none", [], False),
    ],
)
def test_a_quick_look_fails_on_a_wrong_name(verdict, named, right, bench, monkeypatch):
    quick = bench("quick")
    told = {"verdict": verdict, "named": named}
    monkeypatch.setattr(quick, "hidden_effects", lambda case: ())
    monkeypatch.setattr(quick, "observe", lambda case, hidden, session: None)
    monkeypatch.setattr(quick, "diagnosed", lambda sessions: told)
    assert quick.is_right(quick.Case((quick.VISIBLE[0],), 3.0)) is right
    assert quick.is_right(quick.Case((), 0.0)) is (verdict == "none")


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
