"""Where the time of `compare` goes, and that it grows with the samples and no faster.

Run as ``python bench/compare_speed.py [SECONDS]``: two recordings of the virtual cell at 1 kHz, the
second twice as long as the first (default: 60 and 120 s; 600 s take six minutes to simulate).
Times are of the processor, so that a busy machine says the same.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Threads of the linear algebra wait for each other on a busy machine, and waiting counts as work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import CellSettings

RATE_HZ = 1000.0


def seconds(action: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time of one call [s] and its result."""
    begin = time.process_time()
    result = action()
    return time.process_time() - begin, result


def stages(path: Path) -> dict[str, float]:
    """Return the time of each stage of a comparison [s]."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    read_s, session = seconds(lambda: read_session(path, model.table))
    units_s, _ = seconds(lambda: as_units(model, session))
    compare_s, _ = seconds(lambda: compared(model, session))
    return {"read": read_s, "compare": compare_s, "  of that, cut": units_s}


def compared(model: Any, session: MeasuredSession) -> Any:
    """Compare one model with one session, and say on what its error depends."""
    found = compare_models([("model", model)], [session])
    return found.verdict, sentences(found.models[0].explained)


def main() -> None:
    """Print the stages of both recordings and their ratios."""
    given = [Path(argument) for argument in sys.argv[1:] if Path(argument).exists()]
    with tempfile.TemporaryDirectory() as folder:
        paths = given or made(Path(folder), float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
        every = [stages(path) for path in paths]
    for name in every[0]:
        line = "  ".join(f"{stage[name]:8.2f} s" for stage in every)
        ratio = f"   ratio {every[-1][name] / every[0][name]:.2f}" if len(every) > 1 else ""
        print(f"{name:16}{line}{ratio}")
    totals = [stage["read"] + stage["compare"] for stage in every]
    print(f"{'together':16}" + "  ".join(f"{total:8.2f} s" for total in totals))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process {peak:.0f} MB")


def made(folder: Path, first_s: float) -> list[Path]:
    """Return two recordings, the second twice as long."""
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    paths = []
    for duration in (first_s, 2.0 * first_s):
        path = folder / f"{duration:g}.mcap"
        settings = CellSettings(rate_hz=RATE_HZ, program_seconds=duration)
        simulate_recording(path, table, settings, duration, 0)
        paths.append(path)
    return paths


if __name__ == "__main__":
    main()
