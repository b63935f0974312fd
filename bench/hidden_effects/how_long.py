"""Two minutes against ten: the same wrists, the same effects, longer sessions.

    python bench/hidden_effects/how_long.py --every 40 --processes 2

Only the names count: whether the first class of the project's diagnosis holds the true effect.
Answers are kept in results/how_long.jsonl; a second start does what is missing.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from bench_wrist import wrist
from cases import Case, singles
from kept_lines import asked
from observe import hidden_effects, observe
from own_diagnosis import version_of_own
from rates import newcombe

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.model.error_model import ErrorModel

MINUTES = (2, 10)


@dataclass(frozen=True)
class LongCase(Case):
    """A case of other duration."""

    minutes: int = 2

    @property
    def seconds(self) -> float:
        """Duration of the session [s]."""
        return 60.0 * self.minutes


def ask(case: Case) -> list[dict[str, Any]]:
    """Return one line for each duration; none where the size is out of reach."""
    try:
        hidden = hidden_effects(case)
    except InputError:
        return []
    truth = f"{hidden[0].effect}@{hidden[0].component}"
    lines = []
    for minutes in MINUTES:
        longer = LongCase(**vars(case), minutes=minutes)
        session = observe(longer, hidden, 0)
        model = ErrorModel("benchmark", wrist(), "closed_form")
        found = diagnose_sessions(model, [session]).diagnosis
        classes = [finding.names for finding in found.findings]
        lines.append(
            {
                "key": case.key,
                "version": version_of_own(),
                "size": case.size,
                "minutes": minutes,
                "verdict": found.verdict,
                "top": bool(classes) and classes[0][0] == truth,
                "inside": bool(classes) and truth in classes[0],
                "spurious": sum(truth not in members for members in classes),
            }
        )
    return lines


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return the comparison in Markdown."""
    rows = ["| | cases | 2 min | 10 min | difference |", "|---|---|---|---|---|"]
    short, long = (
        {line["key"]: line for line in lines if line["minutes"] == minutes} for minutes in MINUTES
    )
    keys = sorted(short.keys() & long.keys())
    if not keys:
        return "No results yet."
    for name, test in (("inside first class", "inside"), ("right top answer", "top")):
        one, two = (np.array([each[key][test] for key in keys]) for each in (short, long))
        low, high = (100 * bound for bound in newcombe(two, one))
        gap = 100 * (two.mean() - one.mean())
        rows.append(
            f"| {name} | {len(keys)} | {100 * one.mean():.0f} % | {100 * two.mean():.0f} % "
            f"| {gap:+.0f} ({low:+.0f} to {high:+.0f}) |"
        )
    one, two = (np.mean([each[key]["spurious"] for key in keys]) for each in (short, long))
    rows.append(f"| spurious | {len(keys)} | {one:.2f} | {two:.2f} | |")
    return "\n".join(rows)


def main() -> None:
    """Ask what is missing and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", type=int, default=40, help="one case in so many")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument(
        "--output", type=Path, default=Path(__file__).parent / "results" / "how_long.jsonl"
    )
    arguments = parser.parse_args()
    chosen = singles()[:: arguments.every]
    print(table(asked(ask, chosen, arguments.output, version_of_own(), arguments.processes)))


if __name__ == "__main__":
    main()
