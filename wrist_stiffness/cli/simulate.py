"""`wrist-stiffness simulate` and `cell`: a virtual cell, recorded or live."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import table_named
from wrist_stiffness.cli.parser import (
    EXIT_DONE,
    EXIT_NO,
    PROG,
    command,
    flag,
    one_of,
    option,
    output,
    say,
    value,
)
from wrist_stiffness.cli.progress import Progress, Status
from wrist_stiffness.errors import InputError

if TYPE_CHECKING:
    from wrist_stiffness.lookup.table import Table
    from wrist_stiffness.simulation.cell import CellSettings

USUAL_SIZE = 3.0
"""Of an effect that is named without one."""

DRAWN_FOR = (
    "table",
    "seconds",
    "rate",
    "seed",
    "experiment",
    "instrument",
    "sees",
    "lost_beams",
    "base",
)
"""Options with which a secret is drawn; with others it is another one, in size or altogether."""

USUAL_UNITS = {"rad": (180e3 / pi, "mdeg"), "m": (1e6, "um"), "kg": (1e3, "g"), "s": (1e3, "ms")}
"""Factor and name of the units in which models and diagnoses speak, by that of SI."""


@command(
    output("RECORDING", "rosbag2 folder or .mcap file", required=False),
    option("--table", "table of the true wrist (default: the shipped one)"),
    value("--seconds", 60.0, "duration"),
    value("--rate", 100.0, "samples per second"),
    value("--seed", 0, "of program and noise"),
    value(
        "--day",
        1,
        "another day of the same wrist and effect: instrument set up anew, other poses, loads and "
        "noise",
    ),
    value("--experiment", "rich", "rich, paper, dead_weights, production or heavy"),
    value(
        "--instrument",
        "interferometer",
        "pose sensor: interferometer, tracker, cmm, ideal; a cmm measures once in each rest",
    ),
    value(
        "--sees",
        "pose",
        "what the pose sensor sees: pose, points (position alone) or pointing (rotation alone)",
    ),
    value(
        "--lost-beams",
        0.0,
        "of its samples, half of them missing and half wild; 0.02 is usual",
        "SHARE",
    ),
    value("--base", "exact", "exact, or wrong as real wrists are"),
    one_of(
        option("--effect", "hide this effect; an unknown name lists all", "NAME@COMPONENT[:FORM]"),
        option("--blind", "hide what the seed draws", "SEED", type=int),
        option("--reveal", "tell what the seed hid", "SEED", type=int),
    ),
    option("--size", f"of --effect (default: {USUAL_SIZE:g}); --blind draws its own", type=float),
    flag("--overwrite", "replace an existing recording"),
)
def simulate(arguments: argparse.Namespace) -> int:
    """Write a recording of a virtual cell.

    Write a recording of a virtual wrist at work. Its true laws are finer than those of any model;
    with --effect or --blind it hides one more. Sizes are in units of one sample's noise.

    for example:
      wrist-stiffness simulate -o clean --seconds 120
      wrist-stiffness simulate -o play --effect joint_clearance@joint_3 --size 3
      wrist-stiffness simulate -o riddle --blind 7 --seconds 120   # what is it?
      wrist-stiffness simulate -o judge --blind 7 --seconds 120 --day 2   # the same wrist tomorrow
      wrist-stiffness simulate --reveal 7 --seconds 120            # the same options open it
    """
    from wrist_stiffness.commands.simulate import (
        DAY_SEEDS,
        check_bounds,
        hide,
        on_day,
        secret,
        simulate_recording,
    )
    from wrist_stiffness.recording import RecordingWriter

    if arguments.reveal is not None and arguments.output is not None:
        raise InputError("--reveal tells a secret and writes no recording: leave out -o")
    if arguments.size is not None and arguments.effect is None:
        raise InputError(
            "--size belongs to --effect: --blind draws its own, and without either "
            "nothing is hidden"
        )
    check_bounds(arguments.seconds, arguments.rate, arguments.seed)
    table = table_named(arguments)
    settings = _settings(arguments)
    on_day(arguments.day, settings)  # Also where nothing is written, there is no such day.
    if arguments.reveal is not None:
        return _reveal(arguments, table, settings)
    if arguments.output is None:
        raise InputError("simulate: -o RECORDING says where to write")
    # Before the work: the size of an effect takes long to find.
    RecordingWriter(arguments.output, overwrite=arguments.overwrite).check_target()
    with Status() as status:
        if arguments.blind is not None:
            drawn = secret(arguments.blind, table, settings, arguments.seconds, status)
            settings = replace(settings, hidden=(drawn.hidden,))
        elif arguments.effect is not None:
            size = USUAL_SIZE if arguments.size is None else arguments.size
            settings = hide(arguments.effect, size, table, settings, arguments.seconds, status)
    written = simulate_recording(
        arguments.output,
        table,
        on_day(arguments.day, settings),
        arguments.seconds,
        arguments.seed + DAY_SEEDS * (arguments.day - 1),
        Progress("samples"),
        arguments.overwrite,
    )
    lines = [f"{written.recording}: {written.samples} samples, {written.seconds:g} s"]
    return say(arguments, lines, {**asdict(written), "recording": str(written.recording)})


def _settings(arguments: argparse.Namespace) -> CellSettings:
    """Return the cell as it is asked for, without a hidden effect, on its first day."""
    from wrist_stiffness.simulation.cell import CellSettings

    return CellSettings(
        rate_hz=arguments.rate,
        program_seconds=arguments.seconds,
        program_seed=arguments.seed,
        experiment=arguments.experiment,
        instrument=arguments.instrument,
        sees=arguments.sees,
        lost_beams=arguments.lost_beams,
        base=arguments.base,
        base_seed=arguments.seed,
    )


def _reveal(arguments: argparse.Namespace, table: Table, settings: CellSettings) -> int:
    from wrist_stiffness.commands.simulate import secret
    from wrist_stiffness.simulation.catalogue import ALL

    with Status() as status:
        drawn = secret(arguments.reveal, table, settings, arguments.seconds, status)
    hidden = drawn.hidden
    lines = [
        f"{hidden.effect}@{hidden.component} ({hidden.form}): "
        f"{in_usual_units(hidden.magnitude, ALL[hidden.effect].unit)}, size {drawn.size:.3g} "
        "times the noise of one sample"
    ]
    values = {name: getattr(arguments, name) for name in DRAWN_FOR}
    told = (f"--{n.replace('_', '-')} {value}" for n, value in values.items() if value is not None)
    lines.append(f"in recordings of: simulate --blind {arguments.reveal} {' '.join(told)}")
    return say(arguments, lines, {"size": drawn.size, **asdict(hidden)})


def in_usual_units(magnitude: float, si: str) -> str:
    """Return a magnitude in the units that a diagnosis speaks; what has none stays a number."""
    from wrist_stiffness.numerals import number

    head, per, rest = si.partition("/")
    factor, unit = USUAL_UNITS.get(head, (1.0, head))
    if si == "m" and abs(magnitude) >= 1e-3:
        factor, unit = 1e3, "mm"
    return f"{number(factor * magnitude, 4)} {unit}{per}{rest}".removesuffix(" -")


@command(
    option("--model", "model of the nodes and of the cell (default: the shipped one)", type=Path),
    option("--seconds", "about how long both motions take together", "S", type=float),
    option("--record", "recording to write: a folder or a .mcap file", "OUT", type=Path),
    value("--rate", 100.0, "samples per second", "HZ"),
    value("--seed", 0, "of motion and noise"),
    json=False,
)
def cell(arguments: argparse.Namespace) -> int:
    """Run the nodes with a virtual wrist.

    Start pose_error_predictor, angle_corrector, model_monitor and a virtual wrist as ROS 2 nodes on
    this machine. With --seconds the same motion runs twice, first without and then with correction,
    and the command ends by itself; else the motion goes on until Ctrl-C and
    'ros2 service call /angle_corrector/enable std_srvs/srv/SetBool "{data: true}"' switches the
    correction on. Without ROS_DOMAIN_ID in the environment the nodes get a domain of their own.
    Exit code 1: a node fell silent, or did not end when it was told to; one line says which.

    example:
      wrist-stiffness cell --seconds 60 --record live
      wrist-stiffness replay live -o replayed
    """
    from wrist_stiffness.commands.cell import run_cell

    sound = run_cell(
        arguments.model,
        arguments.seconds,
        arguments.record,
        arguments.rate,
        arguments.seed,
        Progress("cell"),
        lambda line: print(f"{PROG}: {line}", file=sys.stderr),
    )
    if arguments.record is not None:
        print(f"written: {arguments.record}")
    return EXIT_DONE if sound else EXIT_NO
