"""Loads that a user can apply: physics of the wrenches, and errors of the file."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.planning.loads_file import read_loads

GRAVITY = np.array([0.0, 0.0, -9.81])
TURNS = Rotation.random(20, random_state=1).as_matrix()

WEIGHT = "{kind: weight, name: brass, mass_kg: 0.1, point_mm: [20, 0, -18], change_s: 15}"
GRIPPER = (
    "{kind: actuator, name: gripper, frame: wrist_platform, point_mm: [0, 0, -18], change_s: 1, "
    "force_min_N: [-1, 0, 0], force_max_N: [1, 0, 2], "
    "moment_min_Nm: [0, 0, 0], moment_max_Nm: [0, 0, 0.01]}"
)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def read(tmp_path, *entries, schema=1):
    path = tmp_path / "loads.yaml"
    lines = "\n".join(f"  - {entry}" for entry in entries) or "  []"
    path.write_text(f"schema: {schema}\nloads:\n{lines}\n")
    return read_loads(path, GRAVITY, 5.0)


def test_a_weight_pulls_along_gravity_whatever_the_pose(tmp_path, rng):
    (weight,) = read(tmp_path, WEIGHT)
    wrench = weight.draw(GRAVITY, rng).wrench(TURNS)
    assert np.allclose(wrench[:, :3], 0.1 * GRAVITY)
    # The work of gravity: a moment is minus the gradient of m g h over the turn.
    point = TURNS @ np.array([0.02, 0.0, -0.018])
    assert np.allclose(wrench[:, 3:], np.cross(point, 0.1 * GRAVITY))
    axis, step = np.array([0.6, -0.64, 0.48]), 1e-6
    turned = Rotation.from_rotvec(step * axis).as_matrix() @ TURNS
    lost = -0.1 * (turned @ [0.02, 0.0, -0.018] - point) @ GRAVITY / step
    assert np.allclose(wrench[:, 3:] @ axis, -lost, atol=1e-7)


@pytest.mark.parametrize("frame", ["wrist_platform", "wrist_base"])
def test_an_actuator_turns_with_its_frame_and_keeps_its_limits(tmp_path, rng, frame):
    (gripper,) = read(tmp_path, GRIPPER.replace("wrist_platform", frame))
    lever = np.array([0.0, 0.0, -0.018])
    for _ in range(50):
        wrench = gripper.draw(GRAVITY, rng).wrench(TURNS)
        if frame == "wrist_platform":
            wrench = np.concatenate(
                [np.einsum("nji,nj->ni", TURNS, part) for part in np.hsplit(wrench, 2)], axis=1
            )
        assert np.allclose(wrench, wrench[0])
        force, moment = wrench[0, :3], wrench[0, 3:] - np.cross(lever, wrench[0, :3])
        assert np.all(force >= [-1.0 - 1e-12, -1e-12, -1e-12])
        assert np.all(force <= [1.0 + 1e-12, 1e-12, 2.0 + 1e-12])
        assert -1e-12 <= moment[2] <= 0.01 + 1e-12
        assert np.allclose(moment[:2], 0.0)


def test_draws_reach_the_ends_of_the_range(tmp_path, rng):
    (gripper,) = read(tmp_path, GRIPPER)
    drawn = np.array([gripper.draw(GRAVITY, rng).force for _ in range(200)])
    assert drawn[:, 0].min() == -1.0
    assert drawn[:, 0].max() == 1.0
    assert drawn[:, 2].max() == 2.0


def test_no_loads_is_a_list_of_none(tmp_path):
    assert read(tmp_path) == ()


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([WEIGHT.replace("0.1", "-0.1")], "loads[0].mass_kg: -0.1 is not above 0"),
        ([WEIGHT.replace("0.1", "0.8")], "loads[0].mass_kg: 0.8 weighs 7.85 N, the table ends at"),
        ([WEIGHT.replace("change_s", "change_min")], "loads[0]: change_s is missing"),
        ([WEIGHT, WEIGHT], "loads[1].name: 'brass' is there twice"),
        (
            [WEIGHT.replace("weight", "wait")],
            "loads[0].kind: 'wait' is not one of weight, actuator",
        ),
        ([WEIGHT.replace("brass", "' '")], "loads[0].name: is empty"),
        ([WEIGHT.replace("}", ", colour: red}")], "loads[0]: unknown key colour"),
        ([WEIGHT.replace("[20, 0, -18]", "[20, 0]")], "loads[0].point_mm"),
        (
            [GRIPPER.replace("[-1, 0, 0]", "[2, 0, 0]")],
            "loads[0].force_min_N: [2.0, 0.0, 0.0] exceeds",
        ),
        (
            [GRIPPER.replace("[1, 0, 2]", "[1, 0, 9]")],
            "loads[0]: 9 N is beyond the table's 5 N",
        ),
        (
            [
                GRIPPER.replace("[-1, 0, 0]", "[0, 0, 0]")
                .replace("[1, 0, 2]", "[0, 0, 0]")
                .replace("[0, 0, 0.01]", "[0, 0, 0]")
            ],
            "gripper can apply neither a force nor a moment",
        ),
        ([GRIPPER.replace("wrist_platform", "tool0")], "loads[0].frame: 'tool0' is not one of"),
    ],
)
def test_errors_name_place_value_and_limit(tmp_path, entries, words):
    with pytest.raises(InputError) as error:
        read(tmp_path, *entries)
    assert words in str(error.value)


def test_other_schema_and_other_shapes_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"schema: 2 is not 1"):
        read(tmp_path, schema=2)
    path = tmp_path / "loads.yaml"
    path.write_text("schema: 1\nloads: none\n")
    with pytest.raises(InputError, match=r"loads: 'none' is not a list"):
        read_loads(path, GRAVITY, 5.0)
