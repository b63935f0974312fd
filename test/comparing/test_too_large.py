"""A load in too small a unit is beyond the table's range: it is named, not what is left without."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.commands import diagnose
from wrist_stiffness.commands.diagnose import mistake_beside
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.wiring import load_too_large
from wrist_stiffness.simulation.cell import CellSettings

GRAMS = 1e3 / 9.80665

UNITS = pytest.mark.parametrize(
    ("force", "moment", "words"),
    [
        (1e3, 1e3, "with the load divided by 1000 the error is"),
        (1e3, 1.0, "are they in mN where N belong?"),
        (1.0, 1e3, "are they in N mm where N m belong?"),
        (GRAMS, 1.0, "are they in grams where N belong?"),
        (GRAMS, GRAMS, "with the load divided by 102 the error is"),
    ],
    ids=["mN and N mm", "mN", "N mm", "grams", "grams at a lever"],
)


def in_units(session, force, moment):
    load = session.block.load * np.repeat([force, moment], 3)
    return replace(session, block=replace(session.block, load=load))


@pytest.fixture(scope="module")
def sound(model, in_the_cell):
    return in_the_cell(model.table, CellSettings(rate_hz=20.0, program_seconds=60.0), 3)


@UNITS
def test_a_load_in_a_smaller_unit_is_told(model, sound, force, moment, words):
    told = compare_models([("m", model)], [in_units(sound, force, moment)]).mistake
    assert words in told
    assert "positions" not in told
    right = compare_models([("m", model)], [sound]).models[0].explained.error
    assert f"the error is {right['s_um']:.3g} um of s" in told


@UNITS
@pytest.mark.parametrize("seed", [0, 1])
def test_it_is_told_of_a_tracker_on_a_wrist_within_its_tolerances(
    model, in_the_cell, seed, force, moment, words
):
    settings = CellSettings(
        rate_hz=20.0, program_seconds=60.0, instrument="tracker", base="wrong", base_seed=seed
    )
    measured = in_units(in_the_cell(model.table, settings, 3), force, moment)
    assert words in load_too_large(model, [measured])


def test_diagnose_says_the_same_and_asks_no_further(model, sound, monkeypatch):
    """What is left of the samples would name something else."""
    monkeypatch.setattr(diagnose, "suspicion_in", None)
    monkeypatch.setattr(diagnose, "wrong_load", None)
    answer = SimpleNamespace(
        diagnosis=SimpleNamespace(noise_of_judge={"s_um": 1.0}, after={"s_um": 10.0})
    )
    told = mistake_beside(model, answer, [in_units(sound, GRAMS, 1.0)])
    assert "are they in grams where N belong?" in told


def test_a_load_that_no_unit_explains_is_doubted_without_a_unit(model, sound):
    """It is that of another time."""
    other = replace(sound.block, load=1e3 * sound.block.load[::-1])
    told = load_too_large(model, [replace(sound, block=other)])
    assert "measured poses are under a load beyond the table's range; check its unit" in told


def test_a_load_that_is_there_is_in_no_other_unit(model, sound):
    """The platform goes a hundred times as far, as it does under grams that are newtons."""
    nowhere = np.full_like(sound.rotation, np.nan)
    measured = replace(sound, shift=GRAMS * sound.shift, rotation=nowhere, covariance=None)
    told = load_too_large(model, [in_units(measured, GRAMS, 1.0)])
    assert "beyond the table's range; check its unit" in told


def test_fewer_poses_beyond_the_range_are_left_out_and_no_more(model, sound):
    load = sound.block.load.copy()
    load[::3] *= 1e3
    assert load_too_large(model, [replace(sound, block=replace(sound.block, load=load))]) == ""
    assert load_too_large(model, [sound]) == ""
