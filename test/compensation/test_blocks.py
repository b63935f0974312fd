"""Commands in a block, as a replay gives them, and one by one, as a node does: equal to the bit."""

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.payload import Payload
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

MODEL = load_model(shipped_file("config/palmieri2015_model.yaml"))
MOTORS = ("motor_1_joint", "motor_2_joint")
COUNT = 1500
MILLISECOND = 1_000_000
TOLD = {400: Payload(0.0816, (0.001, 0.0, 0.02)), 900: None}


def a_day(seed):
    """Return stamps, a path, loads of parts and contacts, and which of these arrived."""
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.integers(1, 8, COUNT)) * MILLISECOND
    second, (first, other) = 1e-9 * stamps, rng.uniform(0.2, 3.0, 2)
    waves = np.stack([np.sin(first * second), np.cos(other * second)], axis=1)
    loads = np.zeros((COUNT, 6))
    cuts = np.sort(rng.integers(0, COUNT, 6))
    for begin, end in zip(cuts[:-1], cuts[1:], strict=True):
        kind = rng.integers(0, 4)
        if kind == 1:
            loads[begin:end, 2] = -rng.uniform(0.2, 2.5)
            loads[begin:end, 3:5] = rng.normal(0.0, 0.01, 2)
        elif kind == 2:
            loads[begin:end] = rng.normal(0.0, [0.4] * 3 + [0.012] * 3)
        elif kind == 3:
            loads[begin:end, 2] = -0.8
            loads[begin:end, 0] = np.linspace(0.0, 0.4, end - begin)
    loads += 1e-4 * rng.normal(size=loads.shape)
    arrived = rng.random(COUNT) > 0.01
    gap = rng.integers(0, COUNT - 300)
    arrived[gap : gap + 100] = False
    theta = rng.uniform(0.1, 0.6, 2) * waves
    # Beyond the table now and then: a load, a pose.
    loads[rng.integers(0, COUNT, 3)] *= 300.0
    theta[rng.integers(0, COUNT, 3)] = 1.3, 1.3
    return stamps, theta, loads, arrived


@pytest.mark.parametrize("seed", [0, 3, 6, 13, 15, 16, 25, 26])
def test_a_block_is_its_commands_one_by_one(seed):
    stamps, theta, loads, arrived = a_day(seed)
    follow, frame = seed in (6, 13), "wrist_platform" if seed in (13, 26) else "wrist_base"
    settings = StreamSettings(supervisor=SupervisorSettings(follow=follow))
    alone, together = (CorrectionStream(MODEL, settings, enabled=True) for _ in range(2))
    for stream in (alone, together):
        for i in np.flatnonzero(arrived).tolist():
            load = loads[i].tolist()
            stream.loads.add(int(stamps[i]), frame, load[:3], load[3:])
    cuts = [0, 400, 401, 900, COUNT]
    states = set()
    for begin, end in zip(cuts[:-1], cuts[1:], strict=True):
        for stream in (alone, together):
            # The gripper tells now and then what it holds.
            stream.supervisor.declare_payload(TOLD[begin]) if begin in TOLD else None
        block = together.on_commands(stamps[begin:end], theta[begin:end])
        for place, driven in enumerate(block.theta):
            i = begin + place
            one = alone.on_command(int(stamps[i]), "", MOTORS, theta[i].tolist())
            states.add(alone.supervision.state)
            assert np.array_equal(driven, one.theta), i
            assert block.corrected[place] == (one.correction is not None)
            assert str(block.faults.get(place)) == str(one.fault)
            if one.correction is not None:
                assert block.valid[place] == one.valid
                assert np.array_equal(block.after[place], one.correction.after)
                assert np.array_equal(block.covariance[place], one.correction.prediction.covariance)
        assert alone.supervision == together.supervision
        assert np.array_equal(alone.applied, together.applied)
    held = [stream.supervisor.held(settings.supervisor) for stream in (alone, together)]
    assert np.array_equal(*(each.load(np.eye(3)).wrench for each in held))
    assert follow or len(states) >= 3
