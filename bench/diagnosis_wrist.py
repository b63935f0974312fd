"""What a diagnosis of a recording of the wrist costs, part by part.

Times depend on the machine, so each stands beside its share of the whole.  Make a recording with
`wrist-stiffness simulate -o RECORDING --seconds 600 --rate 1000`, then run
`python bench/diagnosis_wrist.py RECORDING`.
"""

from __future__ import annotations

import os
import resource
import sys
import time

# The matrices are small: on a busy machine further threads wait for each other, and waiting counts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.shipped import shipped_file


def main(path: str) -> None:
    """Print the table."""
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    marks: list[tuple[str, float, float]] = []
    clock, processor = time.perf_counter(), time.process_time()

    def mark(name: str) -> None:
        nonlocal clock, processor
        now, used = time.perf_counter(), time.process_time()
        marks.append((name, now - clock, used - processor))
        clock, processor = now, used

    session = read_session(path, model.table)
    mark(f"read {len(session)} measurements")
    units = as_units(model, session)
    mark(f"cut into {len(units.cut.dwell)} units, {len(units.cut.kept)} moments kept")
    problem = WristProblem(model, (units,))
    problem.trials(problem.begin())
    mark("base fitted, catalogue evaluated")
    diagnose_sessions(model, [session])
    mark("the whole diagnosis, from measurements")
    whole = marks[-1][2]
    print(f"{'':60}{'wall s':>9}{'CPU s':>9}{'share':>8}")
    for name, wall, used in marks:
        print(f"{name:60}{wall:9.1f}{used:9.1f}{used / whole:8.2f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MB")


if __name__ == "__main__":
    main(sys.argv[1])
