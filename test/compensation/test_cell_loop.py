"""The corrector in the virtual cell: its truth shares no law with the model."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
RATE_HZ, SECONDS = 10.0, 60.0
SILENT = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))


def with_step(table, degrees):
    header = replace(table.header, geometry=dict(table.header.geometry))
    header.geometry["limits"] = {**header.geometry["limits"], "encoder_step_deg": degrees}
    return replace(table, header=header)


def pointing_rms(table, play, enabled):
    """RMS of the true normal against the commanded one, and of the rigid one, at rests [rad]."""
    cell = VirtualCell(
        table,
        CellSettings(RATE_HZ, SECONDS, instrument="ideal", load_sensor=SILENT),
        np.random.default_rng(3),
    )
    settings = StreamSettings(
        supervisor=SupervisorSettings(follow=True),
        safety=SafetySettings(slew=10.0, deadband_steps=play),
        correction_limit=0.2,
    )
    stream = CorrectionStream(ErrorModel("same", table, "closed_form"), settings, enabled)
    mechanism, normal = table.mechanism, table.geometry.platform.normal
    errors, before, wrench = [], np.full(2, np.nan), np.zeros(6)
    for i in range(1, round(SECONDS * RATE_HZ)):
        time, stamp = i / RATE_HZ, SECOND + round(i / RATE_HZ * SECOND)
        desired = cell.desired(time)
        stream.loads.add(stamp - 1, "wrist_base", wrench[:3], wrench[3:])
        command = stream.on_command(stamp, "", NAMES, desired)
        sample = cell.step(time, command.theta)
        # At rest, under a load that the corrector has heard of.
        if np.array_equal(before, desired) and np.array_equal(wrench, sample.wrench):
            wanted = mechanism.forward(desired).platform @ normal
            found = sample.pose_rotation @ normal
            rigid = mechanism.forward(sample.encoder).platform @ normal
            errors.append([np.linalg.norm(np.cross(each, wanted)) for each in (found, rigid)])
        before, wrench = desired, sample.wrench
    assert len(errors) > 50
    return np.sqrt(np.mean(np.square(errors), axis=0))


@pytest.fixture(scope="module")
def soft(make_table):
    return make_table(softness=20.0)


def test_with_drives_without_steps_the_cancellable_part_vanishes(soft):
    fine = with_step(soft, 1e-7)
    before, _ = pointing_rms(fine, play=0.0, enabled=False)
    after, _ = pointing_rms(fine, play=0.0, enabled=True)
    assert after <= 0.01 * before


def test_with_encoders_the_error_falls_to_what_the_step_alone_makes(soft):
    before, floor = pointing_rms(soft, play=0.15, enabled=False)
    after, _ = pointing_rms(soft, play=0.15, enabled=True)
    assert before > 3.0 * floor
    assert after <= 1.2 * floor
