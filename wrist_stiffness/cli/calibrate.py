"""`wrist-stiffness calibrate`: fit a model to one wrist as it was set up."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.options import add_fit, add_model, model_named, recordings_named
from wrist_stiffness.cli.parser import Commands, add_command, say, this_run

DESCRIPTION = """\
Commissioning. Fit what differs from session to session (registration of the pose sensor, its target
on the platform, encoder zeros, the load sensor's tare) and from wrist to wrist (axes, flange gaps,
stiffness of links and bushings, the load sensor's scale) to recordings with measured poses, each
within what is usual, and write the model as it holds for the newest recording. Without this step a
comparison with measurements shows little but the registration."""

EPILOG = """\
examples:
  wrist-stiffness calibrate --fit monday -o wrist_7.yaml
  wrist-stiffness calibrate wrist_7.yaml --fit monday tuesday -o wrist_7.yaml --overwrite

The last recording, or the end of the only one, judges a fit that has not seen it; what is written
is fitted to all. Record poses all over the workspace from both sides, loads of several sizes and
directions, and none. What a recording does not tell stays as it was, and is said. A recording whose
notes (/recording_notes) hold {"calibrated": ["encoder_offset"]} keeps such effects as the model has
them."""


def add_parser(commands: Commands) -> None:
    """Add the parser of `calibrate`."""
    what = "fit a model to one wrist as it was set up"
    parser = add_command(commands, "calibrate", what, (DESCRIPTION, EPILOG), _run)
    add_model(parser)
    add_fit(parser)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
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
