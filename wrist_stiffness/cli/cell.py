"""`wrist-stiffness cell`: all nodes and the virtual cell, started as processes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from wrist_stiffness.cli.parser import EXIT_DONE, EXIT_NO, PROG, Commands, add_command

DESCRIPTION = """\
Start pose_error_predictor, angle_corrector, model_monitor and a virtual wrist as ROS 2 nodes on
this machine. With --seconds the same motion runs twice, first without and then with correction, and
the command ends by itself; else the motion goes on until Ctrl-C and
'ros2 service call /angle_corrector/enable std_srvs/srv/SetBool "{data: true}"' switches the
correction on. Without ROS_DOMAIN_ID in the environment the nodes get a domain of their own.
Exit code 1: a node fell silent, or did not end when it was told to; one line says which."""

EPILOG = """\
example:
  wrist-stiffness cell --seconds 60 --record live
  wrist-stiffness replay live -o replayed"""


def add_parser(commands: Commands) -> None:
    """Add the parser of `cell`."""
    what = "run the nodes with a virtual wrist"
    parser = add_command(commands, "cell", what, (DESCRIPTION, EPILOG), _run, json=False)
    parser.add_argument(
        "--model", type=Path, help="model of the nodes and of the cell (default: the shipped one)"
    )
    parser.add_argument(
        "--seconds", type=float, metavar="S", help="about how long both motions take together"
    )
    parser.add_argument(
        "--record", type=Path, metavar="OUT", help="recording to write: a folder or a .mcap file"
    )
    parser.option("--rate", 100.0, "samples per second", "HZ")
    parser.option("--seed", 0, "of motion and noise")


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.cell import run_cell

    sound = run_cell(
        arguments.model,
        arguments.seconds,
        arguments.record,
        arguments.rate,
        arguments.seed,
        Progress("cell"),
        lambda line: print(f"{PROG}: {line}", file=sys.stderr),
    )
    if arguments.record is not None:
        print(f"written: {arguments.record}")
    return EXIT_DONE if sound else EXIT_NO
