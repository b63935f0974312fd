"""How much of an ordinary wrist must be known to come near its floor on another day.

    python bench/hidden_effects/how_much.py --processes 2

Nothing is diagnosed here.  The simulation's own laws are told the largest of what hides, exactly;
or all of it, each magnitude wrong by chance.  Each answer is calibrated and judged as those of the
solvers are.  And effects are ordered by what they add as far as that is above a limit, below it
by their usual sizes: how far an order must be known.  Lines are kept in results/how_much.jsonl; a
second start does what is missing.  A wrist takes some ten minutes.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bench_wrist import TRUTH, code_version
from cases import Case, full_cases
from dictionary import Dictionary, design_of, dictionary
from kept_lines import asked
from observe import Riddle, observe, pose_riddle
from scipy.stats import spearmanr
from score import HeldOut, floor
from usual_sizes import usual_sizes

from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.catalogue import HiddenEffect

LARGEST = (0, 1, 2, 3, 5, 8, 12)
"""So many effects are told, exactly."""

WRONG = (0.0, 0.01, 0.03, 0.1, 0.3)
"""Standard deviations of the relative error of every magnitude, all effects told."""

ABOVE = (0.2, 0.5, 1.0, np.inf)
"""Times the floor above which it is told what an effect adds."""


def version() -> str:
    """Return the digest of the truth and of how it is judged."""
    return code_version(TRUTH, ("cases.py", "observe.py", "score.py", "how_much.py"))


def ask(case: Case, folder: Path) -> list[dict[str, Any]]:
    """Return a line for each thing that is told; one line that says so without an equilibrium."""
    try:
        riddle = pose_riddle(case)
    except InputError as error:
        return [{"key": case.key, "version": version(), "told": "", "error": str(error)}]
    words = dictionary(design_of(case), False, folder)
    held = HeldOut(riddle, words)
    least = floor(case.bare, words)
    # Largest by what each does alone to the second day.
    size = [held.contribution(part) for part in riddle.parts.values()]
    ordered = [riddle.hidden[place] for place in np.argsort(size)[::-1]]
    lines: list[dict[str, Any]] = [
        {"key": case.key, "version": version(), "told": name, "rank": rank}
        for name, rank in _ranks(riddle, words, np.array(size) / least).items()
    ]
    told = {f"largest {count}": tuple(ordered[:count]) for count in LARGEST}
    rng = np.random.default_rng(case.seed)
    chance = rng.standard_normal(len(riddle.hidden))
    for share in WRONG:
        factors = np.exp(share * chance)
        told[f"all, wrong by {share:.0%}"] = tuple(
            replace(each, magnitude=each.magnitude * float(factor))
            for each, factor in zip(riddle.hidden, factors, strict=True)
        )
    for name, effects in told.items():
        line = {"key": case.key, "version": version(), "told": name}
        try:
            one, two = explained(riddle, effects)
        except InputError as error:
            lines.append(line | {"error": str(error)})
            continue
        error = held.error(riddle.train.residual - one, riddle.test.residual - two)
        lines.append(line | {"after": float(error / least)})
    return lines


def _ranks(riddle: Riddle, words: Dictionary, added: np.ndarray) -> dict[str, float]:
    """Return Spearman's correlations of orders that are exact above a limit."""
    usual = usual_sizes(riddle, words).suspects
    said = np.array([usual.get(name, 0.0) for name in riddle.parts])
    highest = float(said.max())
    return {
        _order(limit): float(
            spearmanr(added, np.where(added > limit, highest + added, said)).statistic
        )
        for limit in ABOVE
    }


def _order(limit: float) -> str:
    exact = f", exact above {limit:g} x the floor" if limit < np.inf else ""
    return f"order by usual sizes{exact}"


def explained(riddle: Riddle, effects: tuple[HiddenEffect, ...]) -> list[np.ndarray]:
    """Return what some effects do together to both days, (u, 6) each, without noise."""
    if not effects:
        return [np.zeros_like(day.residual) for day in riddle.bare]
    return [
        observe(riddle.case, effects, session, riddle.bare_days[session]).units.residual
        - riddle.bare[session].residual
        for session in (0, 1)
    ]


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return medians and ranges in Markdown, in the order in which things are told."""
    names = [*(f"largest {n}" for n in LARGEST), *(f"all, wrong by {s:.0%}" for s in WRONG)]
    names += [_order(limit) for limit in ABOVE]
    rows = [
        "| told | wrists | error after, or rank: median | least | most |",
        "|---|---|---|---|---|",
    ]
    for name in names:
        own = [line for line in lines if line["told"] == name]
        found = [line.get("after", line.get("rank")) for line in own if "error" not in line]
        if found:
            rows.append(
                f"| {name} | {len(found)} | {np.median(found):.2f} "
                f"| {min(found):.2f} | {max(found):.2f} |"
            )
    return "\n".join(rows)


def main() -> None:
    """Ask what is missing and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "results")
    arguments = parser.parse_args()
    wrists = [case for case in full_cases() if case.main and case.ordinary]
    print(
        table(
            asked(
                partial(ask, folder=arguments.output),
                wrists,
                arguments.output / "how_much.jsonl",
                version(),
                arguments.processes,
            )
        )
    )


if __name__ == "__main__":
    main()
