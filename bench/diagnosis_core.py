"""Hidden effects on a made-up machine: how often the statistical core names the right one.

Usage: ``python bench/diagnosis_core.py [--kind none|single|outside|pair|poor] [--seeds N]``.
Every score carries its 95 % Wilson interval.  Sizes are in units of the scatter of one dwell.
Set ``OMP_NUM_THREADS=1``: the matrices are small.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from diagnosis_arm import base, campaign, catalogue, hide, outsiders
from scipy.stats import binomtest

from wrist_stiffness.inference import Diagnosis, diagnose

SIZES = (0.3, 0.5, 1.0, 3.0, 30.0, 100.0)
LAW_ERRORS = (0.0, 0.05)
KINDS = ("none", "single", "outside", "pair", "poor")


@dataclass(frozen=True)
class Case:
    """One hidden truth.

    Parameters
    ----------
    kind : str
        Row group of the table.
    effects : tuple of (str, float)
        Names and sizes.
    law_error : float
        Share by which the true law differs from the catalogue's.
    seed : int
        Of everything random.
    """

    kind: str
    effects: tuple[tuple[str, float], ...]
    law_error: float
    seed: int

    @property
    def label(self) -> str:
        """Row of the table."""
        size = "/".join(f"{size:g}" for _, size in self.effects)
        return f"{self.kind:8s} size {size:>8s}  law error {self.law_error:.0%}"


def cases(kind: str, seeds: int) -> Iterator[Case]:
    """Every case of one kind."""
    names = [candidate.name for candidate in catalogue()]
    if kind == "none":
        yield from (Case(kind, (), 0.0, seed) for seed in range(seeds * 50))
    elif kind in ("single", "poor"):
        for error in LAW_ERRORS:
            for size in SIZES if kind == "single" else (3.0,):
                for k, name in enumerate(names):
                    for seed in range(seeds):
                        yield Case(kind, ((name, size),), error, 1000 + 37 * k + seed)
    elif kind == "outside":
        for size in SIZES[1:]:
            for name in outsiders():
                for seed in range(4 * seeds):
                    yield Case(kind, ((name, size),), 0.0, 2000 + seed)
    else:
        rng = np.random.default_rng(7)
        for error in LAW_ERRORS:
            for sizes in ((3.0, 3.0), (30.0, 3.0), (30.0, 30.0)):
                for seed in range(16 * seeds):
                    one, two = rng.choice(names, 2, replace=False)
                    yield Case(kind, ((one, sizes[0]), (two, sizes[1])), error, 3000 + seed)


def run(case: Case) -> Diagnosis:
    """Hide, measure, diagnose."""
    known = {candidate.name: candidate for candidate in catalogue()}
    rng = np.random.default_rng(case.seed)
    table = campaign(rng, rich=case.kind != "poor")
    effects = [(known.get(name) or outsiders()[name], size) for name, size in case.effects]
    return diagnose(hide(table, effects, rng, case.law_error), tuple(known.values()), base())


def scores(case: Case, result: Diagnosis) -> dict[str, float]:
    """Count what matters in one case."""
    truths = {name for name, _ in case.effects}
    named = [set(finding.names) for finding in result.findings]
    silent = {f"{each.effect}@{each.component}" for each in result.not_excited}
    score: dict[str, float] = {
        "none": result.verdict in ("none", "undecided"),
        "unknown": result.verdict == "unknown",
        "spurious": sum(not (members & truths) for members in named),
    }
    if case.kind in ("single", "poor"):
        score["in class"] = bool(named) and bool(truths & named[0])
        score["top"] = bool(named) and result.findings[0].name in truths
        score["silent"] = bool(truths & silent)
        if named:
            score["class size"] = len(named[0])
    if case.kind == "pair":
        score["both"] = all(any(truth in members for members in named) for truth in truths)
    quantity = next(iter(result.after))
    if case.kind in ("single", "pair"):
        score["at floor"] = result.after[quantity] <= 1.1 * result.noise[quantity]
    return score


def told(name: str, values: list[float]) -> str:
    """Mean of a count, or a rate with its Wilson interval."""
    if name in ("spurious", "class size"):
        return f"{name} {np.mean(values):.2f}"
    interval = binomtest(int(sum(values)), len(values)).proportion_ci(method="wilson")
    rate, low, high = (100 * x for x in (np.mean(values), interval.low, interval.high))
    return f"{name} {rate:.0f} % [{low:.0f}, {high:.0f}]"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--law-error", type=float, choices=LAW_ERRORS, help="only these cases")
    parser.add_argument("--every", type=int, default=1, help="only every so manyth case")
    parser.add_argument("--log", help="one JSON line per case")
    arguments = parser.parse_args()
    log = open(arguments.log, "w") if arguments.log else None  # noqa: SIM115
    for kind in arguments.kind or KINDS:
        rows: dict[str, list[dict[str, float]]] = defaultdict(list)
        chosen = [
            case
            for case in cases(kind, arguments.seeds)
            if arguments.law_error in (None, case.law_error)
        ]
        for case in chosen[:: arguments.every]:
            result = run(case)
            rows[case.label].append(scores(case, result))
            if log:
                line = {"case": repr(case), **rows[case.label][-1], "result": result.as_json()}
                print(json.dumps(line), file=log, flush=True)
        for label, counted in rows.items():
            columns: dict[str, list[float]] = defaultdict(list)
            for each in counted:
                for name, value in each.items():
                    columns[name].append(float(value))
            cells = ", ".join(told(name, values) for name, values in columns.items())
            print(f"{label} ({len(counted)} cases): {cells}", flush=True)


if __name__ == "__main__":
    main()
