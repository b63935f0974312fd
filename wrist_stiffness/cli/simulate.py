"""`wrist-stiffness simulate`: a recording of the virtual cell, with or without a hidden effect."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from math import pi
from typing import TYPE_CHECKING

from wrist_stiffness.cli.options import table_named
from wrist_stiffness.cli.parser import Commands, add_command, say
from wrist_stiffness.errors import InputError

if TYPE_CHECKING:
    from wrist_stiffness.lookup.table import Table
    from wrist_stiffness.simulation.cell import CellSettings

DESCRIPTION = """\
Write a recording of a virtual wrist at work. Its true laws are finer than those of any model; with
--effect or --blind it hides one more. Sizes are in units of one sample's noise."""

EPILOG = """\
examples:
  wrist-stiffness simulate -o clean --seconds 120
  wrist-stiffness simulate -o play --effect joint_clearance@joint_3 --size 3
  wrist-stiffness simulate -o riddle --blind 7 --seconds 120   # what is it?
  wrist-stiffness simulate -o judge --blind 7 --seconds 120 --day 2   # the same wrist tomorrow
  wrist-stiffness simulate --reveal 7 --seconds 120            # the same options open it"""


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


def add_parser(commands: Commands) -> None:
    """Add the parser of `simulate`."""
    what = "write a recording of a virtual cell"
    parser = add_command(commands, "simulate", what, (DESCRIPTION, EPILOG), _run)
    parser.add_argument("-o", "--output", metavar="RECORDING", help="rosbag2 folder or .mcap file")
    parser.add_argument("--table", help="table of the true wrist (default: the shipped one)")
    parser.option("--seconds", 60.0, "duration")
    parser.option("--rate", 100.0, "samples per second")
    parser.option("--seed", 0, "of program and noise")
    anew = "instrument set up anew, other poses, loads and noise"
    parser.option("--day", 1, f"another day of the same wrist and effect: {anew}")
    parser.option("--experiment", "rich", "rich, paper, dead_weights, production or heavy")
    sensors = "interferometer, tracker, cmm, ideal; a cmm measures once in each rest"
    parser.option("--instrument", "interferometer", f"pose sensor: {sensors}")
    seen = "pose, points (position alone) or pointing (rotation alone)"
    parser.option("--sees", "pose", f"what the pose sensor sees: {seen}")
    lost = "of its samples, half of them missing and half wild; 0.02 is usual"
    parser.option("--lost-beams", 0.0, lost, "SHARE")
    parser.option("--base", "exact", "exact, or wrong as real wrists are")
    secret = parser.add_mutually_exclusive_group()
    secret.add_argument(
        "--effect", metavar="NAME@COMPONENT[:FORM]", help="hide this effect (names: docs)"
    )
    secret.add_argument("--blind", type=int, metavar="SEED", help="hide what the seed draws")
    secret.add_argument("--reveal", type=int, metavar="SEED", help="tell what the seed hid")
    parser.add_argument(
        "--size", type=float, help=f"of --effect (default: {USUAL_SIZE:g}); --blind draws its own"
    )
    parser.flag("--overwrite", "replace an existing recording")


def _run(arguments: argparse.Namespace) -> int:
    from wrist_stiffness.cli.progress import Progress, Status
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
    from wrist_stiffness.cli.progress import Status
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
    from wrist_stiffness.report.page import number

    head, per, rest = si.partition("/")
    factor, unit = USUAL_UNITS.get(head, (1.0, head))
    return f"{number(factor * magnitude, 4)} {unit}{per}{rest}".removesuffix(" -")
