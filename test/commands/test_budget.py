"""Error budget and pictures of a load: any direction, any place."""

import numpy as np
import pytest
from matplotlib.image import imread

from wrist_stiffness.commands.budget import Push, budget
from wrist_stiffness.errors import LoadRangeError
from wrist_stiffness.report.pictures.bent_wrist import bent_shapes
from wrist_stiffness.report.pictures.table import draw_maps


def test_rated_budget_is_the_paper_map(table):
    found = budget(table, Push.rated(table), per_axis=9)
    # Through the readout points and the spline against the twist itself.
    mapped = table.map_spline(found.theta)[found.operative]
    shift = np.linalg.norm(found.twist[found.operative, :3], axis=1)
    assert np.allclose(mapped[:, 3], shift, rtol=0.01)


def test_shares_are_parts_of_one(table):
    found = budget(table, Push.of_millimetres([0.3, 1.0, -0.5], [10.0, 0.0, -18.0]), per_axis=7)
    assert np.all(found.shares >= 0.0)
    assert np.allclose(found.shares.sum(axis=1), 1.0, atol=1e-12)


def test_a_force_at_a_point_is_a_wrench_at_the_centre(table):
    """Virtual work: the force's work on the point is the wrench's work on the twist."""
    push = Push.of_millimetres([0.3, 1.0, -0.5, 0.01, 0.0, 0.02], [10.0, -5.0, -18.0])
    turn = table.mechanism.forward(np.array([0.3, -0.2])).platform
    twist = np.array([1e-6, 2e-6, -3e-6, 1e-4, -2e-4, 3e-4])
    moved = twist[:3] + np.cross(twist[3:], turn @ push.point)
    work = push.force @ moved + push.moment @ twist[3:]
    assert push.wrench(turn) @ twist == pytest.approx(work, rel=1e-12)


def test_bent_wrist_moves_with_its_frames(table):
    theta = np.array([0.3, -0.2])
    push = Push.rated(table)
    shapes = bent_shapes(table, theta, push)
    assert len(shapes) == 3 + 5 + 1
    found = budget(table, push, per_axis=3)
    assert found.twist.shape[1] == 6
    plate = shapes[-1]
    # A rigid plate: its points keep their distances to first order.
    points, shift = plate.points.reshape(-1, 3), plate.shift.reshape(-1, 3)
    apart, drift = points[:, None] - points[None], shift[:, None] - shift[None]
    stretch = np.einsum("ijk,ijk->ij", apart, drift)
    assert np.max(np.abs(stretch)) < 1e-15
    # The bushings of the motors sit in the frame: their outer walls rest, their pins move.
    largest = max(np.max(np.linalg.norm(shape.shift, axis=-1)) for shape in shapes)
    assert 1e-8 < largest < 1e-3


def test_load_out_of_range_draws_nothing(table, tmp_path):
    with pytest.raises(LoadRangeError, match="20 N"):
        draw_maps(table, tmp_path, Push.of_millimetres([0.0, 20.0, 0.0], [0.0, 0.0, 0.0]))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_five_pictures_that_show_something(table, tmp_path):
    pictures = draw_maps(table, tmp_path, Push.of_millimetres([0.0, 2.0, 0.0], [20.0, 0.0, -18.0]))
    assert [path.name for path in pictures] == [
        "map_s.png",
        "map_phi.png",
        "budget.png",
        "bent.png",
        "uncertainty.png",
    ]
    for path in pictures:
        colours = np.round(10.0 * imread(path)[..., :3]).astype(int)
        if path.name == "uncertainty.png":
            # Bars of few colours: some are none of the greys of text and axes.
            assert np.ptp(colours, axis=-1).max() > 3
        else:
            assert len(np.unique(colours @ [121, 11, 1])) > 20
