"""How long the workbench takes from opening to the map, and from adding an effect to its error.

    python bench/workbench_speed.py --seconds 600 --rate 100

It asks what the page asks, without a browser, of a recording that `simulate` writes here.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from wrist_stiffness.web.bench import Bench

EFFECT = "backlash@motor_2"


def main() -> None:
    """Print seconds of each step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--recording", type=Path, help="instead of a new one")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = (asked.recording or Path(folder, "recording.mcap")).resolve()
        if asked.recording is None:
            command = [sys.executable, "-m", "wrist_stiffness", "simulate", "-o", str(path)]
            command += ["--seconds", str(asked.seconds), "--rate", str(asked.rate)]
            command += ["--base", "wrong", "--effect", EFFECT, "--size", "4"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        bench = Bench(path.parent, lambda text: None, lambda done, total: None)
        steps = (
            ("open, to the first map", lambda: bench.open_named([path.name], "")),
            ("calibrate", bench.calibrate),
            ("what the error depends on", lambda: bench.compare(1)),
            (f"look at {EFFECT}", lambda: bench.look_at(EFFECT)),
            ("add it, to the fallen error", bench.add),
        )
        for name, step in steps:
            wall, cpu = time.perf_counter(), time.process_time()
            step()
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            print(f"{name:34s}{wall:7.2f} s wall {cpu:7.2f} s CPU", flush=True)


if __name__ == "__main__":
    main()
