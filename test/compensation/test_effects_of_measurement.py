"""What is wrong with a measurement alone never moves a motor.

Which effects these are is decided by the virtual cell, which knows nothing of the model's laws: the
same commands leave the true platform where it is, and the load is said as it was.
"""

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import catalogue, find_law
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell

MOTORS = ("motor_1_joint", "motor_2_joint")
RATE_HZ, SECONDS = 5.0, 20.0
TIME_S = np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ

OF_MEASUREMENT = {
    *("measurement_frame@pose_sensor", "target_mounting@pose_sensor", "drift@pose_sensor"),
    *("time_delay@pose_sensor", "time_delay@motor_1", "time_delay@motor_2"),
}


@pytest.fixture(scope="module")
def shipped():
    return load_model(shipped_file("config/palmieri2015_model.yaml"))


def in_the_cell(table, *hidden):
    settings = CellSettings(
        RATE_HZ, program_seconds=SECONDS, program_seed=3, instrument="ideal", hidden=hidden
    )
    cell = VirtualCell(table, settings, np.random.default_rng(0))
    return cell.run(TIME_S, cell.desired(TIME_S))


@pytest.fixture(scope="module")
def healthy(shipped):
    return in_the_cell(shipped.table)


@pytest.mark.parametrize(
    "name", sorted({f"{law.id}@{p}" for law in catalogue().values() for p in law.places})
)
def test_the_virtual_cell_says_which_effects_leave_the_wrist_right(shipped, healthy, name):
    law, place = name.split("@")
    entry = CATALOGUE[law]
    size = min(10.0 * entry.plausible, 0.5 * entry.limit)
    sample = in_the_cell(shipped.table, HiddenEffect(law, place, entry.forms[0], size, 7))
    stands = np.array_equal(sample.pose_shift, healthy.pose_shift) and np.array_equal(
        sample.pose_rotation, healthy.pose_rotation
    )
    right = stands and np.array_equal(sample.wrench, healthy.wrench)
    assert find_law(law).of_measurement(place) == right == (name in OF_MEASUREMENT)


def large(name):
    law, place = name.split("@")
    effect = Effect(find_law(law), place)
    return effect.with_values({p.key: 2.0 * p.scale for p in effect.parameters})


def driven(model, cell):
    """Return what the corrector sends and hands on along the cell's program."""
    stream = CorrectionStream(
        model, StreamSettings(supervisor=SupervisorSettings(follow=True)), enabled=True
    )
    phase = cell.program.phase(TIME_S)
    sent = []
    for time, theta, load in zip(
        TIME_S, cell.desired(TIME_S), cell.program.load(phase), strict=True
    ):
        stamp = round(1e9 * (time + 1.0))
        stream.loads.add(stamp, "wrist_base", load[:3].tolist(), load[3:].tolist())
        command = stream.on_command(stamp, "", MOTORS, theta.tolist())
        assert command.fault is None
        sent.append([*command.theta, *command.correction.after])
    return np.array(sent)


@pytest.fixture(scope="module")
def cell(shipped):
    settings = CellSettings(RATE_HZ, program_seconds=SECONDS, program_seed=3)
    return VirtualCell(shipped.table, settings, np.random.default_rng(0))


@pytest.mark.parametrize("name", sorted(OF_MEASUREMENT))
def test_the_corrector_sends_the_same_with_an_effect_of_measurement(shipped, cell, name):
    effect = large(name)
    without, with_it = driven(shipped, cell), driven(shipped.with_effects(effect), cell)
    np.testing.assert_array_equal(with_it, without)
    # It is an effect: the monitor and the diagnosis do see it.
    loads = cell.program.load(cell.program.phase(TIME_S))
    stream = PredictionStream(shipped.with_effects(effect), StreamSettings())
    plain = PredictionStream(shipped, StreamSettings())
    seen = 0.0
    for time, theta, load in zip(TIME_S, cell.desired(TIME_S), loads, strict=True):
        stamp = round(1e9 * (time + 1.0))
        said = []
        for each in (stream, plain):
            each.loads.add(stamp, "wrist_base", load[:3].tolist(), load[3:].tolist())
            said.append(each.on_joint_state(stamp, MOTORS, theta.tolist()).measured)
        seen = max(seen, float(np.abs(said[0] - said[1]).max()))
    assert seen > 1e-7


def test_the_corrector_answers_to_an_effect_of_the_wrist_beside_one_of_measurement(shipped, cell):
    of_wrist, late = large("backlash@motor_1"), large("time_delay@motor_2")
    alone = driven(shipped.with_effects(of_wrist), cell)
    np.testing.assert_array_equal(driven(shipped.with_effects(of_wrist, late), cell), alone)
    assert np.abs(alone - driven(shipped, cell)).max() > 1e-5
