"""Wrists that nobody calibrated, on links of other angles."""

import copy

import numpy as np
import pytest
import yaml
from changed_geometry import LAYERS, checked
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import Disturbance, solve_pose

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.fem.condensed_store import CondensedStore
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.sweep import BuildSettings, build_table
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.shipped import shipped_file

SHIPPED = yaml.safe_load(shipped_file("config/palmieri2015.yaml").read_text())
JOINTS = ("joint_1", "joint_2", "joint_3", "joint_4", "joint_5")
COARSE = BuildSettings(
    sizes=MeshSettings(
        link=6e-3, bore=3e-3, bushing=1.5e-3, bushing_corner=0.6e-3, bushing_arc=4e-3
    ),
    tolerance=1.0,
    per_axis=5,
)
AGREEMENT = 1e-6
"""Of twists; what is left is the rounding of two solvers."""

LOAD = np.array([1.0, -2.0, 1.5, 0.02, 0.01, -0.03])


def wrist(arcs, motors=90.0, askew=0.0, tilt=20.0):
    """The shipped sections on other axes: arcs of the links, angles of the motors [deg]."""
    one, two, three = np.radians(arcs)
    motors, askew = np.radians([motors, askew])
    first, second = np.array([1.0, 0.0, 0.0]), np.array([np.cos(motors), np.sin(motors), 0.0])
    b = np.cos(one) * first + np.sin(one) * np.array([0.0, np.cos(askew), np.sin(askew)])
    d = np.cos(two) * second + np.sin(two) * np.array([0.0, 0.0, 1.0])
    # Away from the root of link_1, into which the pin of joint_3 would run.
    away = (first @ d) * d - first
    c = np.cos(three) * d + np.sin(three) * away / np.linalg.norm(away)
    values = copy.deepcopy(SHIPPED)
    for joint, axis in zip(JOINTS, (first, b, c, d, second), strict=True):
        values["axes"][joint] = axis.tolist()
        bushing = values["bushings"][joint]
        bushing["radius_mm"] = abs(bushing["radius_mm"])
    values["limits"] |= {"operative_tilt_deg": tilt, "map_margin": 1.1}
    return values


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return CondensedStore(tmp_path_factory.mktemp("parts"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arcs", "motors", "askew", "layered"),
    [
        ((60.0, 60.0, 60.0), 90.0, 0.0, ()),
        ((75.0, 75.0, 75.0), 75.0, 40.0, ()),
        ((90.0, 90.0, 90.0), 120.0, -20.0, ()),
        ((105.0, 105.0, 105.0), 60.0, 20.0, ()),
        ((120.0, 120.0, 120.0), 90.0, 0.0, ()),
        ((60.0, 90.0, 120.0), 120.0, -20.0, ()),
        ((105.0, 75.0, 90.0), 60.0, 20.0, (("links", "link_2"), ("bushings", "joint_3"))),
    ],
)
def test_other_links_and_axes_are_built(store, arcs, motors, askew, layered):
    values = wrist(arcs, motors, askew)
    values["materials"]["layers"] = LAYERS
    for group, part in layered:
        values[group][part]["material"] = "layers"
    geometry = checked(values)
    table = build_table(values, COARSE, condenser=store)
    poses = table.workspace.grid(5)
    assert len(poses) >= 20
    found = table.operators_at(table.mechanism.forward(poses), "closed_form").compliance
    size = np.sqrt(np.einsum("nii,njj->nij", found, found))
    np.testing.assert_allclose(found / size, np.swapaxes(found / size, 1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(found / size).min() > 0.0
    # By virtual work of the whole wrist, which knows no condensed part and no influence.
    pose = table.mechanism.forward(poses[1])
    operators = table.operators_at(pose, "closed_form")
    whole = factor_pose(build_wrist(geometry, COARSE.sizes), pose)
    exact = solve_pose(whole, LOAD, Disturbance(gravity=geometry.gravity)).twist
    twist = respond(operators, LOAD).twist
    for half in (slice(0, 3), slice(3, 6)):
        miss = np.linalg.norm((twist - exact)[half])
        assert miss < AGREEMENT * np.linalg.norm(exact[half])


@pytest.mark.parametrize(
    ("arc", "tilt", "message"),
    [
        (60.0, 80.0, "operative_tilt_deg: 80 is not reached in every direction"),
        (179.0, 20.0, "operative_tilt_deg: 20 is not reached in every direction"),
        (30.0, 20.0, "joint_1.radius_mm: 53.01 leaves .* bend more than link_1"),
    ],
)
def test_what_cannot_be_built_is_refused(arc, tilt, message):
    with pytest.raises(GeometryError, match=message):
        checked(wrist((arc, 90.0, 90.0), tilt=tilt))


def test_a_link_that_runs_into_a_pin_is_named_with_its_pose():
    values = wrist((90.0, 60.0, 60.0), 60.0, 30.0, tilt=35.0)
    values["limits"] |= {"joint_lower_deg": [-170.0] * 2, "joint_upper_deg": [170.0] * 2}
    message = r"the pin of joint_3 and link_1 are in one place at motor angles \(89.857, -11.091\)"
    with pytest.raises(GeometryError, match=message):
        checked(values)
