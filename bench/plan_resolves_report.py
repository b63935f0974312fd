"""Medians and ratios of paired cases, with bootstrap intervals."""

from __future__ import annotations

import numpy as np


def report(pairs: np.ndarray, what: str, never_counts: float) -> None:
    """Print medians with bootstrap intervals; what is never resolved counts as given."""
    capped = np.where(np.isfinite(pairs), pairs, never_counts)
    rng = np.random.default_rng(0)
    draws = capped[rng.integers(len(capped), size=(4000, len(capped)))]
    for name, column in (("planned", 0), ("random", 1)):
        never = int(np.sum(~np.isfinite(pairs[:, column])))
        print(f"{name:8s} median {np.median(capped[:, column]):4.1f} {what}, never {never}")
    print(
        f"planned / random {what}: median of the cases' ratios "
        f"{_spread(np.median(draws[..., 0] / draws[..., 1], axis=1), capped[:, 0] / capped[:, 1])}"
        f", ratio of the medians "
        f"{np.median(capped[:, 0]) / np.median(capped[:, 1]):.2f} "
        f"({_interval(np.median(draws[..., 0], axis=1) / np.median(draws[..., 1], axis=1))}), "
        f"ratio of the sums {capped[:, 0].sum() / capped[:, 1].sum():.2f} "
        f"({_interval(draws[..., 0].sum(axis=1) / draws[..., 1].sum(axis=1))})"
    )


def _spread(draws: np.ndarray, values: np.ndarray) -> str:
    return f"{np.median(values):.2f} ({_interval(draws)})"


def _interval(draws: np.ndarray) -> str:
    low, high = np.quantile(draws, [0.025, 0.975])
    return f"95 % {low:.2f} to {high:.2f}"
