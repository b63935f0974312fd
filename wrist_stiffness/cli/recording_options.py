"""Options that every command shares which reads recordings with measured poses."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wrist_stiffness.workflows.read_sessions import Recordings


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add `--topic`, `--joint` and `--parameters`."""
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
        help="the nodes' ROS 2 parameter file: sensor frames, age limit of loads",
    )


def recordings_named(paths: list[str], arguments: argparse.Namespace) -> Recordings:
    """Return the recordings of a command with those options.

    Raises
    ------
    InputError
        If an option cannot be read.
    """
    from wrist_stiffness.errors import InputError
    from wrist_stiffness.recording.topics import parse_topic_remaps
    from wrist_stiffness.workflows.parameter_file import node_settings
    from wrist_stiffness.workflows.read_sessions import Recordings

    if len(arguments.joint) not in (0, 2):
        raise InputError(f"--joint names both motors or none, not {len(arguments.joint)}")
    settings, _ = node_settings(arguments.parameters, arguments.joint)
    return Recordings(paths, parse_topic_remaps(arguments.topic), settings)
