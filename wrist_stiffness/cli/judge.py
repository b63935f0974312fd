"""`wrist-stiffness compare` and `diagnose`: what recordings say of models."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from wrist_stiffness.cli.options import JUDGING, MODEL_OPTION, model_named, recordings_named
from wrist_stiffness.cli.parser import (
    EXIT_BAD_INPUT,
    command,
    flag,
    option,
    repeated,
    say,
    this_run,
    value,
)
from wrist_stiffness.cli.progress import Progress, Status
from wrist_stiffness.shipped import shipped_file

if TYPE_CHECKING:
    from wrist_stiffness.commands.read_sessions import Recordings
    from wrist_stiffness.report.fleet_lines import Rows


def _say_each(
    arguments: argparse.Namespace,
    one: Callable[[Recordings], Any],
    recordings: Recordings,
    lines: Callable[[Rows], list[str]],
    what: str,
) -> int:
    """Run a command on each recording by itself and say its lines; bad input if none is read."""
    from wrist_stiffness.commands.fleet import each_recording, table_values

    rows = each_recording(one, recordings, Progress("recordings"))
    code = say(arguments, lines(rows), table_values(rows, what))
    return code if any(row.result for row in rows) else EXIT_BAD_INPUT


@command(
    repeated(
        "--model",
        "FILE",
        "model file; the first is what the others are to improve upon (default: the shipped "
        "wrist's)",
    ),
    *JUDGING,
)
def compare(arguments: argparse.Namespace) -> int:
    """How far a model is off from recordings, where and when.

    Say how far a model is off from recordings with a measured pose of the platform: as it stands,
    and after registrations, encoder zeros and load tare were fitted again; against the noise floor;
    where in the workspace; and under which condition, in sentences.  Several recordings are
    sessions of one wrist; a folder stands for the recordings in it.  Several models show the fall
    of the error.

    for example:
      wrist-stiffness compare monday tuesday --model my_wrist.yaml --report monday.html
      wrist-stiffness compare monday --model before.yaml --model after.yaml
      wrist-stiffness compare all_wrists --each --json fleet.json
    """
    from wrist_stiffness.commands.compare import compare

    models = arguments.model or [shipped_file("config/palmieri2015_model.yaml")]
    recordings = recordings_named(arguments.recordings, arguments)
    if arguments.each:
        from wrist_stiffness.report.fleet_lines import compared_lines

        one = partial(compare, models, run=this_run())
        return _say_each(arguments, one, recordings, compared_lines, "comparison")
    from wrist_stiffness.report.comparison_report import comparison_lines, report_of_comparison

    found = compare(models, recordings, this_run(), Progress)
    code = say(arguments, comparison_lines(found), found.as_values())
    if arguments.report:
        from wrist_stiffness.report.page import write_page

        write_page(arguments.report, report_of_comparison(found))
    return code


@command(
    MODEL_OPTION,
    value("--probability", 90.0, "name an effect from this probability on", "PERCENT"),
    option(
        "--seconds",
        "begin no further fit after this time; the answer says what was not tried",
        type=float,
        default=float("inf"),
    ),
    flag("--ranking", "with --json: every candidate, and what each rival changes in every unit"),
    *JUDGING,
)
def diagnose(arguments: argparse.Namespace) -> int:
    """Which physical effect is missing in a model.

    Say which physical effect a model misses, from recordings with a measured pose of the platform.
    Registrations, encoder zeros, load tare and the wrist's tolerances are fitted first; then every
    effect of the catalogue is tried at every place.  Every finding has a probability; effects that
    the recordings cannot tell apart are named together.  The answer may be 'nothing' or 'none of
    these', and then it says on what the error depends.
    Several recordings are sessions of one wrist: the last one judges what the others show, so
    record on two days.  Of a single recording the end judges.

    for example:
      wrist-stiffness diagnose monday tuesday --model my_wrist.yaml --report why.html
      wrist-stiffness diagnose monday --json why.json
      wrist-stiffness diagnose all_wrists --each --json fleet.json

    next: 'extend MODEL --effect NAME@COMPONENT' adds what was found; where rivals remain,
    'plan MODEL --diagnosis why.json' says what to record.
    """
    from wrist_stiffness.commands.diagnose import diagnose_recordings
    from wrist_stiffness.identification.wrist_diagnosis import require_limits

    naming, seconds = arguments.probability / 100.0, arguments.seconds
    require_limits(naming, seconds)
    model = model_named(arguments)
    recordings = recordings_named(arguments.recordings, arguments)
    if arguments.each:
        from wrist_stiffness.report.fleet_lines import diagnosed_lines

        one = partial(diagnose_recordings, model, run=this_run(), naming=naming, seconds=seconds)
        return _say_each(arguments, one, recordings, diagnosed_lines, "diagnosis")
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
