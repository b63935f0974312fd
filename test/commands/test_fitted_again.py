"""A recording is no knowledge twice: what a fit found in it does not hide what is missing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from measured_wrist import measured_in, random_poses

from wrist_stiffness.commands import calibrate, extend
from wrist_stiffness.commands.calibrate import calibrate_model
from wrist_stiffness.commands.extend import extend_model
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import effect_named, find_law
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015_model.yaml")
RUN = Run("...", "2026-01-01T00:00:00+00:00")
KNOWN = [
    *("measurement_frame", "target_mounting", "encoder_offset", "axis_misalignment"),
    *("flange_contact", "bushing_stiffness", "link_stiffness"),
]
"""Of the base only the load sensor's tare and scale are fitted: they stand in for the mass."""

MASS_G = 150.0


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """Return a function that gives the file of a day on which the platform carried a mass."""
    model = load_model(SHIPPED)
    mass = Effect(find_law("gravity"), "platform").with_values({"mass_g": MASS_G, "z_mm": -18.0})
    days = {}

    def day(number):
        rng = np.random.default_rng(number)
        path = tmp_path / f"day_{number}.mcap"
        path.write_bytes(bytes([number]))
        heavy, notes = model.with_effects(mass), {"calibrated": KNOWN}
        session = measured_in(heavy, random_poses(rng, 60, 0.7), rng, notes=notes)
        days[path] = replace(session, name=path.name)
        return path

    def read(recordings, *_):
        return {Path(path): days[Path(path)] for path in recordings.paths}

    for workflow in (calibrate, extend):
        monkeypatch.setattr(workflow, "read_sessions", read)
    return day


def values(parameters):
    return {(each.effect, each.key): each.value for each in parameters}


def test_a_fit_repeated_gives_the_same_answer(tmp_path, recorded):
    day = recorded(1)
    once, twice = tmp_path / "once.yaml", tmp_path / "twice.yaml"
    first = calibrate_model(SHIPPED, Recordings([day], {}), once, RUN).calibration
    second = calibrate_model(once, Recordings([day], {}), twice, RUN).calibration
    assert values(second.parameters) == pytest.approx(values(first.parameters))
    # The tare went far for want of the mass: that is no typical magnitude the second time either.
    for found in (first, second):
        assert max(abs(each.moved) for each in found.parameters) > 5.0
    # What it began with is told as it stands, though.
    assert second.before["s_um"] < 1.1 * first.after["s_um"] < first.before["s_um"]


def test_another_day_is_new_knowledge(tmp_path, recorded):
    once, twice = tmp_path / "once.yaml", tmp_path / "twice.yaml"
    first = calibrate_model(SHIPPED, Recordings([recorded(1)], {}), once, RUN).calibration
    later = calibrate_model(once, Recordings([recorded(2)], {}), twice, RUN).calibration
    farthest = [max(abs(each.moved) for each in found.parameters) for found in (first, later)]
    # It begins where the first day ended.
    assert farthest[1] < 0.7 * farthest[0]


@pytest.mark.slow
def test_what_stood_in_for_an_effect_gives_way_to_it(tmp_path, recorded):
    day = Recordings([recorded(1)], {})
    once = tmp_path / "once.yaml"
    calibrate_model(SHIPPED, day, once, RUN)
    addition = effect_named("gravity@platform")
    found = {
        name: extend_model(parent, addition, day, tmp_path / f"{name}.yaml", RUN).extension
        for name, parent in (("calibrated", once), ("bare", SHIPPED))
    }
    assert values(found["calibrated"].parameters) == pytest.approx(values(found["bare"].parameters))
    mass = next(each for each in found["calibrated"].own if each.key == "mass_g")
    assert abs(mass.value - MASS_G) < 3.5 * mass.sigma < 0.5 * MASS_G


def test_no_model_is_written_where_asking_for_a_mistake_fails(recorded, tmp_path, monkeypatch):
    def refused(*_):
        raise InputError("too little to compare")

    for asking in ("suspicion_in", "doubts_load"):
        monkeypatch.setattr(calibrate, asking, refused)
    with pytest.raises(InputError, match="too little"):
        calibrate_model(SHIPPED, Recordings([recorded(1)], {}), tmp_path / "mine.yaml", RUN)
    assert not (tmp_path / "mine.yaml").exists()
