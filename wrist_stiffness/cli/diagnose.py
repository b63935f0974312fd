"""`wrist-stiffness diagnose`: which physical effect is missing."""

from __future__ import annotations

import argparse
from functools import partial

from wrist_stiffness.cli.options import (
    add_compared_recordings,
    add_model,
    for_each,
    model_named,
    recordings_named,
)
from wrist_stiffness.cli.parser import Commands, add_command, say, this_run

DESCRIPTION = """\
Say which physical effect a model misses, from recordings with a measured pose of the platform.
Registrations, encoder zeros, load tare and the wrist's tolerances are fitted first; then every
effect of the catalogue is tried at every place.  Every finding has a probability; effects that
the recordings cannot tell apart are named together.  The answer may be 'nothing' or 'none of
these', and then it says on what the error depends.
Several recordings are sessions of one wrist: the last one judges what the others show, so record
on two days.  Of a single recording the end judges."""

EPILOG = """\
examples:
  wrist-stiffness diagnose monday tuesday --model my_wrist.yaml --report why.html
  wrist-stiffness diagnose monday --json why.json
  wrist-stiffness diagnose all_wrists --each --json fleet.json

next: 'extend MODEL --effect NAME@COMPONENT' adds what was found; 'plan --diagnosis why.json' says
what to record where rivals remain."""


def add_parser(commands: Commands) -> None:
    """Add the parser of `diagnose`."""
    what = "which physical effect is missing in a model"
    parser = add_command(commands, "diagnose", what, (DESCRIPTION, EPILOG), _run)
    add_model(parser, "--model")
    parser.option("--probability", 90.0, "name an effect from this probability on", "PERCENT")
    parser.add_argument(
        "--seconds",
        type=float,
        default=float("inf"),
        help="begin no further fit after this time; the answer says what was not tried",
    )
    ranking = "with --json: every candidate, and what each rival changes in every unit"
    parser.flag("--ranking", ranking)
    add_compared_recordings(parser)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress, Status
    from wrist_stiffness.commands.diagnose import diagnose_recordings

    model = model_named(arguments)
    recordings = recordings_named(arguments.recordings, arguments)
    naming, seconds = arguments.probability / 100.0, arguments.seconds
    if for_each(arguments):
        from wrist_stiffness.commands.fleet import each_recording, table_values
        from wrist_stiffness.report.fleet_lines import diagnosed_lines

        one = partial(diagnose_recordings, model, run=this_run(), naming=naming, seconds=seconds)
        rows = each_recording(one, recordings, Progress("recordings"))
        return say(arguments, diagnosed_lines(rows), table_values(rows, "diagnosis"))
    from wrist_stiffness.report.diagnosis_report import diagnosis_lines, report_of_diagnosis

    with Status() as status:
        found = diagnose_recordings(
            model, recordings, this_run(), Progress, status, naming, seconds
        )
    code = say(arguments, diagnosis_lines(found), found.as_values(arguments.ranking))
    if arguments.report:
        from wrist_stiffness.report.page import write_page

        write_page(arguments.report, report_of_diagnosis(found))
    return code
