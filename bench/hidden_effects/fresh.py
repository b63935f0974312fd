"""Fresh riddles, drawn once, on which searches are compared.

    python bench/hidden_effects/fresh.py run --output results.jsonl [--part 0/2] [--only KIND]

A list that was looked at while the search was mended is no longer fresh.  `unseen` asks every
effect and every stranger once, on wrists from `--first` on, which nothing else may have used.

Answers are judged by their names alone.

`fresh_cases.json` was drawn with `draw` and committed before any search was asked.  The same file
runs in an older checkout: each line holds a digest of what was measured, so that two files can be
seen to be about the same riddles.  Stop and start again at will.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hashlib
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import observe
from cases import Case, Place, one_each, searched
from observe import hidden_effects, run_cell
from own_diagnosis import diagnosed

from wrist_stiffness.errors import InputError
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.simulation.catalogue import CATALOGUE, STRANGERS, HiddenEffect, is_plausible

LIST = Path(__file__).with_name("fresh_cases.json")

DRAWN_FROM = 20261123
"""Seed of the draw."""

FIRST_WRIST = 1001
"""Seeds of wrists and noise from here on were never used before."""

DENSE_HZ = 100.0
"""Of a tracker, as `simulate` writes it."""


def draw() -> list[dict[str, Any]]:
    """Return the riddles of the comparison, mixed: a beginning of the list is a fair sample."""
    rng = np.random.default_rng(DRAWN_FROM)
    places, strangers = searched(CATALOGUE), searched(STRANGERS)

    def some(pool: Sequence[Place], count: int) -> list[Place]:
        order = [int(i) for _ in range(-(-count // len(pool))) for i in rng.permutation(len(pool))]
        return [pool[i] for i in order[:count]]

    def pairs(count: int) -> list[tuple[Place, Place]]:
        found: list[tuple[Place, Place]] = []
        while len(found) < count:
            one, two = some(places, 2)
            if one[0] != two[0]:
                found.append((one, two))
        return found

    sound = Case((), 0.0)
    riddles: list[tuple[str, Case, int, bool]] = []
    riddles += [("nothing", sound, 1, True) for _ in range(60)]
    riddles += [("nothing_dense", replace(sound, instrument="tracker"), 1, False)] * 16
    # Every effect once before any twice: rare ones count as much as those at many places.
    effects = one_each(CATALOGUE)
    sizes = [1.0, 3.0, 10.0, 30.0]
    for number in range(48):
        law = effects[number % len(effects)][0]
        place = some([each for each in places if each[0] == law], 1)[0]
        riddles.append(("single", Case((place,), sizes[(number + number // 28) % 4]), 1, True))
    riddles += [
        ("outside", Case((each,), size), 1, True)
        for each, size in zip(some(strangers, 18), [3.0, 10.0, 30.0] * 6, strict=True)
    ]
    riddles += [
        ("double", Case(pair, (3.0, 10.0)[n % 2]), 1, True) for n, pair in enumerate(pairs(20))
    ]
    riddles += [("two_days", Case((each,), 3.0), 2, True) for each in some(places, 10)]
    riddles += [("two_days", Case((each,), 10.0), 2, True) for each in some(strangers, 3)]
    riddles += [("two_days", sound, 2, True)] * 5
    order = rng.permutation(len(riddles))
    out = []
    for number, place in enumerate(order):
        group, case, days, stated = riddles[int(place)]
        case = replace(case, seed=FIRST_WRIST + number)
        out.append({"group": group, "days": days, "stated": stated, "case": asdict(case)})
    return out


def listed() -> list[tuple[str, Case, int, bool]]:
    """Return the committed riddles."""
    found = []
    for each in json.loads(LIST.read_text(encoding="utf-8")):
        own = dict(each["case"])
        own["effects"] = tuple(tuple(place) for place in own["effects"])
        found.append((each["group"], Case(**own), each["days"], each["stated"]))
    return found


def unseen(first: int) -> list[tuple[str, Case, int, bool]]:
    """Return every stranger and every effect once, in wrists and noise of seeds from `first` on."""
    pool = [("outside", place, 10.0) for place in one_each(STRANGERS)]
    pool += [("single", place, 3.0) for place in one_each(CATALOGUE)]
    return [
        (group, Case((place,), size, seed=first + number), 1, True)
        for number, (group, place, size) in enumerate(pool)
    ]


def posed(case: Case, days: int) -> tuple[tuple[HiddenEffect, ...], list[MeasuredSession]]:
    """Return what hides, and the sessions that a search may see.

    Raises
    ------
    InputError
        If the size is out of reach, or the wrist finds no equilibrium on one of the days.
    """
    hidden = hidden_effects(case)
    sessions = [observe.observe(case, hidden, 0)]
    # Nobody sees the next day, but a wrist that cannot do its motions is none of the riddles.
    run_cell(case, hidden, 1)
    if days == 2:
        sessions.append(observe.observe(case, hidden, 2))
    return hidden, sessions


def dense(case: Case) -> MeasuredSession:
    """Return a session at 100 Hz whose instrument says nothing of its scatter."""
    usual, observe.RATE_HZ = observe.RATE_HZ, DENSE_HZ
    try:
        session = observe.observe(case, (), 0)
    finally:
        observe.RATE_HZ = usual
    return replace(session, covariance=None)


def digest(sessions: Sequence[MeasuredSession]) -> str:
    """Return a short digest of what was measured."""
    found = hashlib.sha256()
    for each in sessions:
        for values in (each.block.theta, each.block.load, each.shift, each.rotation):
            found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()[:12]


def answer(group: str, case: Case, days: int, stated: bool) -> dict[str, Any]:
    """Return the line of one riddle."""
    line: dict[str, Any] = {"group": group, "key": case.key, "seed": case.seed, "size": case.size}
    hidden: tuple[HiddenEffect, ...] = ()
    try:
        if stated:
            hidden, sessions = posed(case, days)
        else:
            sessions = [dense(case)]
    except InputError as error:
        return line | {"out_of_reach": str(error)}
    line |= {
        "digest": digest(sessions),
        "truth": [f"{each.effect}@{each.component}" for each in hidden],
    }
    begun, clock = time.process_time(), time.perf_counter()
    try:
        found = diagnosed(sessions)
    except Exception as error:
        return line | {"error": repr(error)}
    line |= {"cpu_s": time.process_time() - begun, "seconds": time.perf_counter() - clock}
    return line | found | judged(found["named"], hidden)


def judged(named: Sequence[Sequence[str]], hidden: Sequence[HiddenEffect]) -> dict[str, Any]:
    """Return what kind of riddle it was, and which share of its effects stand in a class."""
    truth = [f"{each.effect}@{each.component}" for each in hidden]
    hits = [any(name in names for names in named) for name in truth]
    kind = ("none", "single", "double")[len(hits)]
    if any(each.effect in STRANGERS for each in hidden):
        kind = "stranger"
    found = float(np.mean(hits)) if hits else 0.0
    plausible = all(is_plausible(each) for each in hidden)
    return {"kind": kind, "plausible": plausible, "inside": any(hits), "found": found}


def run(
    riddles: Sequence[tuple[str, Case, int, bool]],
    output: Path,
    part: tuple[int, int],
    only: str,
) -> None:
    """Ask all riddles of a part that have no line yet."""
    done = set()
    if output.exists():
        done = {json.loads(line)["seed"] for line in output.read_text().splitlines()}
    for number, (group, case, days, stated) in enumerate(riddles):
        if number % part[1] != part[0] or case.seed in done or only not in group:
            continue
        line = answer(group, case, days, stated)
        with output.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        print(number, json.dumps(line)[:300], flush=True)


def main() -> None:
    """Draw, run or tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("draw", "run", "unseen"))
    parser.add_argument("--output", type=Path, default=Path("fresh.jsonl"))
    parser.add_argument("--part", default="0/1", help="which of how many parts of the list")
    parser.add_argument("--only", default="", help="only groups whose name holds this")
    parser.add_argument("--first", type=int, default=9101, help="seed of the first unseen wrist")
    given = parser.parse_args()
    if given.what == "draw":
        rows = [json.dumps(each) for each in draw()]
        LIST.write_text("[\n" + ",\n".join(rows) + "\n]\n", encoding="utf-8")
        return
    first, count = map(int, given.part.split("/"))
    riddles = unseen(given.first) if given.what == "unseen" else listed()
    run(riddles, given.output, (first, count), given.only)


if __name__ == "__main__":
    main()
