"""A node's parameter file serves a replay without ROS."""

import numpy as np
import pytest

from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError

FILE = """
/**:
  ros__parameters:
    load_age_limit_s: 2
    frames: "{ft: {parent: wrist_platform, position_mm: [0, 0, 40], acts_on: environment}}"
angle_corrector:
  ros__parameters: {load_policy: follow, slew_deg_s: 1.0, objective: orientation}
cell_simulator:
  ros__parameters: {anything: 1}
"""


def write(folder, text):
    path = folder / "parameters.yaml"
    path.write_text(text)
    return path


def test_defaults_are_the_nodes_defaults():
    prediction, correction = node_settings(None)
    assert correction == StreamSettings()
    assert prediction == StreamSettings()


def test_every_node_then_this_one_then_the_command(tmp_path):
    prediction, correction = node_settings(write(tmp_path, FILE), ["a", "b"])
    for settings in (prediction, correction):
        assert settings.load_age_limit_s == 2.0
        assert settings.motors.motor_2 == "b"
        load = settings.frames.load("ft", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
        assert np.array_equal(load.wrench[:3], [0.0, 0.0, -1.0])
        assert load.on_platform
    assert correction.objective == "orientation"
    assert correction.supervisor.follow
    assert not prediction.supervisor.follow


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("slew_deg_s: 1.0", "slew_deg_s: 7000.0", "slew_deg_s: 7000.0 is above 1000"),
        ("slew_deg_s: 1.0", "slew_deg_s: .nan", "slew_deg_s: nan is not a finite number"),
        ("slew_deg_s: 1.0", "slew_deg_s: much", "'much' is not a finite number"),
        ("slew_deg_s: 1.0", "slow_deg_s: 1.0", "unknown key slow_deg_s"),
        ("load_policy: follow", "load_policy: hope", "'hope' is not one of"),
        ("wrist_platform", "gripper", "parent: 'gripper'"),
        ("ros__parameters: {load_p", "parameters: {load_p", "ros__parameters is missing"),
        (FILE, "- a list", "is not a mapping"),
        (FILE, "schema: 1\neffects: []", "no node in it has ros__parameters"),
        (FILE, "a: [", "not a YAML file"),
    ],
)
def test_bad_parameter_files_are_one_line(tmp_path, old, new, text):
    with pytest.raises(InputError, match=text) as caught:
        node_settings(write(tmp_path, FILE.replace(old, new)))
    assert "\n" not in str(caught.value)
