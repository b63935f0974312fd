"""A part's own 6 x 6 stiffness: read in any frame, refused where it is none."""

import copy

import numpy as np
import pytest
import yaml

from wrist_stiffness.errors import GeometryError
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.geometry_file import geometry_from_values
from wrist_stiffness.mechanism.own_stiffness import in_millimetres
from wrist_stiffness.mechanism.vectors import block_diagonal, skew
from wrist_stiffness.shipped import shipped_file

VALUES = yaml.safe_load(shipped_file("config/palmieri2015.yaml").read_text())
READ = 1e-9
"""Of a flexibility that was inverted, typed and inverted again."""


@pytest.fixture(scope="module")
def shipped():
    flexibility = load_table(shipped_file("precomputed/palmieri2015.npz")).components.flexibility
    return dict(zip(ELASTIC, flexibility, strict=True))


HOME = np.zeros(3), np.eye(3)


def typed(flexibility, frame=HOME):
    """The block of a geometry file, in a frame of its own."""
    origin, axes = frame
    move = np.eye(6)
    move[:3, 3:] = -skew(origin)
    at_frame = block_diagonal(axes.T) @ move
    stiffness = in_millimetres(np.linalg.inv(at_frame @ flexibility @ at_frame.T))
    stiffness = (stiffness + stiffness.T) / 2.0
    block = {"matrix_N_mm": stiffness.tolist()}
    if origin.any():
        block |= {"origin_mm": (1e3 * origin).tolist()}
        block |= {"x": axes[:, 0].tolist(), "y": axes[:, 1].tolist()}
    return block


def read(part, block):
    values = copy.deepcopy(VALUES)
    group = "links" if part.startswith("link") else "bushings"
    values[group][part]["stiffness"] = block
    parts = getattr(geometry_from_values(values), group)
    return parts[part].stiffness.flexibility


@pytest.mark.parametrize("part", ["link_1", "link_2", "link_3", "joint_1", "joint_5"])
def test_a_part_given_back_is_that_part_in_any_frame(shipped, part):
    wanted = shipped[part]
    axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    axes[:, 2] *= np.linalg.det(axes)
    for block in (typed(wanted), typed(wanted, (np.array([31e-3, -8e-3, 12e-3]), axes))):
        found = read(part, block)
        size = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
        assert np.abs((found - wanted) / size).max() < READ


def test_a_bearing_that_spins_freely_is_no_softer_across(shipped):
    """Neither thrust nor torque passes: nothing along and about the axis, the rest as before."""
    firm = np.array([0, 1, 3, 4])
    axes = geometry_from_values(VALUES).axes["joint_1"]
    across = np.linalg.svd(axes[None])[2][[1, 2, 0]].T
    stiffness = np.zeros((6, 6))
    stiffness[np.ix_(firm, firm)] = np.diag([2e4, 3e4, 4e6, 5e6])
    wrench = block_diagonal(across) @ stiffness @ block_diagonal(across).T
    found = block_diagonal(across).T @ read("joint_1", {"matrix_N_mm": wrench.tolist()})
    found = found @ block_diagonal(across)
    expected = np.zeros(6)
    expected[firm] = [1 / 2e7, 1 / 3e7, 1 / 4e3, 1 / 5e3]
    np.testing.assert_allclose(found, np.diag(expected), atol=1e-9 * expected.max())


def test_a_pair_of_bearings_is_its_balls():
    """Each ball a spring along its line of contact, at its place on the pitch circle."""
    ball, contact, pitch, apart, count = 4e6, np.radians(25.0), 9e-3, 11e-3, 7
    geometry = geometry_from_values(VALUES)
    axis = geometry.axes["joint_5"]
    across = np.linalg.svd(axis[None])[2][1:]
    stiffness = np.zeros((6, 6))
    # Back to back: the lines of contact lean outwards, so pressure centres are farther apart.
    for side in (1.0, -1.0):
        for turn in 2.0 * np.pi / count * np.arange(count):
            outwards = np.cos(turn) * across[0] + np.sin(turn) * across[1]
            line = np.cos(contact) * outwards - side * np.sin(contact) * axis
            place = (geometry.bushings["joint_5"].radius + side * apart / 2.0) * axis
            wrench = np.concatenate([line, np.cross(place + pitch * outwards, line)])
            stiffness += ball * np.outer(wrench, wrench)
    pair = {
        "radial_N_um": 1e-6 * count * ball * np.cos(contact) ** 2 / 2.0,
        "axial_N_um": 1e-6 * count * ball * np.sin(contact) ** 2,
        "distance_mm": 1e3 * (apart + 2.0 * pitch * np.tan(contact)),
    }
    found = read("joint_5", {"bearings": pair})
    # The free turn about the axis, which passes through O, has neither stiffness nor flexibility.
    expected = np.linalg.pinv(stiffness, rcond=1e-12, hermitian=True)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / size).max() < READ


@pytest.mark.parametrize(
    ("joint", "change", "message"),
    [
        ("joint_1", {"radial_N_um": 0.0}, "radial_N_um: 0.0 is not above 0"),
        ("joint_1", {"axial_N_um": None}, "bearings.axial_N_um: None is not a finite"),
        ("joint_2", {}, "joint_2.stiffness: is for a joint without flanges"),
    ],
)
def test_bearings_that_cannot_be_are_refused(joint, change, message):
    pair = {"radial_N_um": 20.0, "axial_N_um": 8.0, "distance_mm": 12.0}
    with pytest.raises(GeometryError, match=message):
        read(joint, {"bearings": pair | change})


@pytest.mark.parametrize(
    ("part", "change", "message"),
    [
        ("link_1", lambda k: k.__setitem__((0, 4), 2.0 * k[0, 4]), r"not symmetric: .*row"),
        ("link_1", lambda k: k.__imul__(-1.0), r"not positive: .* least eigenvalue"),
        ("link_1", lambda k: k.__setitem__(slice(3, None), 0.0), r"not symmetric"),
        ("link_1", lambda k: k.__imul__(np.outer(*[np.arange(6) > 0] * 2)), r"holds nothing .*5"),
        ("joint_1", lambda k: k.__imul__(np.outer(*[np.arange(6) != 1] * 2)), r"across its joint"),
        ("joint_3", lambda k: None, r"joint_3.stiffness: is for a joint without flanges"),
    ],
)
def test_what_is_no_stiffness_is_refused(shipped, part, change, message):
    block = typed(shipped[part])
    matrix = np.array(block["matrix_N_mm"])
    change(matrix)
    with pytest.raises(GeometryError, match=message):
        read(part, block | {"matrix_N_mm": matrix.tolist()})
