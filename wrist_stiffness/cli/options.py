"""Options that several commands share, and what they stand for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wrist_stiffness.cli.parser import OneLineParser
from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file

if TYPE_CHECKING:
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.compensation.settings import StreamSettings
    from wrist_stiffness.lookup.table import Table


def add_model(parser: OneLineParser, name: str = "model") -> None:
    """Add the model, as an argument or under the name of an option."""
    option = name.startswith("-")
    parser.add_argument(
        name,
        nargs=None if option else "?",
        metavar="FILE" if option else None,
        help="model file (default: the shipped wrist's)",
    )


def model_named(arguments: argparse.Namespace) -> Path:
    """Return the model file that is named, or the shipped one."""
    return Path(arguments.model or shipped_file("config/palmieri2015_model.yaml"))


def table_named(arguments: argparse.Namespace) -> Table:
    """Return the lookup table that is named, or the shipped one (WristError if unreadable)."""
    from wrist_stiffness.lookup.table_file import load_table

    return load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz"))


def add_load(parser: OneLineParser) -> None:
    """Add `--load`, which `whole_load` reads."""
    parser.add_argument(
        "--load",
        nargs="+",
        type=float,
        default=[0.0] * 6,
        metavar="N",
        help="force [N], or force [N] and moment [N m], on the platform at O (default: none)",
    )


def whole_load(numbers: list[float]) -> list[float]:
    """Return force and moment of `--load`, 6 numbers (InputError if there are not 3 or 6)."""
    if len(numbers) not in (3, 6):
        raise InputError(f"--load takes 3 or 6 numbers, not {len(numbers)}")
    return [*numbers, *[0.0] * (6 - len(numbers))]


def add_pose(parser: OneLineParser) -> None:
    """Add the model, `--angles`, `--load` and `--on-platform`."""
    add_model(parser)
    parser.add_argument(
        "--angles", nargs=2, type=float, required=True, metavar="DEG", help="motor angles [deg]"
    )
    add_load(parser)
    parser.flag("--on-platform", "the load's axes turn with the platform")


def add_sensor_names(
    parser: OneLineParser, parameters: str = "sensor frames, age limit of loads"
) -> None:
    """Add `--topic`, `--joint` and `--parameters`, of which the command uses these parameters."""
    parser.repeated("--topic", "STANDARD:=ACTUAL", "a topic's name in the recordings")
    motors = "name of motor 1, then of motor 2 (default: motor_1_joint, motor_2_joint)"
    parser.repeated("--joint", "NAME", motors)
    parser.add_argument(
        "--parameters", metavar="FILE", help=f"the nodes' ROS 2 parameter file: {parameters}"
    )


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


def add_compared_recordings(parser: OneLineParser) -> None:
    """Add the recordings that a model is judged by, of one wrist or (`--each`) of many."""
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="recording, or folder of recordings"
    )
    parser.add_argument("--report", metavar="OUT.html", help="write a report with pictures here")
    each = "every recording is of a wrist of its own: one line for each, in parallel"
    parser.flag("--each", each)
    add_sensor_names(parser)


def for_each(arguments: argparse.Namespace) -> bool:
    """Tell whether every recording is taken by itself (InputError beside `--report`)."""
    if arguments.each and arguments.report:
        raise InputError("--report draws one wrist; leave out --each")
    return bool(arguments.each)


def add_fit(parser: OneLineParser) -> None:
    """Add the options of commands that write a fitted model."""
    parser.add_argument(
        "--fit",
        action="extend",
        nargs="+",
        required=True,
        metavar="RECORDING",
        help="recordings with measured poses, or folders of such; each is a session of one wrist",
    )
    parser.add_argument("-o", "--output", required=True, metavar="MODEL2", help="file to write")
    parser.flag("--overwrite", "replace an existing MODEL2")
    add_sensor_names(parser)
