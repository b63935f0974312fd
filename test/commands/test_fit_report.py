"""What a fit tells a technician."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.identification.base_fit import fit_cleaned
from wrist_stiffness.identification.calibration import fitted
from wrist_stiffness.identification.free_effects import free_all
from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.inference import Quantity
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.report.fit_lines import (
    left_line,
    told_lines,
    tolerances,
    uncertainty_line,
    untold_lines,
    used_lines,
)
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.shipped import shipped_file


def test_what_is_not_told_stands_under_what_to_record():
    """A coarse instrument without load sees no stiffness, but a zero of an encoder."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    rng = np.random.default_rng(1)
    block = Block(2.0 * np.arange(30), rng.uniform(-0.5, 0.5, (30, 2)), np.zeros((30, 6)))
    bent, shift = exp_twist(model.batch(block).measured)
    rotation = bent @ model.table.mechanism.forward(block.theta).platform
    noise = np.repeat([1e-4, 1e-3], 3)
    session = MeasuredSession("s", block, shift, rotation, np.diag(noise**2))
    places = (
        *(("link_stiffness", f"link_{i}") for i in (1, 2, 3)),
        ("load_scale", "load_sensor"),
        ("encoder_offset", "motor_1"),
    )
    free = tuple(free_all(Effect(find_law(law), place)) for law, place in places)
    found = fitted(*fit_cleaned(FitProblem(model, (as_units(model, session),), free)))
    lines = untold_lines(found, found.parameters)
    assert lines == [
        f"  link_stiffness (3 places): record {find_law('link_stiffness').excited_by}",
        f"  load_scale@load_sensor: record {find_law('load_scale').excited_by}",
        "  which parameters, and which only in combination: --json",
    ]
    (line,) = told_lines(found.parameters)
    assert line.split()[:2] == ["encoder_offset@motor_1", "offset_mdeg"]
    # A gap is usual where shims follow the axes, and -36 um of it no more than that.
    shimmed = replace(found.parameters[-1], value=-36.0, prior=-35.0, usual=10.0)
    assert tolerances(shimmed) == "0.1 x the typical magnitude from -35"
    assert tolerances(replace(shimmed, prior=0.0)) == "3.6 x the typical magnitude"


def test_rests_that_nothing_measured_are_not_counted():
    """They tell the way between two poses, and motion is what is left of the units."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    block = Block(2.0 * np.arange(30), np.linspace([-0.5, 0.3], [0.5, -0.2], 30), np.zeros((30, 6)))
    rotation = np.array(model.table.mechanism.forward(block.theta).platform)
    shift = np.zeros((30, 3))
    shift[1::2], rotation[1::2] = np.nan, np.nan
    session = MeasuredSession("s", block, shift, rotation, np.diag(np.repeat([1e-6, 1e-5], 3) ** 2))
    free = (free_all(Effect(find_law("encoder_offset"), "motor_1")),)
    found = fitted(*fit_cleaned(FitProblem(model, (as_units(model, session),), free)))
    assert used_lines([session], found)[0].startswith("s: 15 dwells and 0 half seconds in motion")


@pytest.mark.parametrize(
    ("unseen", "said"),
    [(0.9, "the unseen part shows none of it"), (1.1, "an effect is missing ('wrist-stiffness ")],
)
def test_an_effect_is_missing_only_where_the_unseen_part_is_above_the_noise(unseen, said):
    """Errors of data not seen and of the fit to all stand together: the line says of which."""
    table = SimpleNamespace(reported=[Quantity("s", "um", (0, 1, 2), 1e6)])
    fit = SimpleNamespace(
        rough=True,
        noise={"s_um": 1.0},
        discrepancy={"s_um": 3.5},
        problem=SimpleNamespace(table=table),
    )
    line = left_line(fit, {"s_um": unseen}, 1)
    begin = "in the fit to the whole session 3.5 um of s remain above the noise"
    assert line.startswith(f"{begin}: {said}")


def test_what_was_not_measured_has_no_uncertainty():
    """A gauge on z tells no rotation; that one was known to 0 mdeg."""
    sigma = np.array([0.0, 0.0, 1e-6, 0.0, 0.0, 0.0])
    line = uncertainty_line(JointUncertainty((), sigma, 25.0 * sigma))
    assert "1 um for the instrument" in line
    assert "25 um in the wrist's own frame" in line
    assert "mdeg" not in line
