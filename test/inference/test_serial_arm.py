"""A serial arm of six joints with planted faults: all are named, and unseen poses are predicted."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from wrist_stiffness.inference import Observations, Quantity, diagnose

PLANTED = {
    "link_twist@joint_3": (0.011,),
    "bearing_tilt@joint_1": (0.0018,),
    "link_length@joint_2": (-4e-4,),
    "eccentricity_twice@joint_1": (5e-4, 1e-3),
}
"""As large as those that the real one seems to have."""

ROUGH = 2e-4
"""What no law knows: a smooth function of two joints, largest value [m]."""


@pytest.fixture(scope="module")
def robots():
    path = Path(__file__).parents[2] / "bench" / "serial_robots.py"
    spec = importlib.util.spec_from_file_location("serial_robots", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def measured(robots, rng, n, planted=PLANTED):
    """Random poses of the arm with planted faults, and the truth without the tracker's noise."""
    robot = robots.ROBOTS[0]
    angles = {f"joint_{k + 1}": rng.uniform(-1.2, 1.2, n) for k in range(6)}
    table = Observations(
        np.zeros((n, 3)),
        angles,
        covariance=robots.TRACKER**2 * np.eye(3),
        quantities=(Quantity("position", "mm", (0, 1, 2), 1e3),),
    )
    laws = {each.name: each for each in robots.catalogue(robot)}
    truth = sum(laws[name].evaluate(table, ()) @ np.array(size) for name, size in planted.items())
    truth = truth + 1e-3 * robots.base(robot)[0].columns(table).sum(axis=2)
    wave = np.sin(2.5 * angles["joint_4"] + 1.0) * np.cos(2.0 * angles["joint_5"])
    truth = truth + ROUGH * wave[:, None] * np.array([0.3, 1.0, -0.6])
    noise = rng.normal(0.0, robots.TRACKER, (n, 3))
    return table.with_values(truth + noise), truth


def test_planted_faults_are_named_and_unseen_poses_predicted_beside_what_no_law_knows(robots):
    rng = np.random.default_rng(5)
    table, _ = measured(robots, rng, 200)
    robot = robots.ROBOTS[0]
    result = diagnose(table, robots.catalogue(robot), robots.base(robot))
    named = [set(each.names) for each in result.findings]
    for name in PLANTED:
        assert any(name in members for members in named), name
    assert len(named) <= len(PLANTED) + 1
    unseen, truth = measured(robots, rng, 200)
    error = np.linalg.norm(truth - result.predictor.predict(unseen), axis=1).mean()
    assert error < 0.75 * ROUGH
    assert result.discrepancy["position_mm"] > 0.5 * result.noise["position_mm"]
