"""`wrist-stiffness import`: a table of measured poses becomes a recording."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser

DESCRIPTION = """\
Make a recording of a table, as a campaign with a CMM, a tracker or dial gauges ends in. Every
command that reads recordings reads it then. One row is one measured pose; the first line names the
columns, each with its unit, in any order:

  time_s                               rising; from its own zero, since 1970, or a date
                                       such as 2026-03-02T10:15:00.25 (UTC, or with +01:00)
  motor_1_deg motor_2_deg              motor angles
  fx_N fy_N fz_N mx_Nm my_Nm mz_Nm     load on the platform at O, in wrist_base
  x_mm y_mm z_mm                       measured: the platform's point O in wrist_base
  qx qy qz qw                          measured: rotation from platform to base
  p1x_mm p1y_mm p1z_mm p2x_mm ...      or markers: the geometry's readout points, in its order
  T_COMPONENT_degC                     temperature of link_1, frame, ambient ...
  NAME_UNIT                            anything else that may matter: humidity_percent ...

A blank cell, or nan, is not measured: points only, pointing only or one dial gauge (only z_mm)
will do. A row without any measured value still tells the way between two poses, which friction and
backlash remember: list the poses that the wrist turned back at."""

EPILOG = """\
examples:
  wrist-stiffness import cmm.csv -o cmm
  wrist-stiffness import gauge.csv -o gauge.mcap --unloaded"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `import`."""
    parser = commands.add_parser(
        "import",
        help="a table of measured poses (CSV) becomes a recording",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "table", metavar="FILE.csv", help="UTF-8; commas, semicolons or tabs between columns"
    )
    parser.add_argument(
        "-o", "--output", required=True, metavar="RECORDING", help="folder or .mcap file"
    )
    parser.add_argument(
        "--unloaded",
        action="store_true",
        help="there are no load columns because nothing pulled at the platform",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    parser.add_argument("--json", metavar="FILE", help="write the summary here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.import_csv import import_csv
    from wrist_stiffness.commands.json_file import write_json

    imported = import_csv(
        arguments.table,
        arguments.output,
        arguments.unloaded,
        arguments.overwrite,
        Progress("rows"),
    )
    print(f"{imported.path}: {imported.rows} rows, {imported.measured} with a measured value")
    for what, names in (
        ("temperatures of", imported.temperatures),
        ("covariates", imported.covariates),
    ):
        if names:
            print(f"  {what} {', '.join(names)}")
    if imported.cut_row:
        print(f"  row {imported.cut_row}, the last one, is cut and left out")
    if arguments.json:
        write_json(
            arguments.json,
            {
                "recording": str(imported.path),
                "rows": imported.rows,
                "measured": imported.measured,
                "temperatures": imported.temperatures,
                "covariates": imported.covariates,
                "cut_row": imported.cut_row,
            },
        )
    return EXIT_DONE
