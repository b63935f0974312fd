"""Run the hidden-effect benchmark: pose riddles, ask solvers, keep scores, print tables.

    python bench/hidden_effects/run.py --quick            # one place an effect, about 3 minutes
    python bench/hidden_effects/run.py --processes 4      # all; stop and start again at will
    python bench/hidden_effects/run.py --report           # only the tables of what is there

Each finished case is one line of results.jsonl; a second start goes on where the first ended.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

# Several processes share the cores: threads of the linear algebra below them only get in the way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench_wrist import wrist
from cases import Case, full_cases, quick_cases
from diagnosis_core import diagnosis_core
from dictionary import Word, dictionary
from observe import pose_riddle
from score import score, table
from solvers import BASELINES

from wrist_stiffness.cli.progress import Progress

SOLVERS = BASELINES | {"diagnosis_core": diagnosis_core}

DRAWS = 6
QUICK_DRAWS = 3


@cache
def _words(experiment: str, quick: bool, folder: Path) -> list[Word]:
    return dictionary(experiment, not quick, QUICK_DRAWS if quick else DRAWS, 1, folder)


def solve(case: Case, quick: bool, folder: Path) -> list[dict[str, Any]]:
    """Return the scores of all solvers on one case; one line that says so where it cannot be."""
    riddle = pose_riddle(wrist(), case)
    if riddle is None:
        return [{"key": case.key, "solver": "out_of_reach"}]
    words = _words(case.experiment, quick, folder)
    return [
        asdict(score(riddle, name, solver(riddle, words), words))
        for name, solver in SOLVERS.items()
    ]


def read(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a results file; a last line that was cut off does not count."""
    return list(_lines(path)) if path.exists() else []


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def report(lines: list[dict[str, Any]]) -> str:
    """Return the tables of all results."""
    scored = [line for line in lines if line["solver"] != "out_of_reach"]
    unreached = len(lines) - len(scored)
    if not scored:
        return "no results yet"
    parts = [table(scored, "kind"), table(scored, "effect")]
    return "\n\n".join([*parts, f"Out of reach within the catalogue's limits: {unreached} cases."])


def main() -> None:
    """Run what is missing, then print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the small subset")
    parser.add_argument("--report", action="store_true", help="run nothing, print the tables")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--most", type=int, help="stop after so many cases")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    path = arguments.output / ("quick.jsonl" if arguments.quick else "full.jsonl")
    if not arguments.report:
        cases = quick_cases() if arguments.quick else full_cases()
        done = {line["key"] for line in read(path)}
        run([case for case in cases if case.key not in done][: arguments.most], path, arguments)
    print(report(read(path)))


def run(cases: list[Case], path: Path, arguments: argparse.Namespace) -> None:
    """Solve cases and append their scores to the results file as they come."""
    draws = QUICK_DRAWS if arguments.quick else DRAWS
    for experiment in sorted({case.experiment for case in cases}):
        dictionary(experiment, not arguments.quick, draws, arguments.processes, arguments.output)
    progress = Progress("cases")
    with ProcessPoolExecutor(arguments.processes) as pool, path.open("a", encoding="utf-8") as out:
        waiting = [pool.submit(solve, case, arguments.quick, arguments.output) for case in cases]
        for number, finished in enumerate(as_completed(waiting)):
            # One write a case: a run that is stopped leaves whole cases behind.
            out.write("".join(json.dumps(line) + "\n" for line in finished.result()))
            out.flush()
            progress(number + 1, len(cases))


if __name__ == "__main__":
    main()
