"""`wrist-stiffness calibrate` and `extend`: fit a model to one wrist, and write it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import FIT, MODEL, model_named, recordings_named
from wrist_stiffness.cli.parser import (
    command,
    group,
    named_numbers,
    one_of,
    option,
    repeated,
    say,
    this_run,
)
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError

if TYPE_CHECKING:
    from wrist_stiffness.commands.extend import FormulaEffect
    from wrist_stiffness.model.effect import Effect


@command(MODEL, *FIT)
def calibrate(arguments: argparse.Namespace) -> int:
    """Fit a model to one wrist as it was set up.

    Commissioning. Fit what differs from session to session (registration of the pose sensor, its
    target on the platform, encoder zeros, the load sensor's tare) and from wrist to wrist (axes,
    flange gaps, stiffness of links and bushings, the load sensor's scale) to recordings with
    measured poses, each within what is usual, and write the model as it holds for the newest
    recording. Without this step a comparison with measurements shows little but the registration.

    for example:
      wrist-stiffness calibrate --fit monday -o wrist_7.yaml
      wrist-stiffness calibrate wrist_7.yaml --fit monday tuesday -o wrist_7.yaml --overwrite

    The last recording, or the end of the only one, judges a fit that has not seen it; what is
    written is fitted to all. Record poses all over the workspace from both sides, loads of several
    sizes and directions, and none. What a recording does not tell stays as it was, and is said. A
    recording whose notes (/recording_notes) hold {"calibrated": ["encoder_offset"]} keeps such
    effects as the model has them.
    """
    from wrist_stiffness.commands.calibrate import calibrate_model
    from wrist_stiffness.report.fit_lines import calibration_lines

    found = calibrate_model(
        model_named(arguments),
        recordings_named(arguments.fit, arguments),
        arguments.output,
        this_run(),
        Progress("calibrate"),
        Progress("a likely mistake put right"),
    )
    lines = [*calibration_lines(found), "", f"written: {arguments.output}"]
    return say(arguments, lines, found.as_values())


@command(
    MODEL,
    one_of(
        option("--effect", "an effect of the catalogue", "NAME@COMPONENT"),
        option(
            "--effect-file",
            "a law of your own in Python; the file is run as a program",
            "FILE.py:CLASS@COMPONENT",
        ),
        option("--formula", "a law of your own as a formula", "TEXT"),
        required=True,
    ),
    group(
        "with --formula",
        option("--component", "where it is"),
        option(
            "--direction",
            "which way, in the words of compare ('along +z', 'about (-0.38, -0.88, 0.29)'), "
            "or the screw for a value of 1 in six numbers, translation [m] and rotation [rad]; at "
            "O in the component's home frame; at load_sensor the wrench [N, N m] at O in F, at "
            "tool that in U; of several formulas, 'ONE, OTHER', as many: 'along +x; along +y'",
            "D",
            nargs="+",
        ),
        option("--name", "its name (default: own_formula)", default="own_formula"),
    ),
    repeated(
        "--start",
        "PARAMETER=VALUE",
        "with --formula: size of a parameter that would not surprise, in the unit of its name "
        "(default: 1)",
    ),
    *FIT,
)
def extend(arguments: argparse.Namespace) -> int:
    r"""Add one effect to a model and fit it.

    Add one effect to a model, fit it to recordings together with everything that is there, and
    write the new model, which predict, replay and the nodes use as it is. The error before and
    after is that of a part which the fit does not see: the last recording, or the end of the only
    one. The effect is added even where it does not help; then a WARNING says so.

    for example:
      wrist-stiffness extend wrist_7.yaml --effect joint_clearance@joint_3 --fit monday -o worn.yaml
      wrist-stiffness extend wrist_7.yaml --effect-file laws.py:Twist@platform --fit monday \
          -o own.yaml
      wrist-stiffness extend wrist_7.yaml --formula 'sag_mdeg * tanh(fz / soft_N)' \
          --component link_2 --direction 'about +x' --start soft_N=0.5 --fit monday -o own.yaml

    In a formula a name that ends in a unit (_um, _mdeg, _N ...) is a parameter, in SI units inside
    the formula; so is a name for which --start gives a value. All others are signals, or covariates
    of the recordings.
    """
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
            if ".py" in arguments.effect:
                raise InputError(
                    f"effect {arguments.effect!r}: a law in a Python file goes after --effect-file"
                )
            return effect_named(arguments.effect)
        return own_effect(arguments.effect_file)
    if arguments.component is None or arguments.direction is None:
        raise InputError("--formula needs --component and --direction")
    start = named_numbers(arguments.start, "--start")
    direction = direction_of(arguments.direction)
    return FormulaEffect(arguments.name, arguments.component, direction, arguments.formula, start)
