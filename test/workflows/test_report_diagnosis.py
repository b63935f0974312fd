"""The page of a diagnosis made by hand: everything of the result is on it, in words."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.campaign.observing import QUANTITIES
from wrist_stiffness.campaign.searching.contributions import Contribution
from wrist_stiffness.diagnosis import Diagnosis, Finding, Observations
from wrist_stiffness.diagnosis.result import NotExcited, Unexplained
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.workflows import diagnose
from wrist_stiffness.workflows.diagnose import Diagnosed
from wrist_stiffness.workflows.provenance import Provenance, Run
from wrist_stiffness.workflows.read_sessions import Recordings
from wrist_stiffness.workflows.report.diagnosis_report import report_of_diagnosis, shown_by
from wrist_stiffness.workflows.report.page import html_of

FINDING = Finding(
    (("joint_clearance", "joint_3"), ("joint_clearance", "joint_4")),
    {"clearance_um": (12.1, 0.4)},
    0.42,
    123.4,
    0.001,
    0.97,
    {"s_um": (3.2, 0.3), "phi_mdeg": (14.0, 2.0)},
    "needs_signal",
    "joint_3 has play",
    "rock it by hand",
)
RESULT = Diagnosis(
    "effect",
    "dwell",
    {"s_um": 1.2, "phi_mdeg": 6.3},
    {"s_um": 7.5, "phi_mdeg": 20.0},
    {"s_um": 1.3, "phi_mdeg": 6.5},
    ("registration: 700 um of s",),
    (FINDING,),
    Unexplained((), 0.0, ""),
    (
        NotExcited("creep", "joint_2", "hold a load for 60 s"),
        NotExcited("creep", "joint_5", "hold a load for 60 s"),
    ),
    3,
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
    values = np.repeat([1e-6, 1e-4], 3) * rng.normal(size=(n, 6))
    values[:, 2] += 5e-6 * conditions["approach_1"]
    return Observations(values, conditions, time_s=conditions["time_s"], quantities=QUANTITIES)


MISTAKE = "Look at the set-up first: with the load's sign turned the error falls from 9 to 1 um"


def page_of(result, observations, notes=(), contributions=(), mistake=""):
    shown = shown_by(observations, np.random.default_rng(0), 0.1 * observations.values)
    provenance = Provenance("wrist-stiffness diagnose", "2026-01-01", {"m": "a"}, {"r": "b"})
    told = (mistake, notes, provenance)
    page = report_of_diagnosis(result, contributions, shown, ["monday"], *told)
    return unescape(html_of(page))


def test_everything_of_a_finding_is_on_the_page(observations):
    page = page_of(RESULT, observations, ["monday: 5 spikes"])
    for words in (
        "Missing in the model: joint_clearance@joint_3 (or joint_clearance@joint_4).",
        "s from 7.5 to 1.3 µm (noise floor 1.2)",
        "joint_3 has play",
        "To be sure: rock it by hand",
        "12.10 ± 0.40",
        "3.20 ± 0.30 µm",
        "the nodes can correct it where they get its signal",
        "another session",
        "registration: 700 µm of s",
        "units left out as lost beams: 3",
        "monday: 5 spikes",
        "creep at joint_2, creep at joint_5",
        "hold a load for 60 s",
        "When motor 1 is approached",
    ):
        assert words in page, words
    # The fall, and the residual against its condition.
    assert page.count("data:image/svg+xml") == 2
    assert re.search(r"evidence \(2 ln Bayes factor\)\W+td\W+td\W+123", page)


def test_a_mistake_of_the_set_up_is_told_before_any_effect(observations):
    """No effect is as large, and whatever is named stands in for it."""
    page = page_of(RESULT, observations, mistake=MISTAKE)
    assert 0 < page.index("Look at the set-up first") < page.index("Missing in the model")
    answer = SimpleNamespace(diagnosis=RESULT, contributions=(), absorbed=())
    provenance = Provenance("wrist-stiffness diagnose", "2026-01-01", {"m": "a"}, {"r": "b"})
    told = Diagnosed(answer, ("monday",), MISTAKE, (), provenance)
    assert told.lines()[:2] == [MISTAKE, ""]
    assert told.lines()[2].startswith("Missing in the model")
    assert told.as_values()["set_up_mistake"] == MISTAKE


@pytest.mark.parametrize(("left", "asked"), [(1.9, 0), (2.1, 1)])
def test_a_mistake_is_looked_for_where_much_is_left(monkeypatch, left, asked):
    """It takes seconds of a long recording, and what effects explain was no mistake."""
    floor = {"s_um": 1.0, "phi_mdeg": 5.0}
    result = replace(RESULT, noise_floor=floor, after={"s_um": 1.0, "phi_mdeg": 5.0 * left})
    found = SimpleNamespace(diagnosis=result, contributions=(), absorbed=())
    done = []
    monkeypatch.setattr(diagnose, "diagnose_sessions", lambda *_, **__: found)
    monkeypatch.setattr(diagnose, "suspicion_in", lambda *_: done.append(1))
    monkeypatch.setattr(diagnose, "told_mistake", lambda _: MISTAKE)
    recordings = Recordings([Path(__file__).parents[1] / "data" / "wrist_b.mcap"], {})
    model = shipped_file("config/palmieri2015_model.yaml")
    told = diagnose.diagnose_recordings(model, recordings, Run("diagnose", "2026-01-01"))
    assert (len(done), told.mistake) == (asked, MISTAKE if asked else "")


def test_nothing_missing_is_said_first(observations):
    page = page_of(replace(RESULT, verdict="none", findings=()), observations)
    assert "Nothing is missing: what is left is noise." in page
    assert "Missing in the model" not in page


def test_unknown_tells_on_what_it_depends(observations):
    rest = Unexplained(("humidity", "T_link_1", "speed_2"), 0.31, "the conditions predict it")
    page = page_of(replace(RESULT, verdict="unknown", unexplained=rest), observations)
    assert "check it on the machine before you add it" in page
    assert "Not explained by any known effect: 31 % of the structure above the noise." in page
    assert "It depends on humidity, T_link_1, speed of motor 2." in page
    assert "Missing in the model" in page


def test_suspects_are_ranked_and_called_not_proven(observations):
    found, tolerance, suspect = (
        Contribution(effect, place, kind, {"s_um": (size, 0.5), "phi_mdeg": (0.5, 0.2)}, size)
        for effect, place, kind, size in (
            ("joint_clearance", "joint_3", "finding", 6.25),
            ("link_stiffness", "link_1", "tolerance", 4.0),
            ("drift", "pose_sensor", "suspect", 1.75),
        )
    )
    page = page_of(RESULT, observations, contributions=(found, tolerance, suspect))
    _, section = page.split("What adds most to the error", 1)
    section, _ = section.split("</section>", 1)
    assert section.index("6.25 ± 0.50") < section.index("1.75 ± 0.50")
    assert section.index("drift@pose_sensor") < section.index("suspect, not proven")
    assert "link_stiffness" not in section
    assert "What adds most" not in page_of(RESULT, observations, contributions=(found, tolerance))
