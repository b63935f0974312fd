"""`wrist-stiffness diagnose`: which physical effect is missing."""

from __future__ import annotations

import argparse
from functools import partial

from wrist_stiffness.cli.fleet_options import add_fleet_options, for_each
from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.recording_options import add_recording_options, recordings_named

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


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `diagnose`."""
    parser = commands.add_parser(
        "diagnose",
        help="which physical effect is missing in a model",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="recording, or folder of recordings"
    )
    parser.add_argument("--model", metavar="FILE", help="model file (default: the shipped wrist's)")
    parser.add_argument("--report", metavar="OUT.html", help="write a report with pictures here")
    parser.add_argument(
        "--probability",
        type=float,
        default=90.0,
        metavar="PERCENT",
        help="name an effect from this probability on (default: %(default)g)",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=float("inf"),
        help="begin no further fit after this time; the answer says what was not tried",
    )
    parser.add_argument(
        "--ranking",
        action="store_true",
        help="with --json: every candidate, and what each rival changes in every unit",
    )
    add_fleet_options(parser)
    add_recording_options(parser)
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress, Status
    from wrist_stiffness.cli.this_run import this_run
    from wrist_stiffness.commands.diagnose import diagnose_recordings
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.shipped import shipped_file

    model = arguments.model or shipped_file("config/palmieri2015_model.yaml")
    recordings = recordings_named(arguments.recordings, arguments)
    if for_each(arguments):
        from wrist_stiffness.commands.fleet import each_recording, table_values
        from wrist_stiffness.report.fleet_lines import diagnosed_lines

        one = partial(diagnose_recordings, model, run=this_run())
        rows = each_recording(one, recordings, arguments.scheduler, Progress("recordings"))
        lines, values = diagnosed_lines(rows), table_values(rows, "diagnosis")
    else:
        from wrist_stiffness.report.diagnosis_lines import diagnosis_lines

        with Status() as status:
            found = diagnose_recordings(
                model,
                recordings,
                this_run(),
                Progress,
                status,
                arguments.probability / 100.0,
                arguments.seconds,
            )
        lines, values = diagnosis_lines(found), found.as_values(arguments.ranking)
    print("\n".join(lines))
    if arguments.report:
        from wrist_stiffness.report.diagnosis_report import report_of_diagnosis
        from wrist_stiffness.report.page import write_page

        write_page(arguments.report, report_of_diagnosis(found))
    if arguments.json:
        write_json(arguments.json, values)
    return EXIT_DONE
