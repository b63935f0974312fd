"""`wrist-stiffness export`: the measured poses of a recording become a table."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from wrist_stiffness.cli.options import add_sensor_names, recordings_named, table_named
from wrist_stiffness.cli.parser import Commands, add_command, say

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


def add_parser(commands: Commands) -> None:
    """Add the parser of `export`."""
    what = "measured poses of a recording as a table (CSV)"
    parser = add_command(commands, "export", what, (DESCRIPTION, EPILOG), _run)
    parser.add_argument("recording", help="rosbag2 folder with MCAP storage, or a .mcap file")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.csv", help="the table")
    parser.add_argument("--table", help="lookup table of the wrist (default: the shipped one)")
    add_sensor_names(parser)
    parser.flag("--overwrite", "replace an existing table")


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.commands.export_csv import export_csv

    named = recordings_named([arguments.recording], arguments)
    found = export_csv(
        arguments.recording,
        arguments.output,
        table_named(arguments),
        remaps=named.topics,
        settings=named.settings,
        overwrite=arguments.overwrite,
        progress=Progress("rows"),
    )
    turns = f", {found.turns} rows of the way between them" if found.turns else ""
    lines = [f"{found.table}: {found.rows} measured poses{turns}"]
    lines += [f"  {remark}" for remark in found.remarks]
    return say(arguments, lines, {**asdict(found), "table": str(found.table)})
