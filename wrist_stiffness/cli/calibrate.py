"""`wrist-stiffness calibrate`: fit a model to one wrist as it was set up."""

from __future__ import annotations

import argparse
from pathlib import Path

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.recording_options import add_recording_options, recordings_named
from wrist_stiffness.errors import InputError

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


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `calibrate`."""
    parser = commands.add_parser(
        "calibrate",
        help="fit a model to one wrist as it was set up",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("model", nargs="?", help="model file (default: the shipped wrist's)")
    add_fit_options(parser)
    parser.set_defaults(run=_run)


def add_fit_options(parser: argparse.ArgumentParser) -> None:
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
    parser.add_argument("--overwrite", action="store_true", help="replace an existing MODEL2")
    add_recording_options(parser)
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")


def require_new_model(arguments: argparse.Namespace) -> None:
    """Refuse to replace a model that nobody asked to replace.

    Raises
    ------
    InputError
        If the output is there and `--overwrite` is not.
    """
    if Path(arguments.output).is_file() and not arguments.overwrite:
        raise InputError(
            f"{arguments.output} exists already and is not overwritten; choose another "
            "name, or --overwrite"
        )


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.cli.this_run import this_run
    from wrist_stiffness.commands.calibrate import calibrate_model
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.report.fit_lines import calibration_lines
    from wrist_stiffness.shipped import shipped_file

    require_new_model(arguments)
    found = calibrate_model(
        arguments.model or shipped_file("config/palmieri2015_model.yaml"),
        recordings_named(arguments.fit, arguments),
        arguments.output,
        this_run(),
        Progress("calibrate"),
        Progress("a likely mistake put right"),
    )
    print("\n".join(calibration_lines(found)))
    print(f"\nwritten: {arguments.output}")
    if arguments.json:
        write_json(arguments.json, found.as_values())
    return EXIT_DONE
