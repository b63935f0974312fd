"""Where the correction fades: at the border of the domain and near a singular pose."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.safety import SafetySettings, guard_weight
from wrist_stiffness.mechanism.workspace import Workspace

SETTINGS = SafetySettings(domain_fade=np.radians(2.0), singularity_fade=0.05)
LIMIT = 0.6


@pytest.fixture(scope="module")
def workspace(table):
    """A wrist whose poses count as singular long before the border of the motor rectangle."""
    return Workspace(table.mechanism, replace(table.geometry.limits, singularity=LIMIT))


def poses_at(workspace, determinant):
    """Return configurations with this |D|, in eight directions from home."""
    found = []
    for azimuth in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        near, far = 0.0, 1.6
        direction = np.array([np.cos(azimuth), np.sin(azimuth)])
        for _ in range(60):
            middle = 0.5 * (near + far)
            pose = workspace.mechanism.forward(middle * direction)
            larger = abs(float(pose.singularity)) > determinant
            near, far = (middle, far) if larger else (near, middle)
        lower, upper = workspace.rectangle
        inside = np.minimum(pose.theta - lower, upper - pose.theta).min() > SETTINGS.domain_fade
        if inside and abs(pose.singularity) == pytest.approx(determinant):
            found.append(pose)
    assert len(found) >= 2
    return found


@pytest.mark.parametrize(
    ("above", "weight"),
    [(0.0, 0.0), (0.0125, 0.15625), (0.025, 0.5), (0.0375, 0.84375), (0.05, 1.0), (0.06, 1.0)],
)
def test_the_correction_fades_smoothly_towards_a_singular_pose(workspace, above, weight):
    for pose in poses_at(workspace, LIMIT + above):
        assert guard_weight(workspace, pose, SETTINGS) == pytest.approx(weight, abs=1e-6)


@pytest.mark.parametrize("motor", [0, 1])
@pytest.mark.parametrize("side", [0, 1])
def test_the_correction_fades_smoothly_towards_each_border(table, motor, side):
    border = table.workspace.rectangle[side][motor]
    inward = 1.0 if side == 0 else -1.0
    for degrees, weight in ((0.0, 0.0), (0.5, 0.15625), (1.0, 0.5), (2.0, 1.0), (9.0, 1.0)):
        theta = np.zeros(2)
        theta[motor] = border + inward * np.radians(degrees)
        pose = table.mechanism.forward(theta)
        assert guard_weight(table.workspace, pose, SETTINGS) == pytest.approx(weight, abs=1e-9)


def test_of_two_guards_the_stricter_one_counts(workspace):
    """Half way to a singular pose, on a border that lies half way, too: not a quarter."""
    (pose, *_) = poses_at(workspace, LIMIT + 0.025)
    lower, upper = workspace.rectangle
    distance = np.minimum(pose.theta - lower, upper - pose.theta).min()
    near = replace(SETTINGS, domain_fade=2.0 * float(distance))
    assert guard_weight(workspace, pose, near) == pytest.approx(0.5, abs=1e-6)
