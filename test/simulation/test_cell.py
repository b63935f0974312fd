import numpy as np
import pytest

from wrist_stiffness.errors import InputError, UnreachablePoseError
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell, true_laws
from wrist_stiffness.simulation.instrument import WILD_SHIFT

RATE = 50.0
COUNT_ROUNDING = 1e-12  # rad


@pytest.fixture
def ran(wrist):
    """Return a function that runs a cell: cell, times, angles sent, samples."""

    def run(seconds=20.0, seed=1, table=None, **settings):
        cell = VirtualCell(table or wrist(), CellSettings(rate_hz=RATE, **settings), rng(seed))
        time_s = np.arange(round(seconds * RATE)) / RATE
        sent = cell.desired(time_s)
        return cell, time_s, sent, cell.run(time_s, sent)

    return run


def rng(seed):
    return np.random.default_rng(seed)


def test_samples_one_by_one_are_those_of_a_block(ran, wrist):
    _, time_s, sent, block = ran(4.0)
    cell = VirtualCell(wrist(), CellSettings(rate_hz=RATE), rng(1))
    for i, t in enumerate(time_s):
        one = cell.step(t, sent[i])
        # The noise is drawn in the same order; matrix products of a stack may round differently.
        assert np.array_equal(one.encoder, block.encoder[i])
        np.testing.assert_allclose(one.wrench, block.wrench[i], rtol=0, atol=1e-15)
        np.testing.assert_allclose(one.measured_shift, block.measured_shift[i], rtol=0, atol=1e-14)
        np.testing.assert_allclose(
            one.measured_rotation, block.measured_rotation[i], rtol=0, atol=1e-14
        )


def test_a_seed_repeats_to_the_bit_and_another_differs(ran):
    same, again, other = (ran(3.0, seed=seed)[3] for seed in (1, 1, 2))
    assert np.array_equal(same.measured_shift, again.measured_shift)
    assert np.array_equal(same.wrench, again.wrench)
    assert not np.array_equal(same.measured_shift, other.measured_shift)


def test_encoder_shows_whole_counts_near_what_was_sent(ran):
    cell, _, sent, block = ran()
    step = cell.table.geometry.limits.encoder_step
    counts = block.encoder / step
    assert np.max(np.abs(counts - np.round(counts))) < 1e-9
    assert np.max(np.abs(block.encoder - sent)) <= step + COUNT_ROUNDING


def test_without_flanges_the_true_pose_is_the_rigid_one_moved_by_compliance_and_weight(ran, wrist):
    table = wrist(flanged=False)
    cell, time_s, _, block = ran(table=table, instrument="ideal")
    # The shaft is hidden within a count of the encoder; an independent forward solution of the
    # linear statics is taken at the shaft angles that explain the measured normal.
    load = cell.program.load(time_s)
    configuration = table.mechanism.forward(block.encoder)
    operators = contact_operators(configuration, table.components, table.geometry.gravity)
    twist = (operators.compliance @ load[..., None])[..., 0] + operators.weight_twist
    _, shift = exp_twist(twist)
    # Half a count turns the compliance by far less than this share of the shift.
    scale = np.max(np.linalg.norm(shift, axis=1))
    assert np.max(np.abs(block.pose_shift - shift)) < 2e-3 * scale


def test_error_against_the_rigid_pose_is_that_of_a_flexible_wrist(ran):
    cell, time_s, _, block = ran()
    nominal = cell.table.mechanism.forward(block.encoder).platform
    error = log_motion(block.pose_rotation @ np.swapaxes(nominal, -1, -2), block.pose_shift)
    loaded = np.linalg.norm(cell.program.load(time_s)[:, :3], axis=1) > 0.3
    shift = np.linalg.norm(error[loaded, :3], axis=1).mean()
    assert 2e-6 < shift < 100e-6
    assert shift > np.linalg.norm(error[~loaded, :3], axis=1).mean()


def test_measured_load_is_at_most_one_newton_and_changes_with_the_dwell(ran):
    cell, time_s, _, block = ran(60.0)
    force = np.linalg.norm(cell.program.load(time_s)[:, :3], axis=1)
    assert 0.5 < force.max() <= 1.0
    assert np.any(force == 0.0)
    noise = block.wrench - cell.program.load(time_s)
    assert 1e-3 < noise[:, :3].std() < 4e-3


def test_load_and_angles_change_smoothly(ran):
    cell, *_ = ran(1.0)
    fine = np.arange(0.0, 60.0, 1e-3)
    rates = np.diff(cell.program.load(fine)[:, :3], axis=0) / 1e-3
    assert np.max(np.abs(np.diff(rates, axis=0))) / 1e-3 < 60.0  # N/s^2, minimum jerk in 0.6 s
    speed = np.diff(cell.desired(fine), axis=0) / 1e-3
    assert np.max(np.abs(speed)) < np.radians(90.0)
    assert np.max(np.abs(np.diff(speed, axis=0))) / 1e-3 < np.radians(1500.0)


def test_poses_are_approached_from_all_sides(ran):
    cell, *_ = ran(1.0, program_seconds=200.0)
    angles = cell.program.angles.values
    moves = np.diff(angles, axis=0)
    small = np.abs(moves).max(axis=1) < np.radians(5.0)
    signs = {tuple(np.sign(move)) for move in moves[small] if np.any(move != 0.0)}
    assert {(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)} <= signs


def test_program_stays_in_the_operative_workspace_and_repeats(ran):
    cell, *_ = ran(1.0)
    time_s = np.arange(0.0, cell.program.duration_s, 0.05)
    assert np.all(cell.table.workspace.operative(cell.desired(time_s)))
    later = cell.desired(time_s + cell.program.duration_s)
    np.testing.assert_allclose(later, cell.desired(time_s), atol=1e-9)


def test_pose_noise_has_the_stated_size(ran):
    _, _, _, block = ran(60.0, instrument="tracker")
    noise = block.measured_shift - block.pose_shift
    white = np.diff(noise, axis=0).std() / np.sqrt(2.0)
    assert white == pytest.approx(5e-6, rel=0.05)
    turned = log_motion(
        block.measured_rotation @ np.swapaxes(block.pose_rotation, -1, -2),
        np.zeros((len(noise), 3)),
    )
    white = np.diff(turned[:, 3:], axis=0).std() / np.sqrt(2.0)
    assert white == pytest.approx(np.radians(10e-3), rel=0.05)


def test_motors_follow_what_is_sent_not_the_program(wrist):
    cell = VirtualCell(wrist(), CellSettings(instrument="ideal"), rng(1))
    corrected = cell.desired(0.0) + np.radians([0.2, -0.1])
    sample = cell.step(0.0, corrected)
    step = cell.table.geometry.limits.encoder_step
    assert np.max(np.abs(sample.encoder - corrected)) <= step


def test_told_speeds_add_up_to_the_way_of_the_program(wrist):
    """A drive tells the mean of the last four milliseconds: as it was two of them ago."""
    cell = VirtualCell(wrist(), CellSettings(), rng(0))
    time = np.arange(0.0, 12.0, 1e-3)
    sent = cell.desired(time)
    speed = cell.run(time, sent).speed
    way = 1e-3 * np.cumsum(0.5 * (speed[1:] + speed[:-1]), axis=0)
    # A small part of a count, which is 0.26 mrad.
    then = cell.desired(np.maximum(time - 2e-3, 0.0))
    np.testing.assert_allclose(way, then[1:] - then[0], atol=1e-5)
    assert np.ptp(sent, axis=0).min() > 0.1


def test_drives_tell_how_the_motors_move_not_how_the_program_does(wrist):
    """Motors that are held tell no speed, motors that are sent another way another one."""
    cell, time = VirtualCell(wrist(), CellSettings(), rng(0)), np.arange(0.0, 12.0, 1e-2)
    held = np.repeat(cell.desired(time)[:1], len(time), axis=0)
    still = cell.run(time, held).speed
    moving = VirtualCell(wrist(), CellSettings(), rng(0)).run(time, cell.desired(time)).speed
    assert np.abs(still).max() < 0.1 * np.abs(moving).max()
    other = VirtualCell(wrist(), CellSettings(), rng(0)).run(
        time, cell.desired(time) + np.outer(time, [0.01, -0.02])
    )
    np.testing.assert_allclose((other.speed - moving)[1:].mean(axis=0), [0.01, -0.02], atol=1e-4)
    steps = [cell.step(12.0 + t, angles).speed for t, angles in zip(time, held, strict=True)]
    block = VirtualCell(wrist(), CellSettings(), rng(0))
    block.run(time, held)
    assert np.array_equal(steps, block.run(12.0 + time, held).speed)


def test_bad_settings_and_angles_are_refused(wrist):
    with pytest.raises(InputError, match="theodolite"):
        CellSettings(instrument="theodolite")
    cell = VirtualCell(wrist(), CellSettings(), rng(1))
    with pytest.raises(UnreachablePoseError):
        cell.step(0.0, np.radians([90.0, 90.0]))


def test_lost_beams_are_missing_or_wild_and_the_rest_untouched(ran):
    clean, lost = (ran(40.0, lost_beams=share)[3] for share in (0.0, 0.5))
    gone = np.isnan(lost.measured_shift).any(axis=1)
    same = (lost.measured_shift == clean.measured_shift).all(axis=1)
    wild = ~gone & ~same
    # A quarter of 2000 each; six standard deviations of a binomial count are 116.
    assert abs(gone.sum() - 500) < 116
    assert abs(wild.sum() - 500) < 116
    off = (lost.measured_shift - clean.measured_shift)[wild]
    assert off.std() == pytest.approx(WILD_SHIFT, rel=0.1)
    assert np.array_equal(np.isnan(lost.measured_rotation).all(axis=(1, 2)), gone)


def test_a_drive_is_no_softer_for_a_soft_bushing_beside_it(wrist):
    """What hides is as large on every base: tolerances are of the wrist as it was built."""
    table = wrist()
    hidden = HiddenEffect("drive_compliance", "motor_1", "linear", 0.05, 1)
    added = []
    for base in ("exact", "wrong"):
        with_it, without = table.components, table.components
        for law in true_laws(table, CellSettings(base=base, base_seed=5, hidden=(hidden,))):
            with_it = law.parts(with_it)
        for law in true_laws(table, CellSettings(base=base, base_seed=5)):
            without = law.parts(without)
        added.append(with_it.flexibility - without.flexibility)
    assert added[0].any()
    np.testing.assert_allclose(added[1], added[0], atol=1e-15)
