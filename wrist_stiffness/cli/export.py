"""`wrist-stiffness export`: the measured poses of a recording become a table."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.recording_options import add_recording_options, recordings_named

DESCRIPTION = """\
Write the measured poses of a recording as a table, one row each, with the motor angles, the load at
O in wrist_base, the temperatures and the covariates that belong to it. 'wrist-stiffness import
--help' explains the columns. The numbers are those of the recording: importing the table gives them
again to the bit. No outlier is left out and no clock is put right. Where poses are far apart, rows
without a measured value tell the way between them, which friction and backlash remember."""

EPILOG = """\
example, a recording with other names and a load sensor with a frame of its own:
  wrist-stiffness export bag -o bag.csv --topic /load_estimate:=/ft_sensor/wrench \\
      --parameters cell.yaml"""


def add_parser(commands: argparse._SubParsersAction[OneLineParser]) -> None:
    """Add the parser of `export`."""
    parser = commands.add_parser(
        "export",
        help="measured poses of a recording as a table (CSV)",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("recording", help="rosbag2 folder with MCAP storage, or a .mcap file")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.csv", help="the table")
    parser.add_argument("--table", help="lookup table of the wrist (default: the shipped one)")
    add_recording_options(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace an existing table")
    parser.add_argument("--json", metavar="FILE", help="write the summary here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.export_csv import export_csv
    from wrist_stiffness.commands.json_file import write_json
    from wrist_stiffness.lookup.table_file import load_table
    from wrist_stiffness.shipped import shipped_file

    named = recordings_named([arguments.recording], arguments)
    exported = export_csv(
        arguments.recording,
        arguments.output,
        load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz")),
        remaps=named.topics,
        settings=named.settings,
        overwrite=arguments.overwrite,
        progress=Progress("rows"),
    )
    turns = f", {exported.turns} rows of the way between them" if exported.turns else ""
    print(f"{exported.path}: {exported.rows} measured poses{turns}")
    for remark in exported.remarks:
        print(f"  {remark}")
    if arguments.json:
        write_json(
            arguments.json,
            {
                "table": str(exported.path),
                "rows": exported.rows,
                "turns": exported.turns,
                "remarks": exported.remarks,
            },
        )
    return EXIT_DONE
