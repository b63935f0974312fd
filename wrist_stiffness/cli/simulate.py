"""`wrist-stiffness simulate`: a recording of the virtual cell."""

import argparse
import json
import os
from pathlib import Path

from wrist_stiffness.cli.parser import EXIT_DONE, OneLineParser
from wrist_stiffness.cli.progress import Progress


def add_parser(commands: "argparse._SubParsersAction[OneLineParser]") -> None:
    """Add the command."""
    parser = commands.add_parser("simulate", help="write a recording of a virtual cell")
    parser.add_argument(
        "-o", "--output", required=True, metavar="RECORDING", help="rosbag2 folder or .mcap file"
    )
    parser.add_argument("--table", help="table of the true wrist (default: the shipped one)")
    parser.add_argument("--seconds", type=float, default=60.0, help="duration (default: 60)")
    parser.add_argument("--rate", type=float, default=100.0, help="samples per second (100)")
    parser.add_argument("--seed", type=int, default=0, help="of program and noise (default: 0)")
    parser.add_argument(
        "--instrument",
        default="interferometer",
        help="pose sensor: interferometer, tracker, cmm, ideal (default: interferometer)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    parser.add_argument("--json", metavar="FILE", help="write the result there")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, then say what was written."""
    from wrist_stiffness.lookup.table_file import load_table
    from wrist_stiffness.shipped import shipped_file
    from wrist_stiffness.simulation.cell import CellSettings
    from wrist_stiffness.workflows.simulate import simulate_recording

    settings = CellSettings(
        rate_hz=arguments.rate,
        program_seconds=arguments.seconds,
        program_seed=max(arguments.seed, 0),
        instrument=arguments.instrument,
    )
    written = simulate_recording(
        arguments.output,
        load_table(arguments.table or shipped_file("precomputed/palmieri2015.npz")),
        settings,
        arguments.seconds,
        arguments.seed,
        Progress("samples"),
        arguments.overwrite,
    )
    if arguments.json:
        _write_json(
            Path(arguments.json),
            {
                "recording": str(written.path),
                "samples": written.samples,
                "seconds": written.seconds,
            },
        )
    print(f"{written.path}: {written.samples} samples, {written.seconds:g} s")
    return EXIT_DONE


def _write_json(path: Path, result: dict[str, object]) -> None:
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)
