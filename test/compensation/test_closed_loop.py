"""Corrector and wrist in a loop, judged by the true pose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stops import Stops

from wrist_stiffness.compensation.belief import State, SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.model.error_model import ErrorModel, Load

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
FOLLOW = SupervisorSettings(follow=True)
THRESHOLD = SupervisorSettings().limit.force
TOOL_MM = [0.0, 0.0, 60.0]


def pointing_errors(model, play, step, poses=60, seed=7):
    """Return (before, after, floor) of the true normal against the commanded one [rad]."""
    settings = StreamSettings(
        supervisor=FOLLOW, safety=SafetySettings(slew=10.0, deadband_steps=play)
    )
    stream = CorrectionStream(model, settings, enabled=True)
    rng = np.random.default_rng(seed)
    mechanism, normal = model.table.mechanism, model.table.geometry.platform.normal
    errors = []

    def drive(angles):
        return step * np.round(angles / step) if step else angles

    def pointing(angles, load):
        twist = model.predict(angles, Load(load)).twist
        rotation = Rotation.from_rotvec(twist[3:]).as_matrix()
        return rotation @ mechanism.forward(angles).platform @ normal

    for i in range(poses):
        theta = rng.uniform(-0.5, 0.5, 2)
        load = np.append(rng.normal(size=3), np.zeros(3))
        for j in range(5):
            stamp = (i + 1) * SECOND + j * SECOND // 10
            stream.loads.add(stamp, "wrist_base", load[:3], load[3:])
            command = stream.on_command(stamp, "", NAMES, theta)
        assert command.fault is None
        wanted = mechanism.forward(theta).platform @ normal
        rigid = mechanism.forward(drive(theta)).platform @ normal
        found = (pointing(drive(theta), load), pointing(drive(command.theta), load), rigid)
        errors.append([np.linalg.norm(np.cross(each, wanted)) for each in found])
    return np.sqrt(np.mean(np.square(errors), axis=0))


def test_with_an_ideal_drive_the_cancellable_part_is_cancelled(model):
    before, after, _ = pointing_errors(model, play=0.0, step=0.0)
    assert after < 0.01 * before


def test_with_an_encoder_the_error_falls_to_its_floor(make_table):
    soft = ErrorModel("soft", make_table(softness=60.0), "closed_form")
    step = soft.table.geometry.limits.encoder_step
    before, after, floor = pointing_errors(soft, play=0.15, step=step)
    assert before > 3.0 * floor
    assert after <= 1.2 * floor


def with_tool(table):
    header = replace(table.header, geometry=dict(table.header.geometry))
    header.geometry["platform"] = {**header.geometry["platform"], "tool_point_mm": TOOL_MM}
    return replace(table, header=header)


@pytest.fixture(scope="module")
def wrists(make_table):
    """True wrist, and models that are 0.7, 1 and 1.5 times as soft."""
    softness = 20.0
    return with_tool(make_table(softness=softness)), {
        ratio: ErrorModel(str(ratio), with_tool(make_table(softness=ratio * softness)), "spline")
        for ratio in (0.7, 1.0, 1.5)
    }


def contact_forces(truth, model, stiffness, delay_s, contact, rate_hz=50, seconds=3.0):
    """Move the tool into a wall and stay; return the force [N] and the last contact state."""
    model = model.with_evaluation("closed_form")
    settings = StreamSettings(objective="tool_point", supervisor=contact or FOLLOW)
    stream = CorrectionStream(model, settings, enabled=contact is not None)
    tool = truth.geometry.platform.tool_point
    # Turning motor 2 moves the tool, above O, along x.
    start, end = np.array([0.0, -0.002]), np.array([0.0, 0.004])
    wanted = truth.mechanism.forward(np.zeros(2)).platform
    one = np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3)), tool[None], wanted[None]
    wall = Stops(*one, np.array([-np.inf]), np.zeros(1), np.array([stiffness]))
    load, there = np.zeros((1, 6)), np.ones(1, dtype=bool)
    delay, sent = round(delay_s * rate_hz), start
    felt = [np.zeros(6)] * (delay + 1)
    forces, restricted = [], False
    for i in range(round(seconds * rate_hz)):
        felt.append(wall.settle(truth, sent[None], load, there)[2][0])
        forces.append(np.linalg.norm(felt[-1][:3]))
        stamp = SECOND + round(i / rate_hz * SECOND)
        heard = felt[-1 - delay]
        stream.loads.add(stamp, "wrist_base", heard[:3], heard[3:])
        desired = start + (end - start) * min(i / rate_hz, 1.0)
        sent = stream.on_command(stamp, "", NAMES, desired).theta
        restricted |= stream.supervision.state is State.IN_CONTACT
    return np.array(forces), restricted


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.7, 1.5])
@pytest.mark.parametrize(
    ("newton_per_um", "delay_s"), [(0.0, 0.0), (0.02, 0.1), (0.5, 0.0), (10.0, 0.1)]
)
def test_in_contact_the_force_stays_or_the_corrector_says_so(wrists, ratio, newton_per_um, delay_s):
    truth, models = wrists
    stiffness = 1e6 * newton_per_um
    plain, _ = contact_forces(truth, models[ratio], stiffness, delay_s, None)
    forces, restricted = contact_forces(
        truth, models[ratio], stiffness, delay_s, SupervisorSettings()
    )
    assert forces.max() <= 1.1 * plain.max() + THRESHOLD
    assert restricted == bool(forces.max() > THRESHOLD)


def test_following_every_load_in_contact_raises_the_force(wrists):
    """The loop that the supervisor guards against is there."""
    truth, models = wrists
    plain, _ = contact_forces(truth, models[1.5], 0.5e6, 0.0, None)
    forces, _ = contact_forces(truth, models[1.5], 0.5e6, 0.0, FOLLOW)
    assert forces.max() > 1.2 * plain.max()
