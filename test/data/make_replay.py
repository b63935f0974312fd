"""Make the recording of the replay regression again, and what its replays give.

    python test/data/make_replay.py             the stored results, after a change that was meant
    python test/data/make_replay.py --recording  the recording, too

Before that, look at what changed; MODEL and NAME are `config/palmieri2015_model.yaml` and `plain`,
or `test/data/replay/effects.yaml` and `effects`:

    wrist-stiffness replay test/data/replay/recording.mcap --model MODEL -o out.mcap \\
        --parameters test/data/replay/parameters.yaml --against test/data/replay/NAME.mcap
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay import OUTPUTS, replay
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    JointTrajectory,
    JointTrajectoryPoint,
    Message,
    Temperature,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.shipped import shipped_file

FOLDER = Path(__file__).parent / "replay"
RECORDING, PARAMETERS = FOLDER / "recording.mcap", FOLDER / "parameters.yaml"
MODELS = {
    "plain": shipped_file("config/palmieri2015_model.yaml"),
    "effects": FOLDER / "effects.yaml",
}
"""Model by the name of its results."""

SECONDS, RATE_HZ, START_S = 12.0, 10.0, 1000.0
SENSORS = ("motor_2_joint", "gripper", "motor_1_joint")
COMMANDED = ("motor_1_joint", "motor_2_joint")

# t [s]         0   1   2   3   4   5   6   7   8   9   10  11
# speeds given  -------------
# load          --------- weight ---------      contact     weight
# load silent                       --------
# link_1        -----------                             --------
# NaN, domain               x       x
# trajectory                    x
# border fade     x           x           x         (motor_1)


def joints(stamp_ns: int, names: tuple[str, ...], theta: dict[str, float], speed: bool) -> Message:
    """Return a joint state, with speeds or without."""
    angles = tuple(theta[name] for name in names)
    speeds = tuple(0.1 * np.cos(angle) for angle in angles) if speed else ()
    return JointState(Header(stamp_ns), names, angles, speeds)


def plan(stamp_ns: int) -> Message:
    """Return a trajectory with speeds, and with accelerations at its end."""
    points = [
        JointTrajectoryPoint((0.1 * i, 0.2), (0.3, -0.1 * i), (1.0, 0.5) if i == 4 else (), (), i)
        for i in range(5)
    ]
    return JointTrajectory(Header(stamp_ns), COMMANDED, tuple(points))


def messages(rng: np.random.Generator) -> list[tuple[float, str, Message]]:
    """Return time [s], topic and message of everything in the recording, by time."""
    found: list[tuple[float, str, Message]] = []
    for i in range(round(SECONDS * RATE_HZ)):
        time = i / RATE_HZ
        stamp = round((START_S + time) * 1e9)
        theta = {
            "motor_1_joint": 1.3 * np.sin(0.9 * time),
            "motor_2_joint": 0.4 * np.sin(1.3 * time + 1.0),
            "gripper": 0.01 * time,
        }
        if i % 10 == 0:
            found.append((time, "/covariates/humidity", Float64(50.0 + 2.0 * time)))
            if not 3.0 <= time < 9.0:
                warm = Temperature(Header(stamp, "link_1"), 25.0 + time)
                found.append((time, "/temperatures", warm))
        if not 5.5 < time < 7.5:
            force = np.array([0.1, 0.0, 1.0 + 0.8 * (8.0 <= time < 10.0)])
            force += 0.01 * rng.normal(size=3)
            moment = Vector3(*(1e-3 * rng.normal(size=3)).tolist())
            wrench = Wrench(Vector3(*force.tolist()), moment)
            found.append((time, "/load_estimate", WrenchStamped(Header(stamp, "ft"), wrench)))
        measured = dict(theta)
        if time == 3.5:
            measured["motor_1_joint"] = float("nan")
        if time == 5.0:
            measured["motor_2_joint"] = 2.0
        found.append((time, "/joint_states", joints(stamp, SENSORS, measured, time < 3.0)))
        found.append((time, "/motor_commands", joints(stamp, COMMANDED, theta, time < 3.0)))
        if time == 4.0:
            found.append((time, "/motor_trajectory", plan(stamp)))
    return found


def replayed(name: str, output: Path) -> None:
    """Replay the recording with one of the models."""
    replay(RECORDING, MODELS[name], output, node_settings(PARAMETERS))


def main() -> None:
    """Write the results, and the recording if asked to."""
    if "--recording" in sys.argv:
        with RecordingWriter(RECORDING, overwrite=True) as writer:
            for time, topic, message in messages(np.random.default_rng(5)):
                writer.write(topic, message, round((START_S + time) * 1e9))
    for name in MODELS:
        with TemporaryDirectory() as folder:
            replayed(name, Path(folder) / "out.mcap")
            with RecordingWriter(FOLDER / f"{name}.mcap", overwrite=True) as writer:
                for raw in open_recording(Path(folder) / "out.mcap").raw_messages(OUTPUTS):
                    writer.write_raw(raw.channel, raw.payload, raw.log_time_ns)


if __name__ == "__main__":
    main()
