"""The uncertainty that `explain` states, against the Jacobian."""

import numpy as np
import pytest

from wrist_stiffness.commands.explain import explain
from wrist_stiffness.model.block import Load
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.shipped import shipped_file

POSE = np.radians([20.0, -10.0])
SIGMA_MDEG = 20.0


def test_an_uncertain_encoder_makes_its_row_and_the_whole_uncertain(tmp_path):
    plain = load_model(shipped_file("config/palmieri2015_model.yaml"))
    offset = {"offset_mdeg": Estimate(30.0, SIGMA_MDEG)}
    effect = Effect(find_law("encoder_offset"), "motor_1", offset)
    save_model(plain.with_effects(effect), tmp_path / "m.yaml")
    found = explain(tmp_path / "m.yaml", POSE, Load(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])))
    (row,) = (row for row in found.rows if row.kind == "effect")
    column = plain.table.mechanism.jacobian(plain.table.mechanism.forward(POSE))[:, 0]
    about = found.total[3:] / np.linalg.norm(found.total[3:])
    wanted = abs(about @ column) * np.radians(1e-3 * SIGMA_MDEG)
    assert row.sigma == pytest.approx([0.0, wanted], rel=1e-6)
    # The table's error and the encoder step come on top, in squares.
    configuration = plain.table.mechanism.forward(POSE)
    table = about @ plain.table_covariance(configuration, found.total)[3:, 3:] @ about
    assert found.sigma[1] == pytest.approx(np.sqrt(wanted**2 + table), rel=1e-6)
