"""Replay with correction and all topics written: joint states a second, and memory over length.

Run as `python bench/replay_speed.py [--seconds 30] [--long 4]`.  Baselines in the same run: mcap's
own reader and writer copying the same recording, and a node's streams called one by one.  Times are
processor time, the best of some rounds; memory is the peak of a process of its own.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.recording.messages import (
    Header,
    JointState,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")
MOTORS = ("motor_1_joint", "motor_2_joint")
STEP_NS = 1_000_000
ROUNDS = 3
LOADS = {
    "no load": np.zeros(6),
    "a payload of 80 g": np.array([0.0, 0.0, -0.8, 0.0, 0.0, 0.0]),
    "pressed aside": np.array([0.3, -0.2, -0.8, 0.005, 0.0, -0.01]),
}
MEMORIES = {
    "backlash": "{effect: backlash, component: motor_1, parameters: {width_mdeg: 20.0}}",
    "creep": "{effect: creep, component: joint_3, parameters: "
    "{delayed_percent: 30.0, time_constant_s: 4.0}}",
    "joint friction": "{effect: joint_friction, component: joint_2, parameters: "
    "{coefficient: 0.2, preload_N: 0.5, presliding_um: 5.0}}",
}
"""Effects that remember: their samples go one by one, in the order of a node."""


def record(path: Path, seconds: float, wrench: np.ndarray) -> None:
    """Write joint states, commands and loads at 1 kHz along a path."""
    force, moment = Vector3(*wrench[:3].tolist()), Vector3(*wrench[3:].tolist())
    with RecordingWriter(path, overwrite=True) as writer:
        for i in range(round(1000 * seconds)):
            stamp_ns = STEP_NS * (i + 1)
            second = 1e-9 * stamp_ns
            angles = (0.5 * float(np.sin(0.9 * second)), 0.5 * float(np.cos(0.7 * second)))
            header = Header(stamp_ns, "wrist_base")
            writer.write("/load_estimate", WrenchStamped(header, Wrench(force, moment)), stamp_ns)
            for topic in ("/joint_states", "/motor_commands"):
                writer.write(topic, JointState(Header(stamp_ns), MOTORS, angles), stamp_ns)


def copy_by_mcap(source: Path, target: Path) -> None:
    """Read and write the same messages with the mcap package."""
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out, 128 * 1024, CompressionType.ZSTD)
        writer.start("ros2")
        known: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.topic not in known and schema is not None:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.topic] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(
                known[channel.topic], message.log_time, message.data, message.publish_time
            )
        writer.finish()


def streams(
    settings: tuple[StreamSettings, StreamSettings], seconds: float, load: np.ndarray
) -> None:
    """Predict and correct the same samples one by one, without reading and writing."""
    model = load_model(MODEL)
    predicting = PredictionStream(model, settings[0])
    correcting = CorrectionStream(model, settings[1], enabled=True)
    for i in range(round(1000 * seconds)):
        stamp_ns = STEP_NS * (i + 1)
        second = 1e-9 * stamp_ns
        angles = (0.5 * float(np.sin(0.9 * second)), 0.5 * float(np.cos(0.7 * second)))
        for stream in (predicting, correcting):
            stream.loads.add(stamp_ns, "wrist_base", load[:3].tolist(), load[3:].tolist())
        predicting.on_joint_state(stamp_ns, MOTORS, angles)
        correcting.on_command(stamp_ns, "", MOTORS, angles)


def remembering(path: Path, effects: list[str]) -> Path:
    """Write a model with effects that remember."""
    table = shipped_file("precomputed/palmieri2015.npz")
    listed = "\n".join(f"- {effect}" for effect in effects)
    path.write_text(f"schema: 1\nname: bench\ntable: {{path: {table}}}\neffects:\n{listed}\n")
    return path


def processor_seconds(action: Callable[[], object]) -> float:
    """Return the least processor time of some rounds."""
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.process_time()
        action()
        best = min(best, time.process_time() - start)
    return best


def peak_mb(source: Path) -> float:
    """Return the largest memory of a process that replays a recording."""
    run = subprocess.run(
        [sys.executable, __file__, "--peak", str(source)],
        capture_output=True,
        text=True,
        check=True,
    )
    return float(run.stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the recording")
    parser.add_argument("--long", type=int, default=4, help="a second one is so many times as long")
    parser.add_argument("--peak", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peak:
        replay(options.peak, MODEL, Path(options.peak).with_suffix(".out.mcap"), overwrite=True)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
        return
    own = node_settings(None)
    follow = own[0], replace(own[1], supervisor=SupervisorSettings(follow=True))
    n = round(1000 * options.seconds)
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "in.mcap", Path(folder) / "out.mcap"
        print(f"{'':41} joint states/s   us each   over mcap's copy")
        for name, load in LOADS.items():
            record(source, options.seconds, load)
            copied = processor_seconds(lambda: copy_by_mcap(source, target))
            rows = {"mcap copies the input": copied}
            for what, settings in (("replay", own), ("replay, every load followed", follow)):
                rows[what] = processor_seconds(
                    lambda s=settings: replay(source, MODEL, target, s, overwrite=True)
                )
            rows["streams alone, one by one"] = processor_seconds(
                lambda load=load: streams(own, options.seconds, load)
            )
            for what, seconds in rows.items():
                rate = n / seconds
                print(
                    f"{name + ': ' + what:46} {rate:9.0f} {1e6 / rate:9.1f} {seconds / copied:9.2f}"
                )
        record(source, options.seconds / 10.0, LOADS["a payload of 80 g"])
        for chosen in [*([name] for name in MEMORIES), [*MEMORIES]]:
            model = remembering(Path(folder) / "model.yaml", [MEMORIES[name] for name in chosen])
            seconds = processor_seconds(
                lambda model=model: replay(source, model, target, own, overwrite=True)
            )
            rate = 0.1 * n / seconds
            what = f"80 g, {' + '.join(chosen)}: replay"
            print(f"{what:46} {rate:9.0f} {1e6 / rate:9.1f} {10.0 * seconds / copied:9.2f}")
        topics = {topic.name: topic.count for topic in open_recording(target).topics}
        print(f"topics written: {', '.join(sorted(topics))}")
        short = peak_mb(source)
        record(source, options.long * options.seconds, LOADS["pressed aside"])
        print(
            f"peak memory: {short:.0f} MB, of {options.long} times the length {peak_mb(source):.0f}"
        )


if __name__ == "__main__":
    main()
