"""The loop closed on the true error: a live corrector learns the effect that its model misses.

    corrector  disabled            enabled, old model   (the same motion) new model
    wrist      rich experiment     new motion           new motion
    meanwhile  recorder                                 ~/reload_model while commands go on
    then       diagnose, extend

The wrist answers each command before the next one is sent, so that nothing depends on the clock.
The motors that are judged stop where they are told: chance within a count would hide what is left.
"""

import json
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from wrist_stiffness.commands.extend import extend_model
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.safety import SafetySettings
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import joint_message, pose_message_stamped
from wrist_stiffness.ros.qos import NOTES_QOS
from wrist_stiffness.ros.recorder import Recorder
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell

pytestmark = pytest.mark.slow

NAMES = ("motor_1_joint", "motor_2_joint")
CORRECTED = "/motor_commands_corrected"
START_NS = 1_700_000_000_000_000_000
WIDTH = 1e-3
HIDDEN = (HiddenEffect("backlash", "motor_1", "single", WIDTH, 5),)
RATE_HZ = 10.0
WINDOW = 5
"""Samples after a motor has turned round in which its correction may turn round once at most."""

SETTLED = 4
"""Samples at one angle and one load after which a rest counts."""

COMMISSIONED = [
    *("measurement_frame", "target_mounting", "encoder_offset", "axis_misalignment"),
    *("flange_contact", "link_stiffness", "bushing_stiffness"),
]
"""The wrist was calibrated before it wore: the fit is of the effect and the tare."""


@dataclass
class Wrist:
    """A virtual wrist whose motors follow what a live corrector answers."""

    graph: object
    stamp_ns: int = START_NS
    sent: int = 0

    def work(self, cell, start_s, seconds, after=lambda step: None):
        """Return samples, commands and loads of a cell's program."""
        time_s = start_s + np.arange(round(seconds * RATE_HZ)) / RATE_HZ
        wanted, samples = cell.desired(time_s), []
        weights = cell.program.load(cell.program.phase(time_s))
        for step, (theta, load) in enumerate(zip(wanted, weights, strict=True)):
            self.stamp_ns += round(1e9 / RATE_HZ)
            # Not what the sensor of the sample before said: that would be late by a sample.
            self.graph.load(self.stamp_ns, load)
            samples.append(cell.step(time_s[step], self._answer(theta)))
            self._tell(samples[-1])
            after(step)
        return samples, np.hstack([wanted, weights])

    def _answer(self, theta):
        self.graph.publish("/motor_commands", joint_message(self.stamp_ns, "", NAMES, theta))
        self.sent += 1
        heard = self.graph.heard[CORRECTED]
        self.graph.until(lambda: len(heard) == self.sent, f"answer {self.sent}")
        return np.array(heard[-1].position)

    def _tell(self, sample):
        joints = joint_message(self.stamp_ns, "", NAMES, sample.encoder)
        pose = pose_message_stamped(self.stamp_ns, sample.measured_rotation, sample.measured_shift)
        self.graph.publish("/joint_states", joints)
        self.graph.publish("/platform_pose_measured", pose)


def cell_of(table, seconds, seed):
    settings = CellSettings(RATE_HZ, program_seconds=seconds, program_seed=seed, hidden=HIDDEN)
    return VirtualCell(table, settings, np.random.default_rng(seed))


def with_fine_counts(table):
    geometry = dict(table.header.geometry)
    geometry["limits"] = {**geometry["limits"], "encoder_step_deg": 1e-7}
    return replace(table, header=replace(table.header, geometry=geometry))


def pointing_at_rest(table, samples, conditions):
    """Return true pointing errors, and what hidden encoder counts would add, RMS [rad]."""
    platform, step = table.geometry.platform, table.geometry.limits.encoder_step
    objective = Objective("pointing", platform.normal, platform.tool_point)
    errors, counts, still = [], [], 0
    for (before, now), sample in zip(pairwise(conditions), samples[1:], strict=True):
        still = still + 1 if np.array_equal(before, now) else 0
        if still < SETTLED:
            continue
        pose = table.mechanism.forward(now[:2])
        normal = platform.normal
        errors.append(
            np.linalg.norm(np.cross(sample.pose_rotation @ normal, pose.platform @ normal))
        )
        turned = objective.matrix(pose)[:, 3:] @ table.mechanism.jacobian(pose)
        counts.append(step / np.sqrt(12.0) * np.linalg.norm(turned))
    assert len(errors) > 50
    return np.sqrt(np.mean(np.square([errors, counts]), axis=1))


def most_turns_at_a_reversal(wanted, correction, least):
    """Return how often a correction changes its direction where its motor does, at worst."""
    worst = []
    for angle, added in zip(wanted.T, correction.T, strict=True):
        sense = 0.0
        for i, step in enumerate(np.sign(np.diff(angle)), start=1):
            if step and step == -sense:
                window = added[i - 1 : i + WINDOW + 1]
                # Only steps that are larger than what the corrector may leave.
                moves = np.sign(np.diff(window))[np.abs(np.diff(window)) > least]
                worst.append(int(np.count_nonzero(moves[1:] != moves[:-1])))
            sense = step or sense
    assert len(worst) > 8
    return max(worst)


def recorded(graph, wrist, table, path):
    """Record an experiment while the corrector passes commands on."""
    recorder = graph.add(Recorder, output=str(path))
    notes = graph.probe.create_publisher(String, "/recording_notes", NOTES_QOS)
    known = {"calibrated": COMMISSIONED}
    graph.until(notes.get_subscription_count, "recorder")
    notes.publish(String(data=json.dumps(known)))
    wrist.work(cell_of(table, 30.0, seed=41), 0.0, 30.0)
    graph.executor.remove_node(recorder)
    recorder.destroy_node()


def test_record_diagnose_extend_reload_and_the_true_error_falls(graph, model, tmp_path):
    path, extended = tmp_path / "model.yaml", tmp_path / "extended.yaml"
    save_model(model, path)
    graph.add(AngleCorrector, model_file=str(path), load_policy="follow")
    graph.listen(JointState, CORRECTED)
    graph.connected(CORRECTED)
    wrist = Wrist(graph)

    recording = tmp_path / "recorded.mcap"
    recorded(graph, wrist, model.table, recording)
    session = read_session(recording, model.table)
    answer = diagnose_sessions(load_model(path), [session])
    assert [finding.name for finding in answer.diagnosis.findings] == ["backlash@motor_1"]
    found = effect_named(answer.diagnosis.findings[0].name)
    extend_model(path, found, Recordings([recording], {}), extended, Run("test", "2026-01-01"))

    def is_enabled():
        graph.load(1)
        asked = SetBool.Request(data=True)
        return graph.call(SetBool, "/angle_corrector/enable", asked).success

    graph.until(is_enabled, "correction, once the load is there")
    cell = cell_of(with_fine_counts(model.table), 20.0, seed=7)
    before, count = pointing_at_rest(model.table, *wrist.work(cell, 0.0, 20.0))
    extended.replace(path)
    reload = graph.probe.create_client(Trigger, "/angle_corrector/reload_model")
    graph.until(reload.service_is_ready, "reload_model")
    answers = []

    def reload_on_the_way(step):
        if step == 0:
            answers.append(reload.call_async(Trigger.Request()))

    wrist.work(cell, 20.0, 5.0, after=reload_on_the_way)
    graph.until(answers[0].done, "reloaded model")
    assert answers[0].result().success
    samples, conditions = wrist.work(cell, 25.0, 20.0)
    after, _ = pointing_at_rest(model.table, samples, conditions)
    assert before > 3.0 * count
    assert np.hypot(after, count) < 1.2 * count
    sent = np.array([answer.position for answer in graph.heard[CORRECTED][-len(samples) :]])
    wanted = conditions[:, :2]
    deadband = SafetySettings().deadband_steps * model.table.geometry.limits.encoder_step
    assert most_turns_at_a_reversal(wanted, sent - wanted, deadband) <= 1
    # Each command has had one answer, those during the reload too.
    assert len(graph.heard[CORRECTED]) == wrist.sent
