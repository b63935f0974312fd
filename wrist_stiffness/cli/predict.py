"""`wrist-stiffness predict`: the pose error at one pose."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import add_pose, model_named, whole_load
from wrist_stiffness.cli.parser import Commands, add_command, say

DESCRIPTION = """\
Predict how far the platform is off at given motor angles under a given load, own weight included:
s is the shift of the platform's point at O, phi the angle by which it is turned."""

EPILOG = """\
example:
  wrist-stiffness predict --angles 20 -10 --load 0 0 -1"""


def add_parser(commands: Commands) -> None:
    """Add the parser of `predict`."""
    what = "the pose error at one pose"
    parser = add_command(commands, "predict", what, (DESCRIPTION, EPILOG), _run)
    add_pose(parser)
    parser.flag("--both", "by the table's closed form and by its spline")


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from wrist_stiffness.commands.predict import predict
    from wrist_stiffness.report.terminal import prediction_lines

    load, theta = whole_load(arguments.load), np.radians(arguments.angles).tolist()
    found = predict(model_named(arguments), theta, load, arguments.on_platform, arguments.both)
    return say(arguments, prediction_lines(found, any(load)), found.as_values())
