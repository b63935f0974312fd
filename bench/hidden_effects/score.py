"""How good an answer is, and how sure one can be of a rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bench_wrist import Array
from dictionary import Word, nuisance_names
from observe import Riddle
from solvers import Answer

Z = 1.96
"""Of a two-sided 95 % interval."""


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (Wilson 1927)."""
    if trials == 0:
        return 0.0, 1.0
    rate = hits / trials
    centre = rate + Z * Z / (2 * trials)
    half = Z * np.sqrt(rate * (1 - rate) / trials + Z * Z / (4 * trials * trials))
    scale = 1 + Z * Z / trials
    return max(0.0, float((centre - half) / scale)), min(1.0, float((centre + half) / scale))


def heldout_ratio(riddle: Riddle, answer: Answer, words: Sequence[Word]) -> tuple[float, float]:
    """Return the whitened error in the second session over its noise floor, before and after.

    Registrations, zeros and tare of that session are refitted in all three; the floor is the same
    day, noise for noise, of a wrist that is exactly its table.
    """
    session = riddle.test
    slow = session.wander[:6, :6]
    factor = np.linalg.cholesky(session.covariance + slow)
    columns = np.concatenate([w.test for w in words if w.name in nuisance_names()], axis=2)
    white = np.linalg.solve(factor, columns).reshape(-1, columns.shape[2])
    basis, sizes, _ = np.linalg.svd(white / np.linalg.norm(white, axis=0), full_matrices=False)
    basis = basis[:, sizes > 1e-6 * sizes[0]]

    def error(values: Array) -> float:
        flat = np.linalg.solve(factor, values[..., None])[..., 0].reshape(-1)
        return float(np.linalg.norm(flat - basis @ (basis.T @ flat)))

    floor = error(riddle.floor)
    before = error(session.residual) / floor
    return before, error(session.residual - answer.predicted) / floor


@dataclass(frozen=True)
class Line:
    """Score of one case by one solver, as it is kept in the results file."""

    key: str
    solver: str
    kind: str
    effect: str
    size: float
    base: str
    experiment: str
    verdict: str
    top: bool
    inside: bool
    class_size: int
    spurious: int
    before: float
    after: float


def score(riddle: Riddle, name: str, answer: Answer, words: Sequence[Word]) -> Line:
    """Return the scores of one answer."""
    case = riddle.case
    truths = {f"{h.effect}@{h.component}" for h in riddle.hidden}
    first = answer.classes[0] if answer.classes else ()
    before, after = heldout_ratio(riddle, answer, words)
    return Line(
        key=case.key,
        solver=name,
        kind=case.kind,
        effect="+".join(sorted(h.effect for h in riddle.hidden)) or "nothing",
        size=case.size,
        base=case.base,
        experiment=case.experiment,
        verdict=answer.verdict,
        top=bool(first) and first[0] in truths,
        inside=bool(truths & set(first)),
        class_size=len(first),
        spurious=sum(not truths & set(members) for members in answer.classes),
        before=before,
        after=after,
    )


def table(lines: Sequence[dict[str, Any]], group: str) -> str:
    """Return a Markdown table of all solvers over a group (`kind` or `effect`)."""
    rows = [
        f"| {group} | solver | cases | right top answer | inside first class | class size "
        "| names something | unknown | spurious | error before | after |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for value in sorted({line[group] for line in lines}):
        for solver in sorted({line["solver"] for line in lines}):
            mine = [line for line in lines if line[group] == value and line["solver"] == solver]
            if mine:
                rows.append(f"| {value} | {solver} | {_cells(mine)} |")
    return "\n".join(rows)


def _cells(lines: Sequence[dict[str, Any]]) -> str:
    n = len(lines)
    cells = [str(n)]
    for name in ("top", "inside"):
        cells.append(_rate(sum(line[name] for line in lines), n))
    sizes = [line["class_size"] for line in lines if line["class_size"]]
    cells.append(f"{np.mean(sizes):.1f}" if sizes else "-")
    for verdict in ("effect", "unknown"):
        cells.append(_rate(sum(line["verdict"] == verdict for line in lines), n))
    cells.append(f"{np.mean([line['spurious'] for line in lines]):.2f}")
    cells += [f"{np.median([line[name] for line in lines]):.2f}" for name in ("before", "after")]
    return " | ".join(cells)


def _rate(hits: int, n: int) -> str:
    low, high = wilson(hits, n)
    return f"{100 * hits / n:.0f} % ({100 * low:.0f}–{100 * high:.0f})"
