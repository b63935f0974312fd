"""Options that several commands share, and what they stand for."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from wrist_stiffness.cli.parser import Option, flag, one_of, option, output, repeated
from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file

if TYPE_CHECKING:
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.compensation.settings import StreamSettings
    from wrist_stiffness.lookup.table import Table


def _model_file(text: str) -> str:
    """Refuse a number that the option before did not take."""
    if re.fullmatch(r"[-+]?[\d.,]+", text) and not Path(text).exists():
        raise argparse.ArgumentTypeError(f"{text} is no file; is it a number too many?")
    return text


MODEL = option("model", "model file (default: the shipped wrist's)", nargs="?", type=_model_file)
MODEL_OPTION = option("--model", "model file (default: the shipped wrist's)", "FILE")

RECORDING = option("recording", "rosbag2 folder with MCAP storage, or a .mcap file")

LOAD = option(
    "--load",
    "force [N], or force [N] and moment [N m], on the platform at O (default: none)",
    "N",
    nargs="+",
    type=float,
    default=[0.0] * 6,
)
"""Read by `whole_load`."""

POSE = (
    MODEL,
    option("--angles", "motor angles [deg]", "DEG", nargs=2, type=float, required=True),
    LOAD,
    flag("--on-platform", "the load's axes turn with the platform"),
)


def sensor_names(used: str = "sensor frames, age limit of loads") -> tuple[Option, ...]:
    """Return the names in recordings and the parameters, of which the command uses these."""
    motors = "name of motor 1, then of motor 2 (default: motor_1_joint, motor_2_joint)"
    return (
        repeated("--topic", "STANDARD:=ACTUAL", "a topic's name in the recordings"),
        repeated("--joint", "NAME", motors),
        option("--parameters", f"the nodes' ROS 2 parameter file: {used}", "FILE"),
    )


SENSOR_NAMES = sensor_names()
"""Read by `recordings_named` and `settings_named`."""

JUDGING = (
    option("recordings", "recording, or folder of recordings", "RECORDING", nargs="+"),
    one_of(
        option("--report", "write a report with pictures here", "OUT.html"),
        flag("--each", "every recording is of a wrist of its own: one line for each, in parallel"),
    ),
    *SENSOR_NAMES,
)
"""The recordings that a model is judged by, of one wrist or (`--each`) of many."""

FIT = (
    option(
        "--fit",
        "recordings with measured poses, or folders of such; each is a session of one wrist",
        "RECORDING",
        action="extend",
        nargs="+",
        required=True,
    ),
    output("MODEL2", "file to write"),
    flag("--overwrite", "replace an existing MODEL2"),
    *SENSOR_NAMES,
)
"""Of commands that write a fitted model."""


def model_named(arguments: argparse.Namespace) -> Path:
    """Return the model file that is named, or the shipped one."""
    return Path(arguments.model or shipped_file("config/palmieri2015_model.yaml"))


def table_named(arguments: argparse.Namespace) -> Table:
    """Return the lookup table that is named, or the shipped one (WristError if unreadable)."""
    from wrist_stiffness.lookup.table_file import load_table

    return load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz"))


def whole_load(numbers: list[float]) -> list[float]:
    """Return force and moment of `--load`, 6 numbers (InputError if there are not 3 or 6)."""
    if len(numbers) not in (3, 6):
        raise InputError(f"--load takes 3 or 6 numbers, not {len(numbers)}")
    return [*numbers, *[0.0] * (6 - len(numbers))]


def recordings_named(paths: list[str], arguments: argparse.Namespace) -> Recordings:
    """Return the recordings of a command with those options (InputError if one is wrong)."""
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.topics import parse_topic_remaps

    settings, _ = settings_named(arguments)
    return Recordings(paths, parse_topic_remaps(arguments.topic), settings)


def settings_named(arguments: argparse.Namespace) -> tuple[StreamSettings, StreamSettings]:
    """Return the settings of predictor and corrector by those options (InputError, likewise)."""
    from wrist_stiffness.commands.parameter_file import node_settings

    if len(arguments.joint) not in (0, 2):
        raise InputError(f"--joint names both motors or none, not {len(arguments.joint)}")
    return node_settings(arguments.parameters, arguments.joint)
