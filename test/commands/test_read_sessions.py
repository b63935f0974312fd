"""What is said of recordings before a command works on them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness import topics
from wrist_stiffness.cli.main import main
from wrist_stiffness.commands import read_sessions as read_sessions_module
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import (
    Recordings,
    measured_sha256,
    read_sessions,
    was_fitted_to,
)
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.recording.messages import String
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015_model.yaml")
THURSDAY = Path(__file__).parent.parent / "data" / "tutorial" / "thursday.mcap"


def read(paths, *models):
    return read_sessions(Recordings(paths, {}), models, lambda done, total: None)


def test_a_copy_of_a_recording_is_no_second_session(tmp_path, model):
    """Else a fit to the one would be judged by the other as by a day it has not seen."""
    copy = shutil.copy(THURSDAY, tmp_path / "friday.mcap")
    (session,) = read([THURSDAY, copy], model).values()
    assert session.name == "thursday.mcap"
    assert session.remarks[-1] == f"{copy} holds the same measurements: used once"


def test_without_a_model_no_recording_is_read():
    with pytest.raises(InputError, match="needs a model"):
        read([THURSDAY])


def test_a_recording_given_twice_is_used_once_and_said(model):
    (session,) = read([THURSDAY, THURSDAY], model).values()
    assert "given more than once: used once" in session.remarks


def test_a_replay_and_an_import_of_a_recording_are_no_further_sessions(tmp_path, model):
    replayed, exported = tmp_path / "replayed.mcap", tmp_path / "thursday.csv"
    replay(THURSDAY, SHIPPED, replayed)
    assert main(["export", str(THURSDAY), "-o", str(exported)]) == 0
    assert main(["import", str(exported), "-o", str(tmp_path / "again")]) == 0
    (session,) = read([THURSDAY, tmp_path], model).values()
    assert [text for text in session.remarks if "used once" in text] == [
        f"{path} holds the same measurements: used once" for path in (tmp_path / "again", replayed)
    ]


@pytest.mark.slow
def test_a_model_is_known_to_be_fitted_to_a_replay_of_its_recording(tmp_path, model):
    """Else what it found there would count twice: as knowledge, and as data."""
    tuesday = THURSDAY.with_name("tuesday.mcap")
    (day,) = read([THURSDAY], model).values()
    fitted = replace(model, lineage=(Run("...", "2026-01-01").step(SHIPPED, {THURSDAY: day}),))
    replayed = tmp_path / "replayed.mcap"
    replay(THURSDAY, SHIPPED, replayed)
    for path in (THURSDAY, replayed):
        assert was_fitted_to(fitted, read([path], model))
        assert not was_fitted_to(model, read([path], model))
    assert not was_fitted_to(fitted, read([tuesday], model))
    # Models of before say of their recordings nothing but what the files were.
    (step,) = fitted.lineage
    earlier = replace(fitted, lineage=(replace(step, measured={}),))
    assert was_fitted_to(earlier, read([THURSDAY], model))
    assert not was_fitted_to(earlier, read([replayed], model))


def test_other_poses_and_the_same_poses_at_another_time_are_other_measurements(model):
    """Of an exact instrument a second day may show the poses of the first."""
    (day,) = read([THURSDAY], model).values()
    later = replace(day, block=replace(day.block, time=day.block.time + 1.0))
    moved, turned = replace(day, shift=day.shift + 1e-9), replace(day, rotation=-day.rotation)
    assert len(set(map(measured_sha256, (day, replace(day), later, moved, turned)))) == 4


def test_a_note_that_calls_calibrated_what_no_fit_refits_is_said(tmp_path, model):
    path = tmp_path / "noted.mcap"
    note = String(json.dumps({"calibrated": ["encoder_offset", "encoder_ofset", 3]}))
    with RecordingWriter(path) as writer:
        for topic, stamp_ns, message in open_recording(THURSDAY).messages():
            writer.write(topic, note if topic == topics.RECORDING_NOTES else message, stamp_ns)
    (session,) = read([path], model).values()
    assert "'calibrated' names encoder_ofset, 3, without effect" in session.remarks[-1]


def test_an_effect_that_a_recording_has_no_signal_for_is_said_of_that_recording(model):
    """Else its model looks wrong there, and nothing says that it was not asked."""
    up = np.eye(6)[2]
    law = FormulaLaw("lifted", "frame", up, "um * clamp_bar", ("clamp_bar",), ("um",))
    lifted = model.with_effects(Effect(law, "frame").with_values({"um": 2.0}))
    tuesday = THURSDAY.with_name("tuesday.mcap")
    without, clamped = read([THURSDAY, tuesday], model, lifted, lifted).values()
    said = ("lifted@frame: covariate clamp_bar is missing, left out",)
    assert (without.name, without.remarks) == ("tuesday.mcap", said)
    assert (clamped.name, clamped.remarks) == ("thursday.mcap", ())


def test_a_missing_signal_is_said_where_the_recording_begins_out_of_range(model):
    law = FormulaLaw("lifted", "frame", np.eye(6)[2], "um * clamp_bar", ("clamp_bar",), ("um",))
    lifted = model.with_effects(Effect(law, "frame").with_values({"um": 2.0}))
    (session,) = read([THURSDAY.with_name("tuesday.mcap")], model).values()
    theta = session.block.theta.copy()
    theta[0] = 1.4
    beyond = replace(session, block=replace(session.block, theta=theta))
    assert not lifted.accepts(beyond.block)[0]
    assert len(read_sessions_module._without_signal(beyond, [lifted])) == 1
