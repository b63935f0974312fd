"""`wrist-stiffness tolerances`: which tolerance costs how many um."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser, named_numbers

DESCRIPTION = """\
Say which tolerance costs how many um.  Virtual wrists are built, every axis, gap and part drawn
within its tolerance; the table tells what each tolerance adds to the error that the nominal model
does not know, RMS over wrists and over poses of the operative workspace.  Flanges are shimmed to
the axes, as a fitter does."""

EPILOG = """\
examples:
  wrist-stiffness tolerances --load 0 0 -1
  wrist-stiffness tolerances my_wrist.yaml --wrists 10000 --picture costs.png
  wrist-stiffness tolerances --limit bushing_stiffness.flexibility_percent=10
  wrist-stiffness tolerances --limit axis_misalignment@joint_2.shift_u_um=5"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `tolerances`."""
    parser = commands.add_parser(
        "tolerances",
        help="which tolerance costs how many um",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("model", nargs="?", help="model file (default: the shipped wrist's)")
    parser.add_argument(
        "--wrists", type=int, default=1000, help="how many are built (default: %(default)d)"
    )
    parser.add_argument(
        "--load",
        nargs="+",
        type=float,
        default=[0.0] * 6,
        metavar="N",
        help="force [N], or force [N] and moment [N m], on the platform at O (default: none)",
    )
    parser.add_argument(
        "--limit",
        action="append",
        default=[],
        metavar="NAME=NUMBER",
        help="another tolerance, LAW.PARAMETER or LAW@PLACE.PARAMETER, to each side; of a gap its "
        "standard deviation; 0 for none; may be given several times",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default: %(default)d)")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="a running Dask scheduler, tcp://HOST:PORT (default: this machine)",
    )
    parser.add_argument("--picture", metavar="OUT.png", help="draw the table here")
    parser.add_argument("--json", metavar="FILE", help="write the result here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from pathlib import Path

    from wrist_stiffness.cli.pose_options import whole_load
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.commands.tolerances import study_tolerances
    from wrist_stiffness.shipped import shipped_file

    study = study_tolerances(
        arguments.model or shipped_file("config/palmieri2015_model.yaml"),
        arguments.wrists,
        whole_load(arguments.load),
        named_numbers(arguments.limit, "--limit"),
        arguments.seed,
        arguments.scheduler,
        progress=Progress("wrists"),
    )
    print("\n".join(study.lines()))
    if arguments.picture:
        from wrist_stiffness.report.pictures.tolerances import draw_tolerances

        draw_tolerances(study, Path(arguments.picture))
        print(f"written: {arguments.picture}")
    if arguments.json:
        write_json(arguments.json, study.as_values())
    return EXIT_DONE
