"""The commands as an object: versions grow, shrink and are judged by what no fit has seen.

What it finds, the built-in examples show (`web/test_examples.py`).
"""

import numpy as np
import pytest

import wrist_stiffness.analysis as analysis_module
import wrist_stiffness.identification.wrist_diagnosis as diagnosis_module
from wrist_stiffness.analysis import Analysis, Cancelled
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.search import TIME_OVER
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument
from wrist_stiffness.web.figures import over_time

pytestmark = pytest.mark.slow

PLAY = "backlash@motor_2"


def two_days(model, *hidden):
    """Sessions of a wrist that hides something."""
    found = []
    for day in (0, 1):
        settings = CellSettings(
            rate_hz=10.0,
            program_seconds=60.0,
            program_seed=41 + day,
            base="wrong",
            base_seed=3,
            session=day,
            hidden=hidden,
        )
        cell = VirtualCell(model.table, settings, np.random.default_rng(day))
        time = np.arange(600) / 10.0
        sample = cell.run(time, cell.desired(time))
        block = Block(time, sample.encoder, sample.wrench, sample.speed)
        scatter = np.diag(instrument(settings.instrument).sigma ** 2)
        pose = sample.measured_shift, sample.measured_rotation
        found.append(MeasuredSession(f"day_{day}", block, *pose, scatter))
    return found


@pytest.fixture(scope="module")
def sessions(model):
    """Two days of a wrist with play in a gear."""
    return two_days(model, HiddenEffect("backlash", "motor_2", "single", np.radians(0.06), 5))


@pytest.fixture(scope="module")
def given(model):
    """A sound wrist that is only asked; on the first day the tracker is away for ten seconds."""
    first, second = two_days(model)
    time = first.block.time - first.block.time[0]
    away = first.take((time < 20.0) | (time > 30.0))
    return Analysis(model, {"first": away, "second": second})


@pytest.fixture
def fitted(monkeypatch):
    """Problems whose base was fitted."""
    found = []

    class Counted(analysis_module.WristProblem):
        def __init__(self, *told):
            found.append(self)
            super().__init__(*told)

    monkeypatch.setattr(analysis_module, "WristProblem", Counted)
    return found


def test_the_error_falls_with_what_is_added(model, sessions, fitted):
    analysis = Analysis(model, sessions)
    assert analysis.versions[0].held_out["s_um"] > 100.0
    calibrated = analysis.calibrate()
    assert calibrated.held_out["s_um"] < 0.1 * analysis.versions[0].held_out["s_um"]
    seen = analysis.preview(PLAY)
    wrong = analysis.preview("backlash@motor_1")
    assert seen.log_gain > wrong.log_gain + 20.0
    before, after = seen.explains["phi_mdeg"]
    assert after < 0.7 * before
    # What a calibration found of the base is no knowledge: no fit is made anew for it.
    assert len(fitted) == 1
    # A preview adds nothing.
    assert [each.name for each in analysis.versions] == ["as given", "calibrated"]
    added = analysis.add(PLAY)
    assert added.held_out["phi_mdeg"] < 0.7 * calibrated.held_out["phi_mdeg"]
    assert added.added.estimates["width_mdeg"].value == pytest.approx(60.0, rel=0.15)
    assert PLAY in {each.name for each in analysis.model.effects}
    assert len(fitted) == 1
    compared = analysis.compare()
    errors = [each.after["phi_mdeg"].rms for each in compared.models]
    assert errors[2] < 0.7 * errors[1]
    with pytest.raises(InputError, match="the model has it already"):
        analysis.add(PLAY)
    assert len(analysis.versions) == 3
    # Another model is asked anew, and the one before it as it was.
    beside = analysis.preview("backlash@motor_1")
    assert len(fitted) == 2
    assert abs(beside.log_gain - wrong.log_gain) > 1.0
    # The other motor has none, beside the right one as little as without it.
    assert max(beside.log_gain, wrong.log_gain) < 0.0
    views = [analysis.view(number) for number in range(3)]
    assert len({each.left.values.shape for each in views} | {seen.change.shape}) == 1
    before, after = analysis.view(1), analysis.view()
    turned = [np.sqrt(np.nanmean(each.left.values[:, 3:] ** 2)) for each in (before, after)]
    assert turned[1] < 0.3 * turned[0]
    # The same was measured; where the instrument stands is in neither.
    assert np.nanmax(np.abs(after.measured[:, :3])) < 5e-4
    assert after.noise["phi_mdeg"] == pytest.approx(5.0, rel=0.2)
    assert analysis.undo() is calibrated
    assert analysis.model is calibrated.model
    assert analysis.preview("backlash@motor_1").log_gain == wrong.log_gain
    assert len(fitted) == 2


def test_what_is_asked_of_one_recording_begins_with_the_fit_that_is_known(
    model, given, monkeypatch
):
    analysis = Analysis(model, given.sessions[:1])
    monkeypatch.setattr(diagnosis_module, "WristProblem", None)
    assert analysis.rank(seconds=1e-3).diagnosis.ended == TIME_OVER


def test_contents_say_what_a_recording_holds(given):
    first, second = given.contents()
    assert (first.name, second.name) == ("day_0", "day_1")
    assert (first.measured, second.measured) == (499, 600)
    assert first.duration_s == pytest.approx(59.9)
    assert second.rate_hz == pytest.approx(10.0, rel=0.01)
    assert 5 < first.dwells < 100
    theta = given.sessions[0].block.theta[:, 1]
    lowest, highest = theta.min(), theta.max()
    assert first.angles[1].tolist() == [lowest, highest]
    assert 0.0 <= first.speed[0] < first.speed[1] < 5.0
    assert first.force[1] > 0.5
    # Before the instrument is registered the error is where it happens to stand.
    assert second.registered["s_um"] < 0.1 * given.versions[0].held_out["s_um"]


def test_lines_end_where_nothing_was_measured_and_are_level_over_a_dwell(given):
    view = given.view()
    x, y = over_time(view, np.arange(float(view.left.n_units)))
    gap, night = np.flatnonzero(np.isnan(y))
    assert 9.0 < 60.0 * (x[gap + 1] - x[gap - 1]) < 11.0
    assert view.left.sessions[int(y[night - 1])] == 0
    assert view.left.sessions[int(y[night + 1])] == 1
    longest = int(np.argmax(np.ptp(view.span, axis=1)))
    held_min = np.ptp(view.span[longest]) / 60.0
    assert held_min > 1.0 / 60.0
    assert np.ptp(x[y == longest]) == pytest.approx(held_min)


def test_what_is_cancelled_changes_nothing(given, monkeypatch):
    monkeypatch.setattr(given, "_progress", lambda done, total: given.cancel())
    with pytest.raises(Cancelled):
        given.calibrate()
    assert [each.name for each in given.versions] == ["as given"]


def test_a_preview_can_be_cancelled(given, monkeypatch):
    steps = []

    def cancelling(done, total):
        steps.append(done)
        if done == 1:
            given.cancel()

    monkeypatch.setattr(given, "_progress", cancelling)
    with pytest.raises(Cancelled):
        given.preview(PLAY)
    assert steps == [0, 1]


def test_what_the_model_has_is_refused_before_any_fit(model, sessions, fitted):
    known = model.with_effects(effect_at(find_law("backlash"), "motor_2", {"width_mdeg": 60.0}))
    analysis = Analysis(known, sessions[:1])
    fitted.clear()
    analysis._problems.clear()
    for ask in (analysis.preview, analysis.add):
        with pytest.raises(InputError, match="the model has it already"):
            ask(PLAY)
    assert not fitted


def test_wrong_use_is_one_clear_line(model, given):
    with pytest.raises(InputError, match="an analysis needs a session"):
        Analysis(model, [])
    with pytest.raises(InputError, match="nothing to undo"):
        given.undo()
    with pytest.raises(InputError, match="write NAME@COMPONENT"):
        given.preview("backlash")
    for ask in (given.view, given.compare):
        for number in (1, -2):
            with pytest.raises(InputError, match=f"no version {number}: the newest is 0"):
                ask(number)
