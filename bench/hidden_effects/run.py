"""Run the hidden-effect benchmark: pose riddles, ask solvers, keep scores.

    python bench/hidden_effects/run.py --quick                # two verdicts; a wrong one fails
    python bench/hidden_effects/run.py --processes 4           # all; stop and start again at will
    python bench/hidden_effects/run.py --only joint_clearance --solvers own_diagnosis
    python bench/hidden_effects/page.py                        # tables and pictures of the results

Each answer is one line of the results file, with the digest of the code that gave it: a second
start does what is missing or was done by other code, and goes on.  A case that fails leaves its
error as a line and does not stop the others.
"""

from __future__ import annotations

import argparse
import os

# Several processes share the cores: threads of the linear algebra below them only get in the way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import Any

from bench_wrist import OWN, READING, TRUTH, code_version
from cases import Case, full_cases, quick_cases, stage_of
from ceiling import knows_the_laws
from diagnosis_core import diagnosis_core
from dictionary import Dictionary, design_of, dictionary
from elastic_net import elastic_net
from observe import Riddle, pose_riddle
from own_diagnosis import diagnosed_sessions, own_diagnosis, own_diagnosis_mcap
from score import Judge
from solvers import (
    Solver,
    always_none,
    gaussian_process,
    geometry_only,
    spans_of_the_laws,
    stepwise_bic,
    told_the_answer,
)
from told_the_name import told_the_name

from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError

SOLVERS: dict[str, Solver] = {
    "always_none": always_none,
    "told_the_answer": told_the_answer,
    "geometry_only": geometry_only,
    "stepwise_bic": stepwise_bic,
    "elastic_net": elastic_net,
    "gaussian_process": gaussian_process,
    "spans_of_the_laws": spans_of_the_laws,
    "diagnosis_core": diagnosis_core,
    "own_diagnosis": own_diagnosis,
    "own_diagnosis_mcap": own_diagnosis_mcap,
    "told_the_name": told_the_name,
    "knows_the_laws": knows_the_laws,
}
SAMPLED = (*("own_diagnosis_mcap", "diagnosis_core", "spans_of_the_laws", "knows_the_laws"),)
"""Are slow, or made for some cases, and asked those only."""

TRUTH_FILES = (
    *("cases.py", "observe.py", "units.py", "registered.py", "dictionary.py"),
    *("whitened.py", "score.py", "own_diagnosis.py"),
)
FILES = {
    "elastic_net": ("solvers.py", "elastic_net.py"),
    "diagnosis_core": ("solvers.py", "diagnosis_core.py"),
    "own_diagnosis": ("own_diagnosis.py",),
    "own_diagnosis_mcap": ("own_diagnosis.py",),
    "told_the_name": ("solvers.py", "told_the_name.py"),
    "knows_the_laws": ("solvers.py", "ceiling.py"),
}

LONGEST_S = 1800
"""A riddle or an answer that takes longer is given up."""

RESTARTS = 5
"""Of the pool, after a process was killed from outside."""


def version_of(solver: str) -> str:
    """Return the digest of all code that an answer and its score depend on."""
    modules = {
        "diagnosis_core": ("wrist_stiffness.inference",),
        "own_diagnosis": OWN,
        "own_diagnosis_mcap": (
            *OWN,
            "wrist_stiffness.commands.simulate",
        ),
        "told_the_name": (
            *OWN,
            "wrist_stiffness.identification.calibration",
            "wrist_stiffness.identification.extension",
        ),
    }.get(solver, ())
    # The project's calibration of what is read is in the floor of every score.
    modules = (*modules, "wrist_stiffness.identification.base_fit", READING)
    return code_version((*TRUTH, *modules), (*TRUTH_FILES, *FILES.get(solver, ("solvers.py",))))


def solve(case: Case, solvers: Sequence[str], folder: Path) -> list[dict[str, Any]]:
    """Return a line for each solver on one case; a line with `error` where there is no answer."""
    begun = time.perf_counter()
    try:
        with time_limit(LONGEST_S):
            riddle = pose_riddle(case)
            words = dictionary(design_of(case), folder)
            judge = Judge(riddle, words)
    except InputError as error:
        return [_without(case, name, "out_of_reach", str(error)) for name in solvers]
    except Exception as error:
        return [_without(case, name, "error", repr(error)) for name in solvers]
    posed = time.perf_counter() - begun
    return [_ask(riddle, name, words, judge, posed) for name in solvers]


def _ask(
    riddle: Riddle, name: str, words: Dictionary, judge: Judge, posed: float
) -> dict[str, Any]:
    begun = time.perf_counter()
    try:
        with time_limit(LONGEST_S):
            answer = SOLVERS[name](riddle, words)
            seconds = time.perf_counter() - begun
            line = asdict(judge.line(name, answer, version_of(name), seconds))
            return line | {"posed_s": posed}
    except Exception as error:
        return _without(riddle.case, name, "error", repr(error))


def _without(case: Case, solver: str, why: str, text: str) -> dict[str, Any]:
    return {
        "key": case.key,
        "solver": solver,
        "version": version_of(solver),
        "kind": case.kind,
        "main": case.main,
        why: text,
    }


def asked(case: Case, solvers: Sequence[str]) -> list[str]:
    """Return those of the solvers that are asked this case."""
    return [name for name in solvers if name not in SAMPLED or case.asked(name)]


class time_limit:
    """Context that raises TimeoutError after so many seconds; in the main thread of a process."""

    def __init__(self, seconds: int) -> None:
        self._seconds = seconds

    def __enter__(self) -> None:
        """Start the alarm."""
        signal.signal(signal.SIGALRM, self._ring)
        signal.alarm(self._seconds)

    def __exit__(self, *failure: object) -> None:
        """Stop it."""
        signal.alarm(0)

    def _ring(self, number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"longer than {self._seconds} s")


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of a results file; a last line that was cut off does not count."""
    if not path.exists():
        return
    for text in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def current(path: Path, solvers: Sequence[str]) -> list[dict[str, Any]]:
    """Return the lines that today's code gave."""
    versions = {name: version_of(name) for name in solvers}
    return [line for line in read(path) if versions.get(line["solver"]) == line["version"]]


def main() -> int:
    """Run what is missing; return 1 where an answer failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="two verdicts, no scores")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--most", type=int, help="stop after so many cases")
    parser.add_argument("--minutes", type=float, help="begin no case after so many minutes")
    parser.add_argument("--only", default="", help="cases whose key holds this text")
    parser.add_argument(
        "--stages",
        default="0,1,2,3",
        help="0 main design, 1 other bases and sensors, 2 rests alone, 3 other experiments",
    )
    parser.add_argument("--solvers", default=",".join(SOLVERS), help="names with commas between")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results")
    arguments = parser.parse_args()
    if arguments.quick:
        return quick()
    unknown = set(arguments.solvers.split(",")) - SOLVERS.keys()
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: solvers are {', '.join(SOLVERS)}")
    arguments.output.mkdir(parents=True, exist_ok=True)
    path = arguments.output / "full.jsonl"
    solvers = arguments.solvers.split(",")
    done = defaultdict(set)
    for line in current(path, solvers):
        done[line["key"]].add(line["solver"])
    stages = {int(each) for each in arguments.stages.split(",")}
    cases = [
        case for case in full_cases() if arguments.only in case.key and stage_of(case) in stages
    ]
    to_ask = [(case, asked(case, solvers)) for case in cases]
    todo = [
        (case, missing)
        for case, names in to_ask
        if (missing := [name for name in names if name not in done[case.key]])
    ][: arguments.most]
    print(f"{len(todo)} of {len(cases)} cases to do, results in {path}", flush=True)
    run(todo, path, arguments)
    failed = [line for line in current(path, solvers) if "error" in line]
    for line in failed:
        print(f"{line['solver']} failed on {line['key']}: {line['error']}")
    return 1 if failed else 0


def quick() -> int:
    """Ask the project's own diagnosis a few cases; return 1 where a verdict is wrong."""
    wrong = 0
    for case, verdict in quick_cases():
        begun = time.process_time()
        answer = diagnosed_sessions(None, [pose_riddle(case).days[0].read], case.seed)
        named = [name for members in answer.classes for name in members]
        good = answer.verdict == verdict and {name.split("@")[0] for name in named} <= {
            effect for effect, _, _ in case.effects
        }
        wrong += not good
        seconds = time.process_time() - begun
        said = f"{answer.verdict} {' '.join(named)}".strip()
        print(f"{'ok   ' if good else 'WRONG'} {case.key}: {said} ({seconds:.0f} s)", flush=True)
    return 1 if wrong else 0


def run(todo: Sequence[tuple[Case, list[str]]], path: Path, arguments: argparse.Namespace) -> None:
    """Solve cases and append their scores to the results file as they come."""
    begun = time.monotonic()
    for stage in sorted({stage_of(case) for case, _ in todo}):
        part = [each for each in todo if stage_of(each[0]) == stage]
        print(f"stage {stage}: {len(part)} cases", flush=True)
        for design in sorted({design_of(case) for case, _ in part}):
            dictionary(design, arguments.output, arguments.processes)
        _stage(part, path, arguments, begun)
        if _over(arguments, begun):
            return


def _over(arguments: argparse.Namespace, begun: float) -> bool:
    return bool(arguments.minutes and time.monotonic() - begun > 60.0 * arguments.minutes)


def _stage(
    todo: Sequence[tuple[Case, list[str]]],
    path: Path,
    arguments: argparse.Namespace,
    begun: float,
) -> None:
    progress = Progress("cases")
    left = dict.fromkeys(range(len(todo)))
    for _ in range(RESTARTS):
        try:
            with ProcessPoolExecutor(arguments.processes) as pool:
                _drain(pool, todo, left, path, arguments, begun, progress)
            return
        except BrokenProcessPool:
            print("a process was killed; what it worked on is tried again", flush=True)


def _drain(
    pool: ProcessPoolExecutor,
    todo: Sequence[tuple[Case, list[str]]],
    left: dict[int, None],
    path: Path,
    arguments: argparse.Namespace,
    begun: float,
    progress: Progress,
) -> None:
    waiting = {pool.submit(solve, *todo[number], arguments.output): number for number in left}
    with path.open("a", encoding="utf-8") as out:
        for finished in as_completed(waiting):
            if finished.cancelled():
                continue
            # One write a case: a run that is stopped leaves whole cases behind.
            out.write("".join(json.dumps(line) + "\n" for line in finished.result()))
            out.flush()
            del left[waiting[finished]]
            progress(len(todo) - len(left), len(todo))
            if _over(arguments, begun):
                for future in waiting:
                    future.cancel()


if __name__ == "__main__":
    sys.exit(main())
