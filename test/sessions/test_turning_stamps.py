"""Where angles and load turned back tells the way between poses far apart."""

import numpy as np

from wrist_stiffness.commands.export_csv import export_csv
from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.sessions.observing import tabulate
from wrist_stiffness.sessions.reading.session import read_session, turning_stamps
from wrist_stiffness.sessions.reading.signals import Signal
from wrist_stiffness.sessions.unit_session import all_units
from wrist_stiffness.shipped import shipped_file

SECOND = 1_000_000_000
TIME_NS = np.arange(0, 4 * SECOND, SECOND // 100)


def swinging(size):
    """One swing to either side between the poses at 0.5 and 3.5 s: up at 1.5 s, down at 2.5 s."""
    t = 1e-9 * TIME_NS
    inside = (t >= 1.0) & (t <= 3.0)
    return Signal(TIME_NS, (size * np.where(inside, np.sin(np.pi * (t - 1.0)), 0.0))[:, None])


POSES_NS = np.array([SECOND // 2, 7 * SECOND // 2])


def test_both_extremes_of_a_gap_are_told():
    found = turning_stamps(swinging(1.0), POSES_NS, np.array([0.3]))
    np.testing.assert_array_equal(found, [3 * SECOND // 2, 5 * SECOND // 2])


def test_a_swing_below_the_least_is_no_turn():
    assert len(turning_stamps(swinging(0.2), POSES_NS, np.array([0.3]))) == 0


def test_poses_close_together_tell_the_way_themselves():
    close = np.arange(0, 4 * SECOND, SECOND // 10)
    assert len(turning_stamps(swinging(1.0), close, np.array([0.3]))) == 0


def test_each_pose_measured_at_rest_is_a_unit_and_knows_its_approach(tmp_path, campaign, table):
    """Motor 1 goes to 10 deg and back each time: straight to even poses, beyond to odd ones.

    10 deg     __      /\\__     __      /\\__
              /  \\    /    \\   /  \\    /
     0 deg __/    \\__/      \\_/    \\__/        a pose every 1.6 s, at rest
    """

    def theta(time_ns):
        t = 2.5e-9 * (np.asarray(time_ns) - campaign.joint_ns[0])
        number, phase = np.floor(t / 4.0), np.mod(t, 4.0)
        beyond = np.where(number % 2 == 1, 12.0, 10.0)
        angle = np.interp(phase, [0.0, 1.0], [0.0, 1.0]) * beyond
        angle = np.where(phase > 1.0, np.interp(phase, [1.0, 1.2], [0.0, 1.0]), 0.0) * (
            10.0 - beyond
        ) + np.where(phase > 1.0, beyond, angle)
        angle = np.where(phase > 2.5, 10.0 * np.interp(phase, [2.5, 3.5], [1.0, 0.0]), angle)
        return np.radians(np.stack([angle, np.zeros_like(angle)], axis=-1))

    campaign.theta, campaign.count = theta, 1280
    stamps = campaign.joint_ns[70::160]
    campaign.with_joints().with_loads(force=lambda i: (0.0, 0.0, -1.0)).with_poses(stamps=stamps)
    path = campaign.written(tmp_path / "bag")
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    observed = tabulate(model, all_units(model, [read_session(path, table)])).observations
    assert len(observed.values) == 8
    np.testing.assert_array_equal(observed.covariates["approach_1"], [1, -1] * 4)

    # The table of the measured poses says so as well: it is what people edit and import again.
    exported = export_csv(path, tmp_path / "poses.csv", table)
    assert (exported.rows, exported.turns > 0) == (8, True)
    import_csv(tmp_path / "poses.csv", tmp_path / "again")
    again = tabulate(
        model, all_units(model, [read_session(tmp_path / "again", table)])
    ).observations
    np.testing.assert_array_equal(again.covariates["approach_1"], [1, -1] * 4)
    export_csv(tmp_path / "again", tmp_path / "twice.csv", table)
    assert (tmp_path / "twice.csv").read_bytes() == (tmp_path / "poses.csv").read_bytes()
