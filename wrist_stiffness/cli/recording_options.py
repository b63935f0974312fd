"""Options that every command shares which reads recordings."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.compensation.settings import StreamSettings


def add_recording_options(
    parser: argparse.ArgumentParser, parameters: str = "sensor frames, age limit of loads"
) -> None:
    """Add `--topic`, `--joint` and `--parameters`, of which the command uses these parameters."""
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="STANDARD:=ACTUAL",
        help="a topic's name in the recordings; may be repeated",
    )
    parser.add_argument(
        "--joint",
        action="append",
        default=[],
        metavar="NAME",
        help="name of motor 1, then of motor 2 (default: motor_1_joint, motor_2_joint)",
    )
    parser.add_argument(
        "--parameters",
        metavar="FILE",
        help=f"the nodes' ROS 2 parameter file: {parameters}",
    )


def recordings_named(paths: list[str], arguments: argparse.Namespace) -> Recordings:
    """Return the recordings of a command with those options.

    Raises
    ------
    InputError
        If an option cannot be read.
    """
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.topics import parse_topic_remaps

    settings, _ = settings_named(arguments)
    return Recordings(paths, parse_topic_remaps(arguments.topic), settings)


def settings_named(arguments: argparse.Namespace) -> tuple[StreamSettings, StreamSettings]:
    """Return the settings of predictor and corrector by those options.

    Raises
    ------
    InputError
        If an option cannot be read.
    """
    from wrist_stiffness.commands.parameter_file import node_settings
    from wrist_stiffness.errors import InputError

    if len(arguments.joint) not in (0, 2):
        raise InputError(f"--joint names both motors or none, not {len(arguments.joint)}")
    return node_settings(arguments.parameters, arguments.joint)
