"""`wrist-stiffness extend`: add one effect to a model and fit it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import add_fit, add_model, model_named, recordings_named
from wrist_stiffness.cli.parser import Commands, add_command, named_numbers, say, this_run
from wrist_stiffness.errors import InputError

if TYPE_CHECKING:
    from wrist_stiffness.commands.extend import FormulaEffect
    from wrist_stiffness.model.effect import Effect

DESCRIPTION = """\
Add one effect to a model, fit it to recordings together with everything that is there, and write
the new model, which predict, replay and the nodes use as it is. The error before and after is that
of a part which the fit does not see: the last recording, or the end of the only one. The effect is
added even where it does not help; then a WARNING says so."""

EPILOG = """\
examples:
  wrist-stiffness extend wrist_7.yaml --effect joint_clearance@joint_3 --fit monday -o worn.yaml
  wrist-stiffness extend wrist_7.yaml --effect-file laws.py:Twist@platform --fit monday -o own.yaml
  wrist-stiffness extend wrist_7.yaml --formula 'sag_mdeg * tanh(fz / soft_N)' --component link_2 \\
      --direction 'about +x' --start soft_N=0.5 --fit monday -o own.yaml

In a formula every name that is no signal and no covariate of the recordings is a parameter. A
parameter whose name ends in a unit (_um, _mdeg, _N ...) is in SI units inside the formula."""


def add_parser(commands: Commands) -> None:
    """Add the parser of `extend`."""
    what = "add one effect to a model and fit it"
    parser = add_command(commands, "extend", what, (DESCRIPTION, EPILOG), _run)
    add_model(parser)
    added = parser.add_mutually_exclusive_group(required=True)
    added.add_argument("--effect", metavar="NAME@COMPONENT", help="an effect of the catalogue")
    added.add_argument(
        "--effect-file",
        metavar="FILE.py:CLASS@COMPONENT",
        help="a law of your own in Python; the file is run as a program",
    )
    added.add_argument("--formula", metavar="TEXT", help="a law of your own as a formula")
    own = parser.add_argument_group("with --formula")
    own.add_argument("--component", help="where it is")
    own.add_argument(
        "--direction",
        nargs="+",
        metavar="D",
        help="which way, in the words of compare ('along +z', 'about (-0.38, -0.88, 0.29)'), or "
        "the screw for a value of 1 in six numbers, translation [m] and rotation [rad]; at O in "
        "the component's home frame; at load_sensor the wrench [N, N m] at O in F, at tool "
        "that in U; of several formulas, 'ONE, OTHER', as many: 'along +x; along +y'",
    )
    own.add_argument("--name", default="own_formula", help="its name (default: own_formula)")
    usual = "size of a parameter that would not surprise, in the unit of its name (default: 1)"
    parser.repeated("--start", "PARAMETER=VALUE", f"with --formula: {usual}")
    add_fit(parser)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.extend import extend_model
    from wrist_stiffness.report.fit_lines import extension_lines

    found = extend_model(
        model_named(arguments),
        _addition(arguments),
        recordings_named(arguments.fit, arguments),
        arguments.output,
        this_run(),
        Progress("extend"),
    )
    lines = [*extension_lines(found), "", f"written: {arguments.output}"]
    return say(arguments, lines, found.as_values())


def _addition(arguments: argparse.Namespace) -> Effect | FormulaEffect:
    from wrist_stiffness.commands.extend import FormulaEffect, direction_of, own_effect
    from wrist_stiffness.model.registry import effect_named

    if arguments.formula is None:
        if arguments.component or arguments.direction or arguments.start:
            raise InputError("--component, --direction and --start belong to --formula")
        if arguments.effect is not None:
            return effect_named(arguments.effect)
        return own_effect(arguments.effect_file)
    if arguments.component is None or arguments.direction is None:
        raise InputError("--formula needs --component and --direction")
    start = named_numbers(arguments.start, "--start")
    direction = direction_of(arguments.direction)
    return FormulaEffect(arguments.name, arguments.component, direction, arguments.formula, start)
