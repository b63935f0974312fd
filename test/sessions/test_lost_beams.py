"""Lost beams are left out in motion too, and nothing else is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.sessions.in_pieces import rigid_rotation
from wrist_stiffness.sessions.reading.lost_beams import lost_beams, spikes
from wrist_stiffness.sessions.reading.machine_signals import MachineSignals
from wrist_stiffness.sessions.reading.pose_track import MeasuredTrack
from wrist_stiffness.sessions.reading.session import read_session, session_of
from wrist_stiffness.sessions.reading.signals import Signal
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell


def test_spikes_are_left_out_and_counted_but_steps_are_not(tmp_path, campaign, table):
    rng = np.random.default_rng(5)
    shift = 5e-6 * rng.standard_normal((799, 3))
    shift[400:] += 3e-4
    lost = np.array([50, 200, 201, 600])
    shift[lost] += 2e-3
    campaign.with_joints().with_loads().with_poses(shift)
    session = read_session(campaign.written(tmp_path / "bag"), table)
    np.testing.assert_array_equal(np.flatnonzero(~session.measured.any(axis=1)), lost)
    assert "4 of 799 measured poses are lost beams: left out" in session.remarks


@pytest.mark.parametrize("late_ms", [20, 66])
def test_short_fast_moves_that_are_stamped_late_are_no_spikes(tmp_path, late_ms, table):
    """At 10 Hz such a move is four samples between rests of many."""
    late = HiddenEffect("time_delay", "pose_sensor", "plain", 1e-3 * late_ms, 0)
    settings = CellSettings(rate_hz=10.0, hidden=(late,))
    path = tmp_path / "late.mcap"
    simulate_recording(path, table, settings, 120.0, seed=1)
    session = read_session(path, table)
    assert session.measured.all()


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 100.0, 1000.0])
def test_lost_beams_of_a_rotation_are_seen_while_a_count_flickers(rate_hz, table):
    """In dense poses the flicker of a count looks like a fast motion."""
    step, rng = table.geometry.limits.encoder_step, np.random.default_rng(4)
    time = 1.7e9 + np.arange(400) / rate_hz
    # Two stamps so near to each other are the same in seconds.
    time[101] = time[100]
    theta = 0.1 + step * rng.integers(0, 2, (400, 2))
    turn = np.radians(1e-3) * rng.standard_normal((400, 3))
    lost = np.arange(20, 400, 40)
    turn[lost] += np.radians(0.15)
    still = rigid_rotation(table, np.full((400, 2), 0.1))
    rotation = Rotation.from_rotvec(turn).as_matrix() @ still
    found = lost_beams(time, np.zeros((400, 3)), rotation, rigid_rotation(table, theta), step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


MINUTE = 0.01 * np.arange(6000)


def flickering(table):
    """Rigid rotations by counts and measured ones; four seconds at 30 deg/s, 2 ms of jitter."""
    step, rng = table.geometry.limits.encoder_step, np.random.default_rng(6)

    def theta(moment):
        way = np.radians(30.0) * (np.abs((moment % 15.0) - 7.5) - 7.0).clip(max=0.0)
        return np.stack([way, 0.5 * way], axis=1)

    flicker = step * rng.integers(0, 2, (6000, 2))
    rigid = rigid_rotation(table, step * np.round(theta(MINUTE) / step) + flicker)
    return rigid, rigid_rotation(table, theta(MINUTE + 2e-3 * rng.standard_normal(6000)))


def test_a_count_that_flickers_at_rest_does_not_tell_what_jitter_of_stamps_does_in_motion(table):
    """It is as much as a lost beam."""
    rigid, rotation = flickering(table)
    nowhere, step = np.full((6000, 3), np.nan), table.geometry.limits.encoder_step
    assert not lost_beams(1.7e9 + MINUTE, nowhere, rotation, rigid, step).any()


def test_a_count_that_flickers_gives_no_direction_to_what_a_load_turns(table):
    """Across the way of a flicker would be now all of it, now nothing, and much would be usual."""
    rigid, rotation = flickering(table)
    turn = np.radians(0.1) * np.where(MINUTE % 15.0 < 7.5, 1.0, -1.0)[:, None] * [[1.0, 0.0, 0.0]]
    lost = np.flatnonzero(MINUTE % 15.0 < 0.4)[5::10]
    turn[lost] += np.radians([0.0, 0.0, 0.25])
    rotation = Rotation.from_rotvec(turn).as_matrix() @ rotation
    nowhere, step = np.full((6000, 3), np.nan), table.geometry.limits.encoder_step
    found = lost_beams(1.7e9 + MINUTE, nowhere, rotation, rigid, step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


@pytest.fixture(scope="module")
def worked(table):
    """Two minutes of the cell at 10 Hz: the rotations in the cell's frame, moving poses apart."""
    settings = CellSettings(rate_hz=10.0)
    cell = VirtualCell(table, settings, np.random.default_rng(1))
    time = np.arange(1200) / 10.0
    sample = cell.run(time, cell.desired(time))
    rigid = rigid_rotation(table, sample.encoder)
    turned = Rotation.from_matrix(np.swapaxes(rigid[:-1], 1, 2) @ rigid[1:]).magnitude()
    moving = 3 + np.flatnonzero(np.minimum(turned[2:-3], turned[3:-2]) > np.radians(0.5))
    return time, sample, rigid, moving


def test_a_lost_beam_of_a_pointing_sensor_is_found_in_motion(worked, table):
    """0.2 deg, while the wrist turns by more than that from each sample to the next."""
    time, sample, rigid, moving = worked
    lost = moving[:: len(moving) // 15]
    turn = np.zeros((1200, 3))
    turn[lost, np.arange(len(lost)) % 3] = np.radians(0.2)
    rotation = Rotation.from_rotvec(turn).as_matrix() @ sample.measured_rotation
    nowhere = np.full((1200, 3), np.nan)
    step = table.geometry.limits.encoder_step
    found = lost_beams(1.7e9 + time, nowhere, rotation, rigid, step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


@pytest.mark.parametrize("lever_mm", [5.0, 15.0])
@pytest.mark.parametrize("points_only", [False, True])
def test_a_target_off_o_costs_no_sound_pose_and_hides_no_lost_beam(
    worked, table, lever_mm, points_only
):
    time, sample, rigid, moving = worked
    target = Rotation.from_euler("xyz", [2.0, -1.0, 3.0], degrees=True).as_matrix()
    lever = 1e-3 * lever_mm * np.array([0.6, -0.48, 0.64])
    shift = sample.measured_shift + sample.measured_rotation @ lever
    rotation = sample.measured_rotation @ target
    if points_only:
        rotation = np.full_like(rotation, np.nan)
    lost = moving[:: len(moving) // 15]
    shift[lost, 2] += 0.2e-3
    step = table.geometry.limits.encoder_step
    found = lost_beams(1.7e9 + time, shift, rotation, rigid, step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


@pytest.mark.parametrize("jitter_ms", [2.0, 20.0])
def test_stamps_that_jitter_hide_no_lost_beam_across_the_motion(worked, table, jitter_ms):
    """The instrument stands askew, as far as readings are not refused for it."""
    time, sample, rigid, moving = worked
    lost = moving[:: len(moving) // 15]
    way = Rotation.from_matrix(rigid[lost + 1] @ np.swapaxes(rigid[lost - 1], 1, 2)).as_rotvec()
    across = np.cross(way, [0.0, 0.0, 1.0])
    turn = np.zeros((1200, 3))
    turn[lost] = np.radians(0.2) * across / np.linalg.norm(across, axis=1, keepdims=True)
    askew = Rotation.from_euler("xyz", [3.0, -3.0, 9.0], degrees=True)
    rotation = (askew * Rotation.from_rotvec(turn)).as_matrix() @ sample.measured_rotation
    cell = VirtualCell(table, CellSettings(rate_hz=10.0), np.random.default_rng(1))
    jitter = 1e-3 * jitter_ms * np.random.default_rng(3).standard_normal(1200)
    step = table.geometry.limits.encoder_step
    said = rigid_rotation(table, step * np.round(cell.desired((time + jitter).clip(0.0)) / step))
    nowhere = np.full((1200, 3), np.nan)
    found = lost_beams(1.7e9 + time + jitter, nowhere, rotation, said, step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_motion_of_some_counts_a_sample_tells_its_direction(table, seed):
    """Up to 25 deg/s at 100 Hz; what stamps do along the motion is no lost beam, and hides none."""
    step, rng = table.geometry.limits.encoder_step, np.random.default_rng(seed)
    time, phase = 0.01 * np.arange(1200), 2.0 * np.pi / 5.0

    def theta(moment):
        way = np.radians(20.0) * np.sin(phase * moment)
        return np.stack([way, 0.5 * way], axis=1)

    late = time + 3e-3 * rng.standard_normal(1200)
    rigid = rigid_rotation(table, step * np.round(theta(late) / step))
    lost = np.arange(15, 1190, 37)
    lost = lost[np.abs(np.cos(phase * time[lost])) > 0.6]
    way = Rotation.from_matrix(rigid[lost + 1] @ np.swapaxes(rigid[lost - 1], 1, 2)).as_rotvec()
    across = np.cross(way, [0.0, 0.0, 1.0])
    turn = np.radians(1e-3) * rng.standard_normal((1200, 3))
    turn[lost] += np.radians(0.15) * across / np.linalg.norm(across, axis=1, keepdims=True)
    rotation = Rotation.from_rotvec(turn).as_matrix() @ rigid_rotation(table, theta(time))
    found = lost_beams(1.7e9 + time, np.full((1200, 3), np.nan), rotation, rigid, step)
    np.testing.assert_array_equal(np.flatnonzero(found), lost)


@pytest.mark.parametrize("late_ms", [20, 66])
def test_a_late_stamp_hides_no_lost_beam_of_a_rotation(worked, table, late_ms):
    """What a late stamp does in motion is as large as the lost beams; it is reckoned with first."""
    time, sample, _, moving = worked
    lost = moving[:: len(moving) // 15]
    turn = np.zeros((1200, 3))
    turn[lost, np.arange(len(lost)) % 3] = np.radians(0.2)
    rotation = Rotation.from_rotvec(turn).as_matrix() @ sample.measured_rotation
    own = 10_000_000 * np.arange(12_050)
    cell = VirtualCell(table, CellSettings(rate_hz=10.0), np.random.default_rng(1))
    step = table.geometry.limits.encoder_step
    angles = Signal(own, step * np.round(cell.desired(1e-9 * own) / step))
    stamps = np.round(1e9 * time).astype(np.int64)
    machine = MachineSignals(angles, None, Signal(stamps, sample.wrench), False, {}, {})
    track = MeasuredTrack(stamps + 1_000_000 * late_ms, np.full((1200, 3), np.nan), rotation)
    session = session_of("late", machine, track, table)
    measured = session.measured.any(axis=1)
    gone = np.round(1e9 * session.block.time[~measured]).astype(np.int64)
    np.testing.assert_array_equal(gone, track.time_ns[lost])


LEAST = 1e-6
STILL = np.zeros(500)
NEVER = STILL > 0.0
MOVING = np.arange(500) % 5 == 0


def noisy(size, at=(100, 101, 400)):
    values = 5e-6 * np.random.default_rng(4).standard_normal((500, 1))
    values[list(at), 0] += size
    return values


@pytest.mark.parametrize("size", [150e-6, -150e-6])
def test_thirty_deviations_are_a_spike(size):
    assert np.flatnonzero(spikes(noisy(size), LEAST, STILL, NEVER)).tolist() == [100, 101, 400]


def test_eight_deviations_are_not_yet_a_lost_beam():
    assert not spikes(noisy(40e-6), LEAST, STILL, NEVER).any()


def test_smaller_ones_than_the_least_are_none():
    assert not spikes(noisy(150e-6), 1e3 * LEAST, STILL, NEVER).any()


def test_where_others_are_missing_spikes_are_found_all_the_same():
    values = noisy(150e-6)
    values[:90] = np.nan
    assert np.flatnonzero(spikes(values, LEAST, STILL, NEVER)).tolist() == [100, 101, 400]


@pytest.mark.parametrize(("share", "found"), [(0.0, [100, 101, 400]), (0.2, [])])
def test_as_much_as_motion_does_everywhere_is_no_spike(share, found):
    """Late stamps make a share of the swing of it."""
    values = noisy(150e-6)
    values[MOVING, 0] += share * 1e-3
    swing = np.full(500, 1e-3)
    assert np.flatnonzero(spikes(values, LEAST, swing, MOVING)).tolist() == found


def test_of_few_moves_all_is_put_down_to_the_motion_that_may_be():
    """Of 25, one is off: what the others do tells nothing yet."""
    swing = np.where(np.arange(500) % 20 == 0, 1e-3, 0.0)
    assert np.flatnonzero(
        spikes(noisy(150e-6, at=(101, 400)), LEAST, swing, swing > 0.0)
    ).tolist() == [101]


def test_noise_in_slow_motion_is_no_excuse_in_fast_motion():
    """Of 0.1 mm, the swing of slow moves, noise of 5 um is much; some are ten times as fast."""
    swing = np.where(np.arange(500) % 55 == 0, 1e-3, 1e-4)
    values = noisy(200e-6, at=(110, 275))
    assert np.flatnonzero(spikes(values, LEAST, swing, MOVING)).tolist() == [110, 275]


def test_few_moves_that_are_off_by_thrice_what_most_are_off_are_no_spikes():
    values = noisy(0.0, at=())
    off = np.where(np.arange(500) % 55 == 0, 0.3e-3, 0.1e-3)
    values[MOVING, 0] += off[MOVING]
    assert not spikes(values, LEAST, np.full(500, 1e-3), MOVING).any()
