"""`wrist-stiffness compare`: how far models are off from recordings."""

from __future__ import annotations

import argparse
from functools import partial

from wrist_stiffness.cli.fleet_options import add_fleet_options, for_each
from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.recording_options import add_recording_options, recordings_named

DESCRIPTION = """\
Say how far a model is off from recordings with a measured pose of the platform: as it stands, and
after registrations, encoder zeros and load tare were fitted again; against the noise floor; where
in the workspace; and under which condition, in sentences.  Several recordings are sessions of one
wrist; a folder stands for the recordings in it.  Several models show the fall of the error."""

EPILOG = """\
examples:
  wrist-stiffness compare monday tuesday --model my_wrist.yaml --report monday.html
  wrist-stiffness compare monday --model before.yaml --model after.yaml
  wrist-stiffness compare all_wrists --each --json fleet.json"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `compare`."""
    parser = commands.add_parser(
        "compare",
        help="how far a model is off from recordings, where and when",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="recording, or folder of recordings"
    )
    parser.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="FILE",
        help="model file; may be repeated, the first is what the others are to improve upon "
        "(default: the shipped wrist's)",
    )
    parser.add_argument("--report", metavar="OUT.html", help="write a report with pictures here")
    add_fleet_options(parser)
    add_recording_options(parser)
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.cli.this_run import this_run
    from wrist_stiffness.commands.compare import compare
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.shipped import shipped_file

    models = arguments.model or [shipped_file("config/palmieri2015_model.yaml")]
    recordings = recordings_named(arguments.recordings, arguments)
    if for_each(arguments):
        from wrist_stiffness.commands.fleet import each_recording, table_values
        from wrist_stiffness.report.fleet_lines import compared_lines

        one = partial(compare, models, run=this_run())
        rows = each_recording(one, recordings, arguments.scheduler, Progress("recordings"))
        lines, values = compared_lines(rows), table_values(rows, "comparison")
    else:
        from wrist_stiffness.report.comparison_lines import comparison_lines

        found = compare(models, recordings, this_run(), Progress)
        lines, values = comparison_lines(found), found.as_values()
    print("\n".join(lines))
    if arguments.report:
        from wrist_stiffness.report.comparison_report import report_of_comparison
        from wrist_stiffness.report.page import write_page

        write_page(arguments.report, report_of_comparison(found))
    if arguments.json:
        write_json(arguments.json, values)
    return EXIT_DONE
