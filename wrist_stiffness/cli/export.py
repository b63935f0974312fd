"""`wrist-stiffness export`: the measured poses of a recording become a table."""

from __future__ import annotations

import argparse

from wrist_stiffness.cli.parser import OneLineParser

DESCRIPTION = """\
Write the measured poses of a recording as a table, one row each, with the motor angles, the load at
O in wrist_base, the temperatures and the covariates that belong to it. 'wrist-stiffness import
--help' explains the columns. The numbers are those of the recording: importing the table gives them
again to the bit. No outlier is left out and no clock is put right."""

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
    parser.add_argument(
        "--table", help="lookup table of the wrist; only loads that turn with the platform need it"
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="STANDARD:=ACTUAL",
        help="a topic's name in this recording; may be repeated",
    )
    parser.add_argument(
        "--joint",
        action="append",
        default=[],
        metavar="NAME",
        help="name of motor 1, then of motor 2 (default: motor_1_joint, motor_2_joint)",
    )
    parser.add_argument(
        "--parameters",
        metavar="FILE",
        help="the nodes' ROS 2 parameter file, for its sensor frames and age limit of loads",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing table")
    parser.add_argument("--json", metavar="FILE", help="write the summary here as well")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress
    from wrist_stiffness.errors import InputError
    from wrist_stiffness.lookup.table_file import load_table
    from wrist_stiffness.recording.topics import parse_topic_remaps
    from wrist_stiffness.shipped import shipped_file
    from wrist_stiffness.workflows.export_csv import export_csv
    from wrist_stiffness.workflows.json_file import write_json
    from wrist_stiffness.workflows.parameter_file import node_settings

    if len(arguments.joint) not in (0, 2):
        raise InputError(f"--joint names both motors or none, not {len(arguments.joint)}")
    settings, _ = node_settings(arguments.parameters, arguments.joint)
    exported = export_csv(
        arguments.recording,
        arguments.output,
        load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz")),
        remaps=parse_topic_remaps(arguments.topic),
        settings=settings,
        overwrite=arguments.overwrite,
        progress=Progress("rows"),
    )
    print(f"{exported.path}: {exported.rows} measured poses")
    for remark in exported.remarks:
        print(f"  {remark}")
    if arguments.json:
        write_json(
            arguments.json,
            {"table": str(exported.path), "rows": exported.rows, "remarks": exported.remarks},
        )
    return 0
