"""Registrations, zeros and tare planted in sessions made of the model's own predictions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.comparing import set_up as fitted_anew
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.set_up import without_set_up
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import all_units

POSES = 60
NOISE = np.repeat([0.3e-6, 3e-6], 3)
INSTRUMENT = (Rotation.from_rotvec([2e-3, -3e-3, 1e-3]).as_matrix(), np.array([1e-3, 0, -5e-4]))
TARGET = (Rotation.from_rotvec([-1e-3, 2e-3, 3e-3]).as_matrix(), np.array([-8e-4, 6e-4, 2e-4]))


@pytest.fixture(scope="module")
def model(table):
    return ErrorModel("wrist", table, "closed_form")


def session(model, instrument=INSTRUMENT, target=TARGET, zero=(0, 0), tare=0.0, seed=0, name="day"):
    """Sixty dwells of a second at random poses and loads, half a second of motion between."""
    rng = np.random.default_rng(seed)
    at = np.repeat(1.5 * np.arange(POSES), 2) + np.tile([0.0, 1.0], POSES)
    time = 0.05 * np.arange(30 * POSES - 10)
    aims = np.repeat(rng.uniform(-0.6, 0.6, (POSES, 2)), 2, axis=0)
    pushes = np.repeat(rng.normal(0, [0.5] * 3 + [0.01] * 3, (POSES, 6)), 2, axis=0)
    theta = np.stack([np.interp(time, at, each) for each in aims.T], axis=1)
    load = np.stack([np.interp(time, at, each) for each in pushes.T], axis=1)
    block = Block(time, theta, load)
    true = replace(block, theta=theta + zero, load=load + tare)
    bent, moved = exp_twist(model.batch(true).twist)
    turned = bent @ model.table.mechanism.forward(true.theta).platform
    rotation = instrument[0] @ turned @ target[0]
    shift = (moved + turned @ target[1]) @ instrument[0].T + instrument[1]
    noise = NOISE * rng.normal(size=(len(time), 6))
    jitter = Rotation.from_rotvec(noise[:, 3:]).as_matrix()
    return MeasuredSession(name, block, shift + noise[:, :3], jitter @ rotation)


def left(model, measured, calibrated=()):
    """Set-up and what it leaves, in standard deviations of each unit's noise."""
    observed, after, (set_up,) = without_set_up(model, all_units(model, [measured]), calibrated)
    scatter = NOISE / np.sqrt(observed.observations.samples)[:, None]
    # Moments in motion are told to a tenth of a micrometre only: their load is smoothed.
    dwell = observed.sessions[0].cut.dwell
    return set_up, (after.values / scatter)[dwell]


def rms(values):
    return np.sqrt(np.nanmean(np.square(values)))


def test_millimetres_of_registration_leave_only_noise(model):
    set_up, residual = left(model, session(model))
    assert set_up.values[:3] == pytest.approx(INSTRUMENT[1], abs=5e-6)
    assert set_up.values[6:9] == pytest.approx(TARGET[1], abs=5e-6)
    # Twenty parameters of 360 numbers take 3 %.
    assert rms(residual) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    ("planted", "place", "value", "within"),
    [
        ({"zero": (4e-4, -3e-4)}, slice(12, 14), [4e-4, -3e-4], 1e-4),
        ({"tare": np.array([0.05, 0, 0, 0, 0, 0])}, slice(14, 17), [0.05, 0, 0], 0.02),
    ],
    ids=["zeros", "tare"],
)
def test_zeros_and_tare_are_recovered(model, planted, place, value, within):
    set_up, residual = left(model, session(model, **planted))
    assert set_up.values[place] == pytest.approx(value, abs=within)
    # Priors hold back a little of what sixty dwells hardly tell.
    assert rms(residual) < 1.2


def test_what_was_calibrated_stays(model):
    set_up, residual = left(model, session(model), ("measurement_frame", "target_mounting"))
    assert not set_up.values[:12].any()
    assert rms(residual) > 100


def test_lost_beams_do_not_pull(model):
    measured = session(model)
    shift = measured.shift.copy()
    for pose in (10, 30, 50):
        shift[30 * pose : 30 * pose + 20] += 1e-3
    _, residual = left(model, replace(measured, shift=shift))
    far = np.abs(residual).max(axis=1) > 100
    assert far.sum() == 3
    assert rms(residual[~far]) < 1.2


@pytest.mark.parametrize("blank", [slice(0, 3), slice(3, 6)], ids=["pointing", "points"])
def test_half_a_pose_is_enough(model, blank):
    measured = session(model)
    if blank.start == 0:
        measured = replace(measured, shift=np.full_like(measured.shift, np.nan))
    else:
        measured = replace(measured, rotation=np.full_like(measured.rotation, np.nan))
    _, residual = left(model, measured)
    assert np.isnan(residual[:, blank]).all()
    # Of points alone a lever of a millimetre tells the turn of the instrument: priors hold there.
    assert rms(residual) < 1.4


def test_each_session_has_its_own_set_up(model):
    other = (np.eye(3), np.array([0, 0, 2e-3]))
    days = [session(model), session(model, instrument=other, seed=1, name="next day")]
    found = compare_models([("model", model)], days)
    (compared,) = found.models
    assert compared.before["s_um"].rms > 1000
    assert compared.after["s_um"].rms < 0.6
    assert "noise and drift of the instrument, no more (" in found.verdict[0]
    taken = {each.name: each for each in compared.absorbed}
    parts = ("measurement_frame@pose_sensor", "load_bias@load_sensor")
    assert {f"{part} in {day}" for part in parts for day in ("day", "next day")} <= set(taken)
    frame = taken["measurement_frame@pose_sensor in next day"]
    assert (frame.parameter, frame.value) == ("shift_z_um", pytest.approx(2000.0, abs=30.0))


def test_too_few_dwells_are_refused_and_why_there_are_no_more(model):
    few = replace(session(model).take(slice(0, 100)), remarks=("cut at byte 44",))
    reason = r"^day: \d+ dwells and moments are too few to compare with, .*; cut at byte 44$"
    with pytest.raises(InputError, match=reason):
        compare_models([("m", model)], [few])


def test_a_model_of_another_wrist_is_refused(model):
    axes = {**model.table.geometry.axes, "joint_3": np.array([0.0, 0.6, 0.8])}
    table = replace(model.table, header=model.table.header)
    table.__dict__["geometry"] = replace(model.table.geometry, axes=axes)  # a cached property
    other = replace(model, table=table)
    with pytest.raises(InputError, match="other is of another wrist than model"):
        compare_models([("model", model), ("other", other)], [session(model)])


def test_the_bow_of_a_target_a_millimetre_off_is_no_error_of_a_motion(model):
    """Up to 35 deg/s: half a second of it bends the way of the target by micrometres."""
    time = 0.05 * np.arange(2000)
    theta = 0.6 * np.stack([np.sin(time), np.sin(0.77 * time)], axis=1)
    block = Block(time, theta, np.zeros((len(time), 6)))
    bent, moved = exp_twist(model.batch(block).twist)
    turned = bent @ model.table.mechanism.forward(theta).platform
    noise = NOISE * np.random.default_rng(1).normal(size=(len(time), 6))
    jitter = Rotation.from_rotvec(noise[:, 3:]).as_matrix()
    shift = (moved + turned @ TARGET[1]) @ INSTRUMENT[0].T + INSTRUMENT[1] + noise[:, :3]
    measured = MeasuredSession(
        "day", block, shift, jitter @ INSTRUMENT[0] @ turned @ TARGET[0], np.diag(NOISE**2)
    )
    observed, after, _ = without_set_up(model, all_units(model, [measured]))
    scatter = NOISE / np.sqrt(observed.observations.samples)[:, None]
    moving = ~observed.sessions[0].cut.dwell
    assert moving.sum() > 100
    assert rms((after.values / scatter)[moving]) < 1.3


def test_a_model_that_is_wrong_is_not_believed_the_more_the_longer_it_is_recorded():
    """What is off alike at neighbours must not weigh eight times against what is plausible."""
    rng = np.random.default_rng(4)
    columns, residual = 0.1 * rng.normal(size=(50, 6, 3)), rng.normal(size=(50, 6))

    def taken_up(units, times):
        many = np.tile(columns[:units], (times, 1, 1)), np.tile(residual[:units], (times, 1))
        return np.linalg.norm(fitted_anew._solved(*many, np.zeros(3))[0])

    assert taken_up(50, 8) == pytest.approx(taken_up(50, 1))
    assert taken_up(25, 2) > 1.1 * taken_up(25, 1)
