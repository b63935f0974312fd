"""Counts, medians and ratios of paired cases, with bootstrap intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from arms import EXTRA

RATES = (("random", "poses"), ("random", "measurements"), ("random_once", "poses"))

NEVER_PLANNED = 2.0 * EXTRA
"""Counts for a class that planned poses never resolve; for random ones it is `EXTRA`, the least
that it can be: both to the disadvantage of the plan."""


def report(lines: Sequence[dict[str, Any]]) -> None:
    """Print what became of the draws, each case, and ratios over the cases."""
    left_out = Counter(line["left_out"] for line in lines if "left_out" in line)
    drawn = [line for line in lines if "left_out" not in line]
    cases = [
        line for line in drawn if any(np.isfinite(line[k]["poses"]) for k in ("planned", "random"))
    ]
    print(f"{len(lines)} draws, {len(cases)} cases")
    left_out[f"neither planned nor {EXTRA} random poses resolve it"] = len(drawn) - len(cases)
    for why, count in left_out.most_common():
        print(f"  {count:4d} left out: {why}")
    for line in cases:
        figures = "  ".join(
            f"{arm} {line[arm]['poses']:g} ({line[arm]['measurements']:g})"
            for arm in ("planned", "random", "random_once")
        )
        print(f"{line['seed']} {line['truth']}: {figures}  against {', '.join(line['twins'])}")
    for arm, unit in RATES:
        _ratios(
            np.array([[line["planned"][unit], line[arm][unit]] for line in cases]),
            f"planned / {arm}, {unit}",
        )


def _ratios(pairs: np.ndarray, what: str) -> None:
    never = np.count_nonzero(~np.isfinite(pairs), axis=0)
    capped = np.where(np.isfinite(pairs), pairs, [NEVER_PLANNED, EXTRA])
    rng = np.random.default_rng(0)
    draws = capped[rng.integers(len(capped), size=(4000, len(capped)))]
    medians, ratios = np.median(capped, axis=0), capped[:, 0] / capped[:, 1]
    print(f"{what}: medians {medians[0]:g} and {medians[1]:g}, never {never[0]} and {never[1]}")
    for name, value, drawn in (
        ("median of the ratios", np.median(ratios), _medians(draws)),
        ("ratio of the medians", medians[0] / medians[1], _of_medians(draws)),
        ("geometric mean of the ratios", _mean(ratios), _mean(draws[..., 0] / draws[..., 1])),
        ("ratio of the sums", capped[:, 0].sum() / capped[:, 1].sum(), _of_sums(draws)),
    ):
        low, high = np.quantile(drawn, [0.025, 0.975])
        print(f"  {name} {value:.2f} (95 % {low:.2f} to {high:.2f})")


def _medians(draws: np.ndarray) -> np.ndarray:
    return np.median(draws[..., 0] / draws[..., 1], axis=1)


def _of_medians(draws: np.ndarray) -> np.ndarray:
    low, high = np.moveaxis(np.median(draws, axis=1), -1, 0)
    return low / high


def _mean(ratios: np.ndarray) -> np.ndarray:
    return np.exp(np.mean(np.log(ratios), axis=-1))


def _of_sums(draws: np.ndarray) -> np.ndarray:
    low, high = np.moveaxis(draws.sum(axis=1), -1, 0)
    return low / high
