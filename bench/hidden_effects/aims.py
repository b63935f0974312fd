"""The aims of the diagnosis, each with what was reached, its interval, and met or missed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from score import Z, wilson
from tables import Line, newcombe

OWN, CEILING = "own_diagnosis", "knows_the_laws"
NEAR = 0.03
FEW = 5
"""A mean of no more cases decides nothing."""

NAMING = ("elastic_net", "stepwise_bic", "geometry_only")
"""Baselines that name effects."""


def aims(lines: Sequence[Line]) -> str:
    """Return the table of the aims for some answers, of all solvers."""
    own = [line for line in lines if line["solver"] == OWN]
    seen = [line for line in own if line["kind"] == "single" and line["size"] >= 0.5]
    rows = ["| aim | reached | cases | |", "|---|---|---|---|"]
    rows += _against_ceiling(lines, seen)
    for title, kind, test, aim in (
        ("nothing hides: names an effect in 2 % at most", "none", _names, -0.02),
        ("outside the catalogue: unknown in 92 %", "stranger", _unknown, 0.92),
        ("not to be seen: names nothing in 95 %", "unexcitable", _abstains, 0.95),
        ("taken up by the base: names nothing in 95 %", "absorbed", _abstains, 0.95),
        ("two effects: both in 88 %", "double", _both, 0.88),
    ):
        rows.append(_rate(title, [line for line in own if line["kind"] == kind], test, aim))
    rows.append(
        _rate(
            "one effect: error after at most 1.1 in 95 %", seen, lambda x: x["after"] <= 1.1, 0.95
        )
    )
    rows += _against_baselines(lines)
    named = [line["class_size"] for line in seen if line["class_size"]]
    rows.append(_mean("first class: 1.5 members at most", named, 1.5, False))
    for size in sorted({line["size"] for line in seen}):
        wrong = [line["spurious"] for line in seen if line["size"] == size]
        rows.append(_mean(f"size {size:g}: 0.1 spurious findings at most", wrong, 0.1, False))
    whole = [line for line in own if line["kind"] == "ordinary"]
    ranks = [line["rank_correlation"] for line in whole]
    rows.append(_mean("ordinary wrist: rank correlation of 0.8", ranks, 0.8, True))
    after = [line["after_with_suspects"] for line in whole]
    rows.append(_mean("ordinary wrist: error with suspects at most 1.5", after, 1.5, False))
    return "\n".join(row for row in rows if row)


def _names(line: Line) -> bool:
    return bool(line["named"])


def _unknown(line: Line) -> bool:
    return bool(line["verdict"] == "unknown")


def _abstains(line: Line) -> bool:
    return not line["named"]


def _both(line: Line) -> bool:
    return bool(line["found"] == 1.0)


def _verdict(met: bool, sure: bool = True) -> str:
    return ("met" if met else "**missed**") + ("" if sure else " so far")


def _rate(title: str, lines: Sequence[Line], test: Callable[[Line], bool], aim: float) -> str:
    """Return a row; a negative aim is one that must not be exceeded."""
    if not lines:
        return f"| {title} | not run | 0 | |"
    hits, n = sum(map(test, lines)), len(lines)
    low, high = (100 * bound for bound in wilson(hits, n))
    met = hits / n <= -aim if aim < 0.0 else hits / n >= aim
    verdict = _verdict(met, not low <= 100 * abs(aim) <= high)
    return f"| {title} | {100 * hits / n:.0f} % ({low:.0f}–{high:.0f}) | {n} | {verdict} |"


def _mean(title: str, values: Sequence[float], aim: float, at_least: bool) -> str:
    if not values:
        return f"| {title} | not run | 0 | |"
    mean, n = float(np.mean(values)), len(values)
    error = float(np.std(values)) / np.sqrt(max(n - 1, 1))
    met = mean >= aim if at_least else mean <= aim
    verdict = _verdict(met, abs(mean - aim) > Z * error and n > FEW)
    return f"| {title} | {mean:.2f} ± {error:.2f} | {n} | {verdict} |"


def _against_ceiling(lines: Sequence[Line], own: Sequence[Line]) -> list[str]:
    """Return rows of the differences to the solver that knows the laws, on the same cases."""
    ceiling = {line["key"]: line for line in lines if line["solver"] == CEILING}
    mine = [line for line in own if line["key"] in ceiling]
    rows = []
    for name, test in (("inside first class", "inside"), ("right top answer", "top")):
        title = f"one effect, {name}: within 3 points of the ceiling"
        if not mine:
            rows.append(f"| {title} | not run | 0 | |")
            continue
        one = np.array([line[test] for line in mine], dtype=bool)
        two = np.array([ceiling[line["key"]][test] for line in mine], dtype=bool)
        low, high = newcombe(one, two)
        gap = float(one.mean() - two.mean())
        text = f"{100 * gap:+.0f} points ({100 * low:+.0f} to {100 * high:+.0f})"
        verdict = "met" if low >= -NEAR else "**missed**" if high < -NEAR else "not shown"
        if gap > NEAR:
            verdict = f"not shown: with {100 * two.mean():.0f} % it is no ceiling"
        rows.append(f"| {title} | {text} | {len(mine)} | {verdict} |")
    return rows


def _against_baselines(lines: Sequence[Line]) -> list[str]:
    """Return rows that set the best baseline against the project's diagnosis."""

    def mean(solver: str, kind: str, value: Callable[[Line], float]) -> tuple[float, int]:
        mine = [value(x) for x in lines if x["solver"] == solver and x["kind"] == kind]
        return (float(np.mean(mine)) if mine else np.nan), len(mine)

    rows = []
    for title, kind, value, sign in (
        ("one effect: more right top answers", "single", lambda x: float(x["top"]), 1.0),
        ("one effect: fewer spurious findings", "single", lambda x: float(x["spurious"]), -1.0),
        ("nothing hides: fewer false alarms", "none", lambda x: float(_names(x)), -1.0),
    ):
        own, n = mean(OWN, kind, value)
        others = {solver: mean(solver, kind, value)[0] for solver in NAMING}
        best = max(others, key=lambda solver: sign * others[solver])
        if n == 0 or np.isnan(others[best]):
            rows.append(f"| {title} than any baseline | not run | {n} | |")
            continue
        text = f"{own:.2f}, {best} {others[best]:.2f}"
        met = sign * (own - others[best]) > 0.0
        # Of a rate; a mean of counts is wider, so this is the least that is not sure.
        low, high = wilson(round(min(own, 1.0) * n), n)
        verdict = _verdict(met, not low <= others[best] <= high)
        rows.append(f"| {title} than any baseline | {text} | {n} | {verdict} |")
    process = {x["key"]: x["after"] for x in lines if x["solver"] == "gaussian_process"}
    pairs = [
        (x["after"], process[x["key"]])
        for x in lines
        if x["solver"] == OWN and x["kind"] == "single" and x["key"] in process
    ]
    if pairs:
        own_after, other = np.median(np.array(pairs), axis=0)
        rows.append(
            "| one effect: error after not above that of the Gaussian process (medians) | "
            f"{own_after:.2f}, {other:.2f} | {len(pairs)} | {_verdict(own_after <= other)} |"
        )
    return rows
