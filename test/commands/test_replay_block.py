"""A replay in blocks: what a node would have sent, to the bit, also of a recording with faults."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np
import pytest

from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.commands.replay_block import BlockReplay
from wrist_stiffness.commands.signals_ahead import LOOKAHEAD_NS
from wrist_stiffness.commands.wrist_drawing import Pace, WristDrawing
from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import WristError
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording import chunk_writer
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Temperature,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import Recording, open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    angles_payload,
    error_payload,
    joint_payload,
    vector_payload,
)
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")
MOTORS = ("motor_1_joint", "motor_2_joint")
EFFECTS = """
schema: 1
name: effects with a memory
table: {{path: {table}}}
effects:
- {{effect: backlash, component: motor_1, parameters: {{width_mdeg: [20.0, 2.0]}}}}
- {{effect: joint_friction, component: joint_2, parameters: {{coefficient: 0.2}}}}
- effect: thermal_expansion
  component: link_1
  parameters: {{expansion_ppm_per_K: 70.0, lag_s: 3.0}}
- effect: formula
  id: drag
  component: platform
  direction: [0, 0, 1, 0, 0, 0]
  expression: "drag_um * theta_dot_1"
  parameters: {{drag_um: 1.0}}
"""
STEP_NS, DURATION_NS = 2_000_000, 5_200_000_000
FAR, HEAVY, LATE, GAP, JUMP, EMPTY = 0.6, 1.0, 1.4, 1.8, 4.8, 5.0
"""Seconds at which: the pose is out of the domain, the load beyond the table, a load comes after
its joint state, loads are missing for a second, the clock jumps back, a command is not finite."""


@dataclass(frozen=True)
class Signals:
    """A path with faults, a sample each `step_ns`; NaN where no load came."""

    step_ns: int

    def __len__(self):
        return DURATION_NS // self.step_ns

    def at(self, seconds):
        return round(1e9 * seconds / self.step_ns)

    @cached_property
    def found(self):
        """Stamps [ns], angles [rad] and wrenches."""
        stamps = self.step_ns * np.arange(1, len(self) + 1)
        stamps[self.at(JUMP) :] -= 1_200_000_000
        second = 1e-9 * self.step_ns * np.arange(len(self))
        theta = 0.5 * np.stack([np.sin(4.5 * second), np.cos(3.5 * second)], axis=1)
        theta[self.at(FAR) :][:3] = 0.95
        wrench = np.zeros((len(self), 6))
        # Nothing, then a weight, then a push aside.
        wrench[second >= 0.8, 2] = -0.8
        wrench[((second >= 1.5) & (second < 1.7)) | ((second >= 3.2) & (second < 3.8)), 0] = 0.5
        wrench += 1e-4 * np.random.default_rng(5).normal(size=wrench.shape)
        wrench[self.at(HEAVY) :][:3] *= 1000.0
        wrench[self.at(GAP) : self.at(GAP + 1.0)] = np.nan
        return stamps, theta, wrench


def speeds(i):
    """Return what the drivers say of the speeds, which is not finite now and then [rad/s]."""
    return (np.nan if i % 97 == 0 else 0.01 * (i % 40), -0.2)


def recorded(path, signals):
    stamps, theta, wrench = signals.found
    late, empty = signals.at(LATE), signals.at(EMPTY)
    with RecordingWriter(path) as writer:
        for i in range(len(signals)):
            at_ns, header = signals.step_ns * (i + 1), Header(int(stamps[i]))
            force, moment = wrench[i, :3].tolist(), wrench[i, 3:].tolist()
            load = WrenchStamped(
                replace(header, frame_id="wrist_base"), Wrench(Vector3(*force), Vector3(*moment))
            )
            if np.isfinite(wrench[i]).all() and i != late:
                writer.write("/load_estimate", load, at_ns)
            angles = tuple(theta[i].tolist())
            writer.write("/joint_states", JointState(header, MOTORS, angles, speeds(i)), at_ns)
            if i == late:
                writer.write("/load_estimate", load, at_ns)
            names = ("other", *MOTORS)
            first = np.nan if i == empty else 0.5
            command = JointState(
                header, names, (first, *angles), (9.0, *speeds(i)), (1.0, 2.0, 3.0)
            )
            writer.write("/motor_commands", command, at_ns)
            if i % 50 == 0:
                link = replace(header, frame_id="link_1")
                writer.write("/temperatures", Temperature(link, 20.0 + 0.01 * i), at_ns)
            if i == 10:
                writer.write("/pose_error/s_um", Float64(1.0), at_ns)
    return path


def wanted(path, settings, signals):
    """Return the payloads that nodes would send by topic and what they refuse, one by one."""
    prediction, correction = settings
    model = load_model(path)
    predicting = PredictionStream(model, prediction)
    correcting = CorrectionStream(model, correction, enabled=True)
    stamps, theta, wrench = signals.found
    empty = signals.at(EMPTY)
    sent = {topic: [] for topic in TOPICS}
    pace, drawing = Pace(), WristDrawing(model.table.geometry, 1000.0)
    refused = heard = 0
    for i in range(len(signals)):
        stamp_ns, angles = int(stamps[i]), theta[i].tolist()
        # A replay hears loads a second ahead: that makes a difference where the clock jumps.
        while heard < min(len(signals), i + 1 + LOOKAHEAD_NS // signals.step_ns):
            load = wrench[heard].tolist()
            if np.isfinite(load).all():
                for stream in (predicting, correcting):
                    stream.loads.add(int(stamps[heard]), "wrist_base", load[:3], load[3:])
            if heard % 50 == 0:
                for stream in (predicting, correcting):
                    stream.temperatures.add("link_1", int(stamps[heard]), 20.0 + 0.01 * heard)
            heard += 1
        try:
            found = predicting.on_joint_state(stamp_ns, MOTORS, angles, speeds(i))
            payload = error_payload(stamp_ns, found.twist, found.covariance)
            sent["/pose_error_predicted"].append(payload)
            s_um, mdeg = 1e6 * found.twist[:3], 1e3 * float(np.degrees(1.0)) * found.twist[3:]
            sent["/pose_error/s_um"].append(vector_payload(stamp_ns, s_um))
            sent["/pose_error/phi_mdeg"].append(vector_payload(stamp_ns, mdeg))
            if pace.takes(stamp_ns, 10.0):
                one = np.array([stamp_ns]), found.configuration.as_block, found.twist[None]
                sent["/wrist_markers"] += drawing.payloads(*one)
        except WristError:
            refused += 1
        names, first = ("other", *MOTORS), np.nan if i == empty else 0.5
        moving = (9.0, *speeds(i))
        try:
            command = correcting.on_command(stamp_ns, "", names, (first, *angles), moving)
        except WristError:
            refused += 1
            continue
        positions = tuple(command.positions.tolist())
        efforts = (1.0, 2.0, 3.0)
        sample = JointSample(stamp_ns, "wrist_corrected", names, positions, moving, efforts)
        sent["/motor_commands_corrected"].append(joint_payload(sample))
        sent["/motor_positions_corrected"].append(angles_payload(command.theta))
        refused += command.fault is not None
        residuals = correcting.residuals(command)
        sent["/pose_error_residual"] += [error_payload(stamp_ns, *each) for each in residuals]
    return sent, refused


TOPICS = (
    "/pose_error_predicted",
    "/pose_error/s_um",
    "/pose_error/phi_mdeg",
    "/motor_commands_corrected",
    "/motor_positions_corrected",
    "/pose_error_residual",
    "/wrist_markers",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "follow", "step_ns"),
    # A model with a memory goes sample by sample in a replay as well: an eighth of them will do.
    [(False, False, STEP_NS), (False, True, STEP_NS), (True, False, 8 * STEP_NS)],
    ids=["supervised", "every load followed", "effects with a memory"],
)
def test_a_replay_is_what_nodes_send_to_the_bit(tmp_path, monkeypatch, effects, follow, step_ns):
    model, answered, signals = MODEL, [], Signals(step_ns)
    answer = BlockReplay.answer

    def noted(blocks, block):
        answered.append(answer(blocks, block))
        return answered[-1]

    monkeypatch.setattr(BlockReplay, "answer", noted)
    if step_ns > STEP_NS:
        # Fewer messages at a time too, or all would go by themselves with the clock that jumps.
        monkeypatch.setattr(Recording.blocks, "__defaults__", (None, 1))
        monkeypatch.setattr(chunk_writer, "CHUNK_BYTES", chunk_writer.CHUNK_BYTES // 4)
    if effects:
        model = tmp_path / "effects.yaml"
        model.write_text(EFFECTS.format(table=shipped_file("precomputed/palmieri2015.npz")))
    prediction, correction = node_settings(None)
    own = replace(correction, supervisor=SupervisorSettings(follow=follow))
    summary = replay(
        recorded(tmp_path / "in.mcap", signals), model, tmp_path / "out.mcap", (prediction, own)
    )
    # Before the clock jumps, and around it.
    assert [each for each, _ in groupby(answered)] == [True, False]
    sent, refused = wanted(model, (prediction, own), signals)
    found = {topic: [] for topic in TOPICS}
    for raw in open_recording(tmp_path / "out.mcap").raw_messages(TOPICS):
        found[raw.channel.topic].append(raw.payload)
    for topic in TOPICS:
        assert len(found[topic]) == len(sent[topic])
        pairs = zip(found[topic], sent[topic], strict=True)
        different = [i for i, (one, other) in enumerate(pairs) if one != other]
        assert not different, f"{topic}: {len(different)}, the first {different[0]}"
    assert summary.refused.total() == refused > 50
    assert summary.replaced == 1
    assert 0 < summary.corrections < summary.commands == len(signals)


def test_answers_follow_their_messages_in_time(tmp_path):
    replay(recorded(tmp_path / "in.mcap", Signals(STEP_NS)), MODEL, tmp_path / "out.mcap")
    at_joints = 0
    before = -1
    for raw in open_recording(tmp_path / "out.mcap").raw_messages():
        assert raw.log_time_ns >= before
        before = raw.log_time_ns
        if raw.channel.topic == "/joint_states":
            at_joints = raw.log_time_ns
        if raw.channel.topic == "/pose_error_predicted":
            assert raw.log_time_ns == at_joints
