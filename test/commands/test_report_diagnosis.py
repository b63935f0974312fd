"""The page of a diagnosis made by hand: everything of the result is on it, in words."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.commands import diagnose
from wrist_stiffness.commands.diagnose import Diagnosed
from wrist_stiffness.commands.provenance import Provenance, Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.comparing.explained import explain
from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.inference import Diagnosis, Finding, Observations
from wrist_stiffness.inference.answer import NotExcited, Standing
from wrist_stiffness.report.diagnosis_report import diagnosis_lines, report_of_diagnosis
from wrist_stiffness.report.page import html_of
from wrist_stiffness.report.pictures.errors import draw_against
from wrist_stiffness.sessions.unit_session import QUANTITIES
from wrist_stiffness.shipped import shipped_file

FINDING = Finding(
    (("joint_clearance", "joint_3", 0.8), ("joint_clearance", "joint_4", 0.2)),
    0.993,
    {"clearance_um": (12.1, 0.4)},
    123.4,
    0.98,
    {"s_um": (3.2, 0.3), "phi_mdeg": (14.0, 2.0)},
    "needs_signal",
    "joint_3 has play",
    "rock it by hand",
)
RESULT = Diagnosis(
    "effect",
    0.993,
    {"s_um": 1.2, "phi_mdeg": 6.3},
    {"s_um": 0.0, "phi_mdeg": 0.0},
    {"s_um": 7.5, "phi_mdeg": 20.0},
    {"s_um": 1.3, "phi_mdeg": 6.5},
    (FINDING,),
    (),
    {},
    0.0,
    (
        Standing("joint_clearance@joint_3", 0.8, 123.4, True, ""),
        Standing("creep@joint_1", 0.0, 2.1, False, "others explain far more, to first order"),
    ),
    (
        NotExcited("creep", "joint_2", "hold a load for 60 s"),
        NotExcited("creep", "joint_5", "hold a load for 60 s"),
    ),
    ("registration: 700 um of s",),
    "another session",
)


@pytest.fixture(scope="module")
def observations():
    rng = np.random.default_rng(0)
    n = 120
    names = ("theta_1", "theta_2", "fx", "fy", "fz", "mx", "my", "mz", "held_s", "moment")
    conditions = {name: rng.uniform(0.1, 1.0, n) for name in names}
    conditions |= {f"approach_{motor}": rng.choice([-1.0, 1.0], n) for motor in (1, 2)}
    conditions |= {"speed_1": np.zeros(n), "speed_2": np.zeros(n)}
    conditions |= {"force": rng.uniform(0, 1, n), "loaded_at_rest": rng.integers(0, 2, n) * 1.0}
    conditions["time_s"] = 3.0 * np.arange(n)
    scatter = np.repeat([1e-6, 1e-4], 3)
    values = scatter * rng.normal(size=(n, 6))
    values[:, 2] += 5e-6 * conditions["approach_1"]
    time = conditions["time_s"]
    return Observations(values, conditions, np.diag(scatter**2), time, quantities=QUANTITIES)


MISTAKE = "Look at the set-up first: with the load's sign turned the error falls from 9 to 1 um"

ABSORBED = (
    TakenUp("registration", {"s": 700.0, "phi": 12.0}),
    TakenUp("axis_misalignment@joint_3", {"s": 4.2, "phi": 31.0}, "tilt_u_mdeg", -43.0, 1.5),
)

PROVENANCE = Provenance("wrist-stiffness diagnose", "2026-01-01", {"m": "a"}, {"r": "b"})


class Units:
    """What is asked of a session beside its table: the scatter of one measurement."""

    drift, white = np.zeros(6), np.repeat([1e-6, 1e-4], 3)

    def __init__(self, n):
        self.measured = np.ones(n, dtype=bool)

    def __len__(self):
        return len(self.measured)


def page_of(result, observations, notes=(), mistake="", proposed=()):
    n = observations.n_units
    registration = np.broadcast_to(np.diag(np.repeat(1e-3, 6)), (n, 6, 6))
    weights = np.full((n, 6), 1.0 / np.repeat([1e-6, 1e-4], 3) ** 2)
    left = explain(observations, [Units(n)], registration, np.zeros(6), weights)
    found = SimpleNamespace(
        result=result,
        answer=SimpleNamespace(
            fitted=SimpleNamespace(residual=0.1 * observations.values), absorbed=ABSORBED
        ),
        recordings=["monday"],
        mistake=mistake,
        remarks=notes,
        provenance=PROVENANCE,
        depends=lambda: left,
        proposed=lambda: proposed,
    )
    return unescape(html_of(report_of_diagnosis(found)))


def test_everything_of_a_finding_is_on_the_page(observations):
    page = page_of(RESULT, observations, ["monday: 5 spikes"])
    for words in (
        "Missing in the model: joint_clearance@joint_3 (80 %; or joint_clearance@joint_4 20 %), "
        "99.3 % sure.",
        "s from 7.5 to 1.3 µm (instrument noise 1.2)",
        "joint_3 has play",
        "To be sure: rock it by hand",
        "12.10 ± 0.40",
        "3.20 ± 0.30 µm",
        "the nodes can correct it where they get its signal",
        "Held out: another session;",
        "calibrated model (held out)",
        "with the findings (held out)",
        "instrument noise, without drift",
        "left above noise and drift (all data)",
        "others explain far more, to first order",
        "monday: 5 spikes",
        "creep@joint_2, creep@joint_5",
        "hold a load for 60 s",
        "When motor 1 is approached",
    ):
        assert words in page, words
    for cells in (
        ("registration", "700", "12", "", "-"),
        ("axis_misalignment@joint_3", "4.2", "31", "tilt_u_mdeg = -43", "1.5"),
    ):
        row = "".join(f"<td[^>]*>{re.escape(cell)}</td>" for cell in cells)
        assert re.search(f"<tr>{row}</tr>", page), cells
    # The fall, and the residual against its condition.
    assert page.count("data:image/svg+xml") == 2
    assert re.search(r"log evidence against the model without it\W+td\W+td\W+\+123", page)


def test_a_noise_that_nothing_tells_is_an_upper_bound(observations):
    page = page_of(replace(RESULT, noise_known=False), observations)
    assert "s from 7.5 to 1.3 µm (instrument noise at most 1.2)" in page
    assert "instrument noise at most, without drift" in page


def test_what_mountings_of_gauges_do_is_not_drawn(observations, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "wrist_stiffness.report.diagnosis_report.draw_against",
        lambda told, series: drawn.append(series) or draw_against(told, series),
    )
    n, mounting = observations.n_units, 1e-3 * np.eye(6)[:, 2:3]
    gauged = replace(observations, common=np.tile(mounting, (n, 1, 1)))
    page_of(RESULT, replace(gauged, values=gauged.values + 0.1 * mounting[:, 0]))
    ((_, after),) = drawn[0]
    assert abs(after.values[:, 2].mean()) < 1e-9


def test_a_mistake_of_the_set_up_is_told_before_any_effect(observations):
    """No effect is as large, and whatever is named stands in for it."""
    page = page_of(RESULT, observations, mistake=MISTAKE)
    assert 0 < page.index("Look at the set-up first") < page.index("Missing in the model")
    answer = SimpleNamespace(diagnosis=RESULT, absorbed=(), proposals=None, strain=None)
    told = Diagnosed(answer, ("monday",), MISTAKE, (), PROVENANCE)
    lines = diagnosis_lines(told)
    assert lines[:2] == [MISTAKE, ""]
    assert lines[2].startswith("Missing in the model")
    # The page says what to record for each.
    assert "  creep (2 places). What to record for each: --report or --json." in lines
    assert told.as_values()["set_up_mistake"] == MISTAKE


@pytest.mark.parametrize(("left", "asked"), [(1.9, 0), (2.1, 1)])
def test_a_mistake_is_looked_for_where_much_is_left(monkeypatch, left, asked):
    """It takes seconds of a long recording, and what effects explain was no mistake."""
    noise = {"s_um": 1.0, "phi_mdeg": 5.0}
    result = replace(RESULT, noise=noise, after={"s_um": 1.0, "phi_mdeg": 5.0 * left})
    found = SimpleNamespace(diagnosis=result, absorbed=(), proposals=None, strain=None)
    done = []
    monkeypatch.setattr(diagnose, "diagnose_sessions", lambda *_, **__: found)
    monkeypatch.setattr(diagnose, "suspicion_in", lambda *_: done.append(1))
    monkeypatch.setattr(diagnose, "told_mistake", lambda _: MISTAKE)
    recordings = Recordings([Path(__file__).parents[1] / "data" / "wrist_b.mcap"], {})
    model = shipped_file("config/palmieri2015_model.yaml")
    told = diagnose.diagnose_recordings(model, recordings, Run("diagnose", "2026-01-01"))
    assert (len(done), told.mistake) == (asked, MISTAKE if asked else "")


def test_what_the_judging_session_did_not_measure_has_a_dash():
    seen = {"s_um": 11.0}
    points = replace(RESULT, before=seen, after=seen, held_out_noise={"s_um": 0.6})
    answer = SimpleNamespace(diagnosis=points, absorbed=(), proposals=None, strain=None)
    lines = diagnosis_lines(Diagnosed(answer, ("monday", "tuesday"), "", (), PROVENANCE))
    for row, size in (("calibrated model", "11"), ("instrument noise", "0.6")):
        (line,) = [line for line in lines if line.startswith(f"  {row}")]
        assert line.split()[-2:] == [size, "-"]


def test_nothing_missing_is_said_first(observations):
    page = page_of(replace(RESULT, verdict="none", findings=()), observations)
    assert "Nothing is missing: what is left is noise" in page
    assert "Missing in the model" not in page


def test_unknown_tells_on_what_it_depends(observations):
    left = {"s_um": 3.0, "phi_mdeg": 9.0}
    rest = replace(RESULT, findings=(), depends_on={"humidity": 0.7, "the speed": 0.3})
    unknown = replace(rest, verdict="unknown", discrepancy=left)
    command = "wrist-stiffness extend m.yaml --formula 'a_um * (x < 1)'"
    page = page_of(unknown, observations, proposed=["Proposed law: 3 um.", f"   {command}"])
    assert f"<p>Proposed law: 3 µm.</p>\n<pre>{command}</pre>" in page
    assert "with the findings" not in page
    assert page.count("data:image/svg+xml") == 1
    assert page.index("What remains") < page.index("How large the error is")
    assert "no effect in the catalogue explains it" in page
    assert "It depends on humidity (70 %), the speed (30 %)." in page
    assert "Left above the noise: s 3 µm, phi 9 mdeg." in page
