"""`wrist-stiffness import` and `export`: measured poses as a table of a campaign."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from wrist_stiffness.cli.options import RECORDING, SENSOR_NAMES, recordings_named, table_named
from wrist_stiffness.cli.parser import command, flag, one_of, option, output, say
from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.topics import BASE_FRAME, INSTRUMENT_FRAME

LONG_DAYS = 1.0
"""Nobody measures one session for longer, and two minutes in ms are 1.4 days."""


@command(
    option("table", "UTF-8; commas, semicolons or tabs between columns", "FILE.csv"),
    output("RECORDING", "folder or .mcap file"),
    flag("--unloaded", "there are no load columns because nothing pulled at the platform"),
    one_of(
        flag("--register", "the instrument stands anywhere: the wrist's motion will tell where"),
        option(
            "--gauges",
            "which columns are dial gauges or inclinometers, with their points and directions",
            "FILE.yaml",
        ),
    ),
    flag("--overwrite", "replace an existing recording"),
)
def import_(arguments: argparse.Namespace) -> int:
    """Make a recording of a table of measured poses (CSV).

    Make a recording of a table, as a campaign with a CMM, a tracker or dial gauges ends in. Every
    command that reads recordings reads it then. One row is one measured pose; the first line names
    the columns, each with its unit, in any order:

      time_s                               rising; from its own zero, since 1970, or a date
                                           such as 2026-03-02T10:15:00.25 (UTC, or with +01:00)
      motor_1_deg motor_2_deg              motor angles
      fx_N fy_N fz_N mx_Nm my_Nm mz_Nm     load on the platform at O, in wrist_base
      x_mm y_mm z_mm                       measured: the platform's point O in wrist_base, or with
                                           --register a target in the instrument's own axes
      qx qy qz qw                          measured: rotation from platform to base
      p1x_mm p1y_mm p1z_mm p2x_mm ...      or markers: the geometry's readout points, in its order
      NAME_mm NAME_um NAME_in              or dial gauges, and inclinometers (NAME_deg, NAME_mdeg),
                                           as --gauges describes them
      T_COMPONENT_degC                     temperature of link_1, frame, ambient ...
      NAME_UNIT                            anything else that may matter: humidity_percent ...

    A blank cell, or nan, is not measured: points only, pointing only or one dial gauge (only z_mm)
    will do. A row without any measured value still tells the way between two poses, which friction
    and backlash remember: list the poses that the wrist turned back at.

    for example:
      wrist-stiffness import cmm.csv -o cmm
      wrist-stiffness import tracker.csv -o tracker --register
      wrist-stiffness import gauges.csv -o gauges --gauges gauges.yaml
      wrist-stiffness import cmm.csv -o cmm.mcap --unloaded
    """
    from wrist_stiffness.commands.import_csv import import_csv

    found = import_csv(
        arguments.table,
        arguments.output,
        arguments.unloaded,
        arguments.overwrite,
        Progress("rows"),
        INSTRUMENT_FRAME if arguments.register else BASE_FRAME,
        arguments.gauges,
    )
    days = found.seconds / 86400.0
    doubt = f" ({days:.3g} days: are the times in ms?)" if days > LONG_DAYS else ""
    rows = f"{found.rows} rows in {found.seconds:g} s{doubt}"
    lines = [f"{found.recording}: {rows}, {found.measured} with a measured value"]
    if found.temperatures:
        lines.append(f"  temperatures of {', '.join(found.temperatures)}")
    if found.covariates:
        lines.append(f"  covariates {', '.join(found.covariates)}")
    if found.cut_row:
        lines.append(f"  row {found.cut_row}, the last one, is cut and left out")
    return say(arguments, lines, {**asdict(found), "recording": str(found.recording)})


@command(
    RECORDING,
    output("FILE.csv", "the table"),
    option("--table", "lookup table of the wrist (default: the shipped one)"),
    *SENSOR_NAMES,
    flag("--overwrite", "replace an existing table"),
)
def export(arguments: argparse.Namespace) -> int:
    r"""Write the measured poses of a recording as a table (CSV).

    Write the measured poses of a recording as a table, one row each, with the motor angles, the
    load at O in wrist_base, the temperatures and the covariates that belong to it. 'wrist-stiffness
    import --help' explains the columns. The numbers are those of the recording: importing the table
    gives them again to the bit. No outlier is left out and no clock is put right. Where poses are
    far apart, rows without a measured value tell the way between them, which friction and backlash
    remember.

    example, a recording with other names and a load sensor with a frame of its own:
      wrist-stiffness export bag -o bag.csv --topic /load_estimate:=/ft_sensor/wrench \
          --parameters cell.yaml
    """
    from wrist_stiffness.commands.export_csv import export_csv

    named = recordings_named([arguments.recording], arguments)
    found = export_csv(
        arguments.recording,
        arguments.output,
        table_named(arguments),
        remaps=named.topics,
        settings=named.settings,
        progress=Progress("rows"),
    )
    turns = f", {found.turns} rows of the way between them" if found.turns else ""
    lines = [f"{found.table}: {found.rows} measured poses{turns}"]
    lines += [f"  {remark}" for remark in found.remarks]
    return say(arguments, lines, {**asdict(found), "table": str(found.table)})
