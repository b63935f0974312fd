"""Corrections of a motor with backlash: no chatter, no gap, and it jumps where it must."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.memory import play
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
WIDTH = float(np.radians(0.06))
RATE_HZ = 50
SETTINGS = StreamSettings(
    supervisor=SupervisorSettings(follow=True), safety=SafetySettings(slew=1e3, deadband_steps=0.15)
)


@pytest.fixture(scope="module")
def loose(model):
    width = {"width_mdeg": Estimate(1e3 * np.degrees(WIDTH))}
    return model.with_effects(Effect(find_law("backlash"), "motor_1", width))


@pytest.fixture(scope="module")
def hysteresis(model):
    return 0.15 * model.table.geometry.limits.encoder_step


def send(model, thetas, settings=SETTINGS, weight=None):
    """Return the commands for angles of motor 1, sent one after the other under a constant load."""
    stream = CorrectionStream(model, settings, enabled=True)
    out = []
    for i, angle in enumerate(thetas):
        stamp = SECOND + i * SECOND // RATE_HZ
        force = (0.0, 0.0, -1.0) if weight is None else (0.0, 0.0, weight[i])
        stream.loads.add(stamp, "wrist_base", force, (0.0, 0.0, 0.0))
        out.append(stream.on_command(stamp, "", NAMES, (angle, 0.2)))
    return out


def swing(n=400):
    """Motor 1 between -10 and 10 deg, four times in 8 s: slow at its reversals."""
    return np.radians(10.0) * np.sin(2.0 * np.pi * np.arange(n) / 100.0)


def test_there_is_a_correction_at_every_reversal_and_within_the_lost_motion(loose):
    # It begins at rest in the middle of the gap, where the output does not answer.
    rng = np.random.default_rng(1)
    thetas = np.concatenate([np.zeros(50), swing()])
    sent = send(loose, thetas, weight=-1.0 + 0.05 * rng.normal(size=450))
    assert [each.fault for each in sent] == [None] * 450


def test_the_output_follows_the_command_through_the_lost_motion(loose, model, hysteresis):
    thetas = swing()
    sent = np.array([each.theta[0] for each in send(loose, thetas)])
    elastic = np.array([each.theta[0] for each in send(model, thetas)])
    # The true play, from the commands that were sent; what bends is corrected with it.
    output = play(sent, 0.5 * WIDTH, sent[0])
    wanted = thetas + (elastic - thetas)
    assert np.abs(output - wanted).max() < 2.5 * hysteresis
    uncorrected = play(elastic, 0.5 * WIDTH, elastic[0])
    assert np.abs(uncorrected - wanted)[50:].max() > 0.45 * WIDTH


def test_the_correction_turns_once_at_each_reversal(loose):
    thetas = swing()
    added = np.array([each.theta[0] for each in send(loose, thetas)]) - thetas
    jumps = np.flatnonzero(np.abs(np.diff(added)) > 0.5 * WIDTH)
    reversals = np.flatnonzero(np.diff(np.sign(np.diff(thetas))))
    # The first way out begins in the middle of the gap: no jump there.
    assert len(jumps) == len(reversals)
    assert np.all(np.abs(jumps - reversals) < 10)


def test_a_command_that_trembles_does_not_cross_the_lost_motion(loose, hysteresis):
    rng = np.random.default_rng(2)
    way = np.linspace(0.0, np.radians(5.0), 100)
    trembling = way[-1] + 0.4 * hysteresis * rng.uniform(-1.0, 1.0, 300)
    sent = np.array([each.theta[0] for each in send(loose, np.concatenate([way, trembling]))])
    assert np.ptp(sent[100:]) < 3.0 * hysteresis


def test_a_noisy_load_at_rest_does_not_cross_the_lost_motion(loose, hysteresis):
    rng = np.random.default_rng(3)
    thetas = np.concatenate([np.linspace(0.0, np.radians(5.0), 100), np.full(300, np.radians(5.0))])
    sent = send(loose, thetas, weight=-1.0 + 0.05 * rng.normal(size=400))
    assert all(each.fault is None for each in sent)
    assert np.ptp([each.theta[0] for each in sent[100:]]) < 3.0 * hysteresis


def test_without_hysteresis_a_correction_is_found_too(loose):
    settings = replace(SETTINGS, safety=SafetySettings(slew=1e3, deadband_steps=0.0))
    assert [each.fault for each in send(loose, swing(), settings)] == [None] * 400
