"""`wrist-stiffness explain`: why the platform is off at one pose."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import add_pose, model_named, whole_load
from wrist_stiffness.cli.parser import Commands, add_command, named_numbers, say

POSE = ("X", "Y", "Z", "QX", "QY", "QZ", "QW")

DESCRIPTION = """\
Say why the platform is off at given motor angles under a given load: the error split by component
and by effect.  Each part is given along the whole shift and about the whole rotation axis, so that
the parts add up; a negative part holds the others back."""

EPILOG = """\
examples:
  wrist-stiffness explain --angles 20 -10 --load 0 0 -1
  wrist-stiffness explain --angles 0 0 --load 0 0 -1 --measured 0.001 0 -0.012 0 0 0.0001 1"""


def add_parser(commands: Commands) -> None:
    """Add the parser of `explain`."""
    what = "why the platform is off at one pose"
    parser = add_command(commands, "explain", what, (DESCRIPTION, EPILOG), _run)
    add_pose(parser)
    parser.add_argument(
        "--measured",
        nargs=7,
        type=float,
        metavar=POSE,
        help="measured pose: the platform's point O in wrist_base [mm] and its quaternion",
    )
    parser.repeated("--temperature", "PART=DEGC", "temperature of a component or of ambient")
    used = "value of a covariate that the model's formulas use"
    parser.repeated("--covariate", "NAME=VALUE", used)


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from wrist_stiffness.commands.explain import explain
    from wrist_stiffness.model.block import Load
    from wrist_stiffness.report.terminal import explanation_lines

    load = np.array(whole_load(arguments.load))
    measured = arguments.measured
    if measured is not None:
        measured = [*(1e-3 * value for value in measured[:3]), *measured[3:]]
    found = explain(
        model_named(arguments),
        np.radians(arguments.angles).tolist(),
        Load(load, arguments.on_platform),
        measured,
        named_numbers(arguments.temperature, "--temperature"),
        named_numbers(arguments.covariate, "--covariate"),
    )
    return say(arguments, explanation_lines(found), found.as_values())
