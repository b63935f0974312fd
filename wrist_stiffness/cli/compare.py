"""`wrist-stiffness compare`: how far models are off from recordings."""

from __future__ import annotations

import argparse
from functools import partial

from wrist_stiffness.cli.options import add_compared_recordings, for_each, recordings_named
from wrist_stiffness.cli.parser import Commands, add_command, say, this_run
from wrist_stiffness.shipped import shipped_file

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


def add_parser(commands: Commands) -> None:
    """Add the parser of `compare`."""
    what = "how far a model is off from recordings, where and when"
    parser = add_command(commands, "compare", what, (DESCRIPTION, EPILOG), _run)
    first = "the first is what the others are to improve upon (default: the shipped wrist's)"
    parser.repeated("--model", "FILE", f"model file; {first}")
    add_compared_recordings(parser)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.compare import compare

    models = arguments.model or [shipped_file("config/palmieri2015_model.yaml")]
    recordings = recordings_named(arguments.recordings, arguments)
    if for_each(arguments):
        from wrist_stiffness.commands.fleet import each_recording, table_values
        from wrist_stiffness.report.fleet_lines import compared_lines

        one = partial(compare, models, run=this_run())
        rows = each_recording(one, recordings, Progress("recordings"))
        return say(arguments, compared_lines(rows), table_values(rows, "comparison"))
    from wrist_stiffness.report.comparison_report import comparison_lines, report_of_comparison

    found = compare(models, recordings, this_run(), Progress)
    code = say(arguments, comparison_lines(found), found.as_values())
    if arguments.report:
        from wrist_stiffness.report.page import write_page

        write_page(arguments.report, report_of_comparison(found))
    return code
