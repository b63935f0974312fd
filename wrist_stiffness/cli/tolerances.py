"""`wrist-stiffness tolerances`: which tolerance costs how many um."""

from __future__ import annotations

import argparse
from pathlib import Path

from wrist_stiffness.cli.options import LOAD, MODEL, model_named, whole_load
from wrist_stiffness.cli.parser import command, named_numbers, option, repeated, say, value
from wrist_stiffness.cli.progress import Progress


@command(
    MODEL,
    value("--wrists", 1000, "how many are built"),
    LOAD,
    repeated(
        "--limit",
        "NAME=NUMBER",
        "another tolerance, LAW.PARAMETER or LAW@PLACE.PARAMETER, to each side; of a gap its "
        "standard deviation; 0 for none",
    ),
    value("--seed", 0, "of the draws"),
    option("--picture", "draw the table here", "OUT.png"),
)
def tolerances(arguments: argparse.Namespace) -> int:
    """Which tolerance costs how many um.

    Say which tolerance costs how many um.  Virtual wrists are built, every axis, gap and part drawn
    within its tolerance; the table tells what each tolerance adds to the error that the nominal
    model does not know, RMS over wrists and over poses of the operative workspace.  Flanges are
    shimmed to the axes, as a fitter does.

    for example:
      wrist-stiffness tolerances --load 0 0 -1
      wrist-stiffness tolerances my_wrist.yaml --wrists 10000 --picture costs.png
      wrist-stiffness tolerances --limit bushing_stiffness.flexibility_percent=10
      wrist-stiffness tolerances --limit axis_misalignment@joint_2.shift_u_um=5
    """
    from wrist_stiffness.commands.tolerances import study_tolerances
    from wrist_stiffness.report.terminal import tolerance_lines

    study = study_tolerances(
        model_named(arguments),
        arguments.wrists,
        whole_load(arguments.load),
        named_numbers(arguments.limit, "--limit"),
        arguments.seed,
        progress=Progress("wrists"),
    )
    lines = tolerance_lines(study)
    if arguments.picture:
        from wrist_stiffness.report.pictures.tolerances import draw_tolerances

        draw_tolerances(study, Path(arguments.picture))
        lines.append(f"written: {arguments.picture}")
    return say(arguments, lines, study.as_values())
