"""A fault far beyond its usual size is fitted at its size, and nothing else takes it up."""

import re
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.identification.extension import extend
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.simulation.effect_entry import Draw

SECONDS, REACH_S = 60.0, 300.0
COMMISSIONED = [
    *("measurement_frame", "target_mounting", "encoder_offset", "axis_misalignment"),
    *("flange_contact", "link_stiffness", "bushing_stiffness", "load_scale"),
]
"""Only the tare is set up anew: it is what could take up a drift."""

DRIFT = HiddenEffect("drift", "pose_sensor", "linear", 2e-5, 101)


@pytest.fixture(scope="module")
def extension(in_the_cell):
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    settings = CellSettings(
        rate_hz=10.0, program_seconds=SECONDS, program_seed=101, hidden=(DRIFT,)
    )
    session = in_the_cell(model.table, settings, 5, notes={"calibrated": COMMISSIONED})
    return extend(model, Effect(find_law("drift"), "pose_sensor"), [session])


def true_rates(model):
    """Return the hidden rates [um/h], [mdeg/h]."""
    draw = Draw(
        model.table, DRIFT.component, DRIFT.form, DRIFT.magnitude, np.random.default_rng(101)
    )
    per_hour = draw.twist() * 3600.0 / REACH_S
    return per_hour * np.repeat([1e6, 180e3 / np.pi], 3)


def test_rates_of_tens_of_prior_widths_are_found(extension):
    shift = [p for p in extension.own if p.key.startswith("shift")]
    true = true_rates(extension.model)
    for found, planted in zip(shift, true[:3], strict=True):
        assert abs(found.value - planted) < 4.0 * found.sigma
        assert found.sigma < 0.1 * np.linalg.norm(true[:3])


def test_the_tare_does_not_take_up_what_the_prior_holds_back(extension):
    tare = [p for p in extension.parameters if p.effect == "load_bias@load_sensor"]
    assert all(abs(p.value) < 3.0 * p.sigma for p in tare)


def test_the_size_beyond_the_usual_is_said(extension):
    (far,) = (text for text in extension.warnings if "x the typical magnitude" in text)
    assert far.count("_per_h is ") > 1


def test_of_many_sizes_beyond_the_usual_the_furthest_are_named(extension):
    """A law of 35 constants, all off, had a line of 29 sizes."""
    (one,) = (p for p in extension.own if p.key == "shift_x_um_per_h")
    many = [replace(one, key=f"a_{n}_um", value=100 * n * one.value) for n in range(1, 9)]
    told = replace(extension)
    vars(told)["parameters"] = (*extension.parameters, *many)
    (far,) = (text for text in told.warnings if "x the typical magnitude" in text)
    assert re.findall(r"a_\d", far) == ["a_8", "a_7", "a_6"]
    assert re.search(r"the typical magnitude \(\d+ more are far off\): ", far)
