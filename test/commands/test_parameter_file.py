"""A node's parameter file serves a replay without ROS."""

import numpy as np
import pytest

from wrist_stiffness.commands.parameter_file import node_settings, not_meant
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
        (
            "ros__parameters: {load_p",
            "parameters: {load_p",
            "load_policy: is not below .* ros__par",
        ),
        (FILE, "- a list", "is not below the name of a node"),
        (FILE, "schema: 1\neffects: []", "schema: is not below .*ros__parameters"),
        (FILE, "ros__parameters: {load_policy: follow}", "is not below the name of a node"),
        ("anything: 1}", "anything: 1}\n  left: {}", "cell_simulator: unknown key left"),
        (FILE, "a: [", "not a YAML file"),
    ],
)
def test_bad_parameter_files_are_one_line(tmp_path, old, new, text):
    with pytest.raises(InputError, match=text) as caught:
        node_settings(write(tmp_path, FILE.replace(old, new)))
    assert "\n" not in str(caught.value)


def corrector_of(folder, text):
    return node_settings(write(folder, text))[1]


@pytest.mark.parametrize(
    "name",
    [
        "angle_corrector",
        "/angle_corrector",
        "/left/angle_corrector",
        "left/angle_corrector",
        "/**/angle_corrector",
        '"**/angle_corrector"',
        "/*/angle_corrector",
        "/**/left/angle_corrector",
        "/left/**",
        "/left/*",
        '"*"',
        '"**"',
        "left:\n  angle_corrector",
        "/:\n  angle_corrector",
        "/**:\n  angle_corrector",
        'left:\n  "*"',
    ],
)
def test_names_of_nodes_are_those_of_ros(tmp_path, name):
    depth = "    " if "\n" in name else "  "
    text = f"{name}:\n{depth}ros__parameters: {{load_policy: follow}}\n"
    assert corrector_of(tmp_path, text).supervisor.follow


@pytest.mark.parametrize("name", ["/left/model_monitor", "angle", "/**/angle_corrector/left", "x*"])
def test_what_other_nodes_are_told_is_left_unread(tmp_path, name):
    corrector = corrector_of(tmp_path, f"{name}:\n  ros__parameters: {{anything: 1}}\n")
    assert corrector == StreamSettings()


def told(name, **values):
    return f"{name}:\n  ros__parameters: {values}\n"


def test_the_nodes_of_one_namespace_hear_what_all_are_told(tmp_path):
    text = told("/**", load_age_limit_s=2.0) + told(
        "/left/angle_corrector", objective="orientation"
    )
    corrector = corrector_of(tmp_path, text)
    assert (corrector.load_age_limit_s, corrector.objective) == (2.0, "orientation")


def test_what_stands_further_down_counts(tmp_path):
    own, every = told("angle_corrector", slew_deg_s=1.0), told("/**", slew_deg_s=2.0)
    first, second = corrector_of(tmp_path, own + every), corrector_of(tmp_path, every + own)
    assert first.safety.slew == pytest.approx(2.0 * second.safety.slew)


def test_two_wrists_in_one_file_must_say_the_same(tmp_path):
    left = told("/left/angle_corrector", slew_deg_s=1.0)
    same = left + told("right/angle_corrector", slew_deg_s=1.0)
    assert corrector_of(tmp_path, same) == corrector_of(tmp_path, left)
    for other in ("/right/angle_corrector", "/angle_corrector", "/right/pose_error_predictor"):
        text = left + told(other, load_age_limit_s=2.0) + told("/far/cell_simulator", x=1)
        space = other.rpartition("/")[0] or "/"
        with pytest.raises(InputError, match=f"({space} and /left|/left and {space}) give the n"):
            node_settings(write(tmp_path, text))


def test_a_name_without_the_namespace_of_the_nodes_is_told(tmp_path):
    path = write(tmp_path, FILE)
    nodes = ["/a/pose_error_predictor", "/a/angle_corrector"]
    (told,) = not_meant(path, nodes)
    assert f"{path}: /angle_corrector is not for /a/angle_corrector" in told
    assert not_meant(path, ["/pose_error_predictor", "/angle_corrector"]) == []
    meant = write(tmp_path, FILE.replace("angle_corrector:", "/**/angle_corrector:"))
    assert not_meant(meant, nodes) == []
