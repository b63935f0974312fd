"""The compiled corrector: as the search in Python, and a block as its commands one by one."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.compensation.correction import correction_of
from wrist_stiffness.compensation.corrector import Corrected, Corrector, search
from wrist_stiffness.compensation.held_signals import HeldSignals
from wrist_stiffness.compensation.objective import OBJECTIVES
from wrist_stiffness.compensation.running_model import RunningModel
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import UnreachablePoseError, WristError
from wrist_stiffness.mechanism.compiled import CompiledCommands, CorrectedRows
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

MODEL = load_model(shipped_file("config/palmieri2015_model.yaml"))
SETTINGS = StreamSettings()
STEP_NS = 1_000_000
LOAD = np.array([0.3, -0.2, -0.8, 0.005, 0.0, -0.01])


def running_model():
    return RunningModel(MODEL, HeldSignals(1.0), HeldSignals(1.0))


def all_of_it(turn):
    return 1.0


def corrected(corrector, running, stamp_ns, theta, load, own=SETTINGS):
    if load is not None and running.compiled is not None:
        arrays = np.array([stamp_ns]), theta[None], load.wrench[None], np.array([load.on_platform])
        found = CorrectedRows.room(1, running.compiled.sectors)
        one = CompiledCommands(*arrays, np.array([True]), np.ones(1))
        if corrector.correct(running, running.compiled, own, one, found):
            correction = correction_of(found, 0, running.model, load)
            return Corrected(correction.delta, correction, None, load)
    return corrector.searched(running, own, stamp_ns, theta, None, load, all_of_it)


@settings(max_examples=60)
@given(
    st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=2).map(np.array),
    st.lists(st.floats(-0.7, 0.7), min_size=6, max_size=6).map(np.array),
    st.booleans(),
    st.sampled_from(OBJECTIVES),
    st.lists(st.floats(-2e-4, 2e-4), min_size=2, max_size=2).map(np.array),
)
def test_the_compiled_search_is_the_one_in_python(theta, load, on_platform, objective, held):
    load = Load(load * [1.0, 1.0, 1.0, 0.02, 0.02, 0.02], on_platform)
    tool = replace(MODEL.table.geometry.platform, tool_point=np.array([0.002, -0.001, -0.02]))
    geometry = replace(MODEL.table.geometry, platform=tool)
    # The cached geometry of a table made for the purpose.
    table = replace(MODEL.table)
    vars(table)["geometry"] = geometry
    model = replace(MODEL, table=table)
    own = replace(SETTINGS, objective=objective, safety=replace(SETTINGS.safety, slew=1e9))
    running = RunningModel(model, HeldSignals(1.0), HeldSignals(1.0))
    corrector = Corrector()
    corrected(corrector, running, STEP_NS, theta, None, own)
    corrector.held[:] = held
    play = own.safety.deadband_steps * geometry.limits.encoder_step
    try:
        wanted = search(running, own, 0, load, theta, None, held, play)
    except UnreachablePoseError:
        assert corrected(corrector, running, 2 * STEP_NS, theta, load, own).fault is not None
        return
    found = corrected(corrector, running, 2 * STEP_NS, theta, load, own)
    # Both end within the search's own tolerance; the way there is the same to rounding.
    np.testing.assert_allclose(found.delta, wanted.delta, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.correction.after, wanted.after, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.correction.jacobian, wanted.jacobian, rtol=0, atol=1e-12)
    assert np.array_equal(found.correction.prediction.active, wanted.prediction.active)
    covariance = wanted.prediction.covariance
    np.testing.assert_allclose(found.correction.prediction.covariance, covariance, rtol=1e-11)


def commands(count, seed):
    """Return a path that leaves the domain now and then, with loads beyond the range."""
    rng = np.random.default_rng(seed)
    second = 1e-3 * np.arange(count)
    theta = 0.62 * np.stack([np.sin(21.0 * second), np.cos(13.0 * second)], axis=1)
    theta[rng.integers(0, count, 5)] = [1.5, 1.5]
    load = LOAD * (1.0 + 0.5 * np.sin(9.0 * second)[:, None])
    load[rng.integers(0, count, 5)] *= 100.0
    stamps = STEP_NS * np.arange(1, count + 1)
    stamps[count // 2 :] += 500 * STEP_NS
    wanted = rng.random(count) > 0.02
    shares = np.ones(count)
    return CompiledCommands(stamps, theta, load, rng.random(count) > 0.5, wanted, shares)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_block_is_its_commands_one_by_one_to_the_bit(seed):
    block = commands(400, seed)
    running, together, alone = running_model(), Corrector(), Corrector()
    rows, faults = CorrectedRows.room(len(block.wanted), running.compiled.sectors), {}
    own = running, running.compiled, SETTINGS, block, rows, None
    place = together.correct(*own)
    while place < len(block.wanted):
        load = Load(block.load[place], bool(block.on_platform[place]))
        arguments = int(block.stamp_ns[place]), block.theta[place], None, load, all_of_it
        one = together.searched(running, SETTINGS, *arguments)
        faults[place], rows.applied[place] = one.fault, one.delta
        place = together.correct(*own, place + 1)
    running = running_model()
    for i, stamp_ns in enumerate(block.stamp_ns.tolist()):
        load = Load(block.load[i], bool(block.on_platform[i])) if block.wanted[i] else None
        one = corrected(alone, running, stamp_ns, block.theta[i], load)
        assert np.array_equal(rows.applied[i], one.delta)
        assert str(faults.get(i)) == str(one.fault)
        if one.correction is not None:
            assert np.array_equal(rows.rows[i, 2:8], one.correction.after)
            twist = one.correction.prediction.twist
            assert np.array_equal(rows.twist[i], twist)
            assert np.array_equal(rows.active[i], one.correction.prediction.active)
    assert len(faults) >= 5
    assert np.abs(rows.applied).max() > 1e-5
    assert np.array_equal(together.applied, alone.applied)


WITHOUT = """
import json, sys
sys.modules["wrist_stiffness.mechanism._native"] = None  # as without a C compiler
sys.path.insert(0, sys.argv[1])
import test_corrector as own
from wrist_stiffness.mechanism.compiled import native
assert native is None
print(json.dumps(own.a_short_run()))
"""


def a_short_run():
    """Return what is predicted and corrected along a path."""
    block, running, corrector = commands(30, 2), running_model(), Corrector()
    out = []
    for i, stamp_ns in enumerate(block.stamp_ns.tolist()):
        load = Load(block.load[i], bool(block.on_platform[i]))
        one = corrected(corrector, running, stamp_ns, block.theta[i], load)
        values = [*one.delta.tolist(), str(one.fault)]
        try:
            prediction = MODEL.predict(block.theta[i], load)
            values += [*prediction.twist.tolist(), *prediction.covariance.ravel().tolist()]
        except WristError as error:
            values.append(str(error))
        out.append(values)
    return out


def test_without_a_compiler_the_answers_are_the_same(request):
    arguments = [sys.executable, "-c", WITHOUT, str(request.path.parent)]
    answer = subprocess.run(arguments, capture_output=True, text=True, check=True)
    for without, wanted in zip(json.loads(answer.stdout), a_short_run(), strict=True):
        assert [e for e in without if isinstance(e, str)] == [
            e for e in wanted if isinstance(e, str)
        ]
        numbers, others = (
            [e for e in values if not isinstance(e, str)] for values in (without, wanted)
        )
        np.testing.assert_allclose(numbers, others, rtol=1e-9, atol=1e-12)
