"""Many wrists at once: cost over how many, on one process and on two.

Run as ``python bench/scale.py [--wrists N ...] [--recordings N ...] [--processes N ...]``.  Virtual
wrists of a tolerance study, and recordings of some seconds in one folder, each a wrist of its own
for `compare --each`.  Time on the clock and of all processors, that of starting the processes
included; the last line of a table is what a million would take at the rate of its two largest.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

# Workers inherit it: two processes with two threads each wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from wrist_stiffness.commands.compare import compare
from wrist_stiffness.commands.fleet import spread
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.commands.simulate import simulate_recording
from wrist_stiffness.commands.tolerances import study_tolerances
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import CellSettings

MODEL = Path(shipped_file("config/palmieri2015_model.yaml"))
DOWN = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
SECONDS = 30.0
MILLION = 1e6


def compared(path: Path) -> int:
    """Compare one recording and return how many sentences came of it."""
    return len(
        compare([MODEL], Recordings([path], {}), Run("bench/scale.py", "")).as_values()["verdict"]
    )


def curve(
    title: str, counts: Sequence[int], processes: Sequence[int], run: Callable[[int, int], object]
) -> None:
    """Print clock and processor time of a number of items, on some numbers of processes."""
    print(f"{title:28}" + "".join(f"{n:3d} process(es) [s]  CPU [s]" for n in processes))
    rows: dict[int, list[tuple[float, float]]] = {}
    for count in counts:
        for workers in processes:
            before, begin = os.times(), time.monotonic()
            run(count, workers)
            after, wall = os.times(), time.monotonic() - begin
            rows.setdefault(count, []).append((wall, sum(after[:4]) - sum(before[:4])))
        print(f"{count:28d}" + "".join(f"{w:19.1f} {c:8.1f} " for w, c in rows[count]), flush=True)
    if len(counts) > 1:
        (small, first), (large, second) = list(rows.items())[-2:]
        each = [
            [(b - a) / (large - small) for a, b in zip(old, new, strict=True)]
            for old, new in zip(first, second, strict=True)
        ]
        print(f"{'each [ms]':28}" + "".join(f"{1e3 * w:19.1f} {1e3 * c:8.1f} " for w, c in each))
        hours = "".join(
            f"{MILLION * w / 3600:17.1f} h {MILLION * c / 3600:6.1f} h " for w, c in each
        )
        print(f"{'a million, on paper':28}{hours}")


def main() -> None:
    """Print both curves."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wrists", type=int, nargs="*", default=[500, 2000])
    parser.add_argument("--recordings", type=int, nargs="*", default=[10, 40])
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of a recording")
    options = parser.parse_args()
    if options.wrists:
        curve(
            "virtual wrists",
            options.wrists,
            options.processes,
            lambda count, workers: study_tolerances(MODEL, count, DOWN, {}, workers=workers),
        )
    if not options.recordings:
        return
    with tempfile.TemporaryDirectory() as folder:
        table = load_model(MODEL).table
        first = Path(folder) / "0000.mcap"
        simulate_recording(first, table, CellSettings(), options.seconds, seed=0)
        paths = [first]
        for number in range(1, max(options.recordings)):
            paths.append(first.with_name(f"{number:04d}.mcap"))
            shutil.copyfile(first, paths[-1])

        def compare_each(count: int, workers: int) -> None:
            rows = spread(compared, paths[:count], workers=workers)
            if errors := [row.error for row in rows if row.error]:
                raise SystemExit(f"{len(errors)} of {count} failed: {errors[0]}")

        curve("recordings, compared", options.recordings, options.processes, compare_each)


if __name__ == "__main__":
    main()
