"""Ask the search of before (851a63e) and today's the same fresh riddles.

    python bench/hidden_effects/side_by_side.py pose SESSIONS
    git worktree add ../before 851a63e
    PYTHONPATH=../before:../before/bench/hidden_effects \
        python bench/hidden_effects/side_by_side.py ask SESSIONS before.jsonl
    python bench/hidden_effects/side_by_side.py tell before.jsonl fresh.jsonl

What was measured is handed over as arrays: the virtual cell and the readers have changed since.
`fresh.jsonl` is of `fresh.py run --names`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import pickle
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np


def pose(folder: Path) -> None:
    """Write the sessions of all riddles that can be built."""
    import fresh

    from wrist_stiffness.errors import InputError

    folder.mkdir(parents=True, exist_ok=True)
    for group, case, days, stated in fresh.listed():
        try:
            riddle, sessions = fresh.posed(case, days) if stated else (None, [fresh.dense(case)])
        except InputError:
            continue
        line = {
            "group": group,
            "seed": case.seed,
            "truth": [f"{e.effect}@{e.component}" for e in (riddle.hidden if riddle else ())],
        }
        told = [{**vars(one), "block": vars(one.block), "readings": None} for one in sessions]
        (folder / f"{case.seed}.pkl").write_bytes(pickle.dumps((line, told)))


def ask(folder: Path, output: Path) -> None:
    """Diagnose them by the search of before; stop and start again at will."""
    from bench_wrist import wrist
    from wrist_stiffness.campaign.measured_session import MeasuredSession
    from wrist_stiffness.campaign.searching.diagnose import diagnose_sessions

    from wrist_stiffness.model.block import Block
    from wrist_stiffness.model.error_model import ErrorModel

    model = ErrorModel("benchmark", wrist(), "closed_form")
    known = output.read_text().splitlines() if output.exists() else []
    done = {json.loads(line)["seed"] for line in known}
    for path in sorted(folder.glob("*.pkl")):
        line, told = pickle.loads(path.read_bytes())
        if line["seed"] in done:
            continue
        sessions = []
        for one in told:
            own = {name: one[name] for name in MeasuredSession.__dataclass_fields__}
            block = {name: one["block"][name] for name in Block.__dataclass_fields__}
            sessions.append(MeasuredSession(**own | {"block": Block(**block)}))
        begun = time.process_time()
        found = diagnose_sessions(model, sessions, np.random.default_rng(line["seed"])).diagnosis
        line |= {"verdict": found.verdict, "named": [list(each.names) for each in found.findings]}
        line["cpu_s"] = time.process_time() - begun
        with output.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def tell(before: Path, now: Path) -> None:
    """Print both beside each other, riddle by riddle of the same kind."""
    lines = {d["seed"]: d for d in map(json.loads, before.read_text().splitlines())}
    today = {d["seed"]: d for d in map(json.loads, now.read_text().splitlines())}
    rows: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {}
    for seed, old in lines.items():
        new = today[seed] | {"truth": old["truth"]}
        kind = old["group"] if new.get("plausible", True) else "larger than usual"
        kind += ", nothing hides" if kind == "two_days" and not old["truth"] else ""
        rows.setdefault(kind, []).append((old, new))
    print("| | cases | right | a wrong name | *unknown* | *none* | CPU, median and longest |")
    print("|---|---|---|---|---|---|---|")
    for kind, pairs in sorted(rows.items()):
        cells = [
            " / ".join(str(sum(test(pair[place]) for pair in pairs)) for place in (0, 1))
            for test in (_right, _wrong, _verdict("unknown"), _verdict("none"))
        ]
        times = [np.array([pair[place]["cpu_s"] for pair in pairs]) for place in (0, 1)]
        spent = " / ".join(f"{np.median(own):.0f} and {own.max():.0f} s" for own in times)
        print(f"| {kind} | {len(pairs)} | {' | '.join(cells)} | {spent} |")


def _right(line: dict[str, Any]) -> bool:
    return any(set(names) & set(line["truth"]) for names in line["named"])


def _wrong(line: dict[str, Any]) -> bool:
    return any(not set(names) & set(line["truth"]) for names in line["named"])


def _verdict(word: str) -> Any:
    return lambda line: line["verdict"] == word


if __name__ == "__main__":
    task, *words = sys.argv[1:] or ["--help"]
    tasks = {"pose": pose, "ask": ask, "tell": tell}
    if task not in tasks:
        sys.exit(__doc__)
    tasks[task](*map(Path, words))
