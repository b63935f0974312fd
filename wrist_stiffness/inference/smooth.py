"""Smooth functions of the conditions of a table: on what an error may depend, without a law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.projection import low_rank

LANDMARKS = 400
"""Most different conditions from which the columns of a question are made."""

LENGTHS = (1.2, 0.35)
"""Lengths of the smooth functions of one condition in its standard deviations, half of their
variance each: a bow over the whole range and some waves in it (assumed)."""

RANK, LEAST_RANK, RANK_TOGETHER = 10, 4, 24
"""Columns of a question about one condition: at most, and at least where all together would have
more than half as many as there are units; and at most of a question about several."""

PAIRS = 4
"""With more conditions than these, all of them together are asked about instead of every pair."""

WANDER_SHARES, WANDER_RANK = (0.05, 0.3), 24
"""Correlation times of an instrument's drift as shares of a session (assumed), and the columns of
one component in it."""


@dataclass(frozen=True, eq=False)
class Smooth:
    """Smooth functions of some conditions, as columns for any units.

    The columns are those of a Gaussian process by its values at a few landmarks (Nystroem), chosen
    by a pivoted Cholesky factor; no order of the rows has a part in them.
    """

    name: str  # as a person reads it after "depends on"
    of: tuple[str, ...]  # conditions
    # (d,), of the conditions in the table that it was made from
    mean: Array
    spread: Array
    lengths: tuple[float, ...]  # of the kernel, in standard deviations
    marks: Array  # (k, d), landmarks, scaled
    factor: Array  # (k, k), lower factor of the kernel among them
    centre: Array  # (k,), mean of the columns: a constant depends on nothing
    size: float  # root mean square of a function

    def features(self, conditions: Mapping[str, Array]) -> Array:
        """Return the columns for units under any conditions, (u, k)."""
        return (self._raw(conditions) - self.centre) / self.size

    def as_dict(self) -> dict[str, Any]:
        """Return it for a JSON file."""
        own = {each.name: getattr(self, each.name) for each in fields(self)}
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in own.items()}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Smooth:
        """Return it as it was written."""
        tuples = {key: tuple(values[key]) for key in ("of", "lengths")}
        arrays = {
            key: np.array(values[key]) for key in ("mean", "spread", "marks", "factor", "centre")
        }
        return cls(**{**values, **tuples, **arrays})

    def _raw(self, conditions: Mapping[str, Array]) -> Array:
        values = np.stack([conditions[name] for name in self.of], axis=1)
        near = _kernel((values - self.mean) / self.spread, self.marks, self.lengths)
        return np.asarray(solve_triangular(self.factor, near.T, lower=True).T)


def smooth(name: str, of: tuple[str, ...], table: Observations, rank: int) -> Smooth | None:
    """Return the smooth functions of some conditions; None where they never change."""
    values = np.stack([table.covariate(each) for each in of], axis=1)
    mean, spread = values.mean(axis=0), values.std(axis=0)
    if not np.all(spread > 1e-9 * (np.abs(values).max(axis=0) + 1e-300)):
        return None
    distinct = np.unique(np.round((values - mean) / spread, 9), axis=0)
    if len(distinct) > LANDMARKS:
        chosen = np.random.default_rng(0).choice(len(distinct), LANDMARKS, replace=False)
        distinct = distinct[np.sort(chosen)]
    several = (float(np.sqrt(len(of))),)
    lengths = LENGTHS if len(of) == 1 else several
    most = max(min(rank, table.n_units // 3), 1)
    marks = distinct[low_rank(_kernel(distinct, distinct, lengths), most, np.max)[1]]
    whole = _kernel(marks, marks, lengths) + 1e-9 * np.eye(len(marks))
    factor: Array = np.asarray(np.linalg.cholesky(whole), dtype=np.float64)
    zero, one = np.zeros(len(marks)), 1.0
    bare = Smooth(name, of, mean, spread, lengths, marks, factor, zero, one)
    raw = bare.features(table.covariates)
    centre = raw.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((raw - centre) ** 2, axis=1))))
    if size < 1e-6:
        return None
    return Smooth(name, of, mean, spread, lengths, marks, factor, centre, size)


def questions(table: Observations) -> tuple[Smooth, ...]:
    """Return what is asked of any table: each condition, and several together."""
    names = sorted(table.covariates)
    rank = min(RANK, max(LEAST_RANK, table.n_units // (2 * max(len(names), 1))))
    asked: list[Smooth | None] = [smooth(name, (name,), table, rank) for name in names]
    moving = [name for name, found in zip(names, asked, strict=True) if found is not None]
    if len(moving) <= PAIRS:
        groups: Sequence[tuple[str, ...]] = list(combinations(moving, 2))
    else:
        groups = [tuple(moving)]
    for group in groups:
        label = " and ".join(group) if len(group) == 2 else "several conditions"
        asked.append(smooth(f"{label} together", group, table, RANK_TOGETHER))
    return tuple(each for each in asked if each is not None)


def alike(table: Observations, rank: int) -> Array:
    """Return columns (u, k) of units under like conditions, for which a law errs alike."""
    names = tuple(sorted(table.covariates))
    moving = tuple(name for name in names if smooth(name, (name,), table, 1) is not None)
    together = smooth("all", moving, table, rank) if moving else None
    constant = np.ones((table.n_units, 1)) / np.sqrt(2.0)
    if together is None:
        return constant
    return np.column_stack([constant, together.features(table.covariates) / np.sqrt(2.0)])


def by_session(table: Observations, columns: Callable[[Array], Array]) -> Array:
    """Return columns (u, k) over the times of each session by itself, one session after another."""
    parts = [np.zeros((table.n_units, 0))]
    for session in np.unique(table.sessions):
        at = table.sessions == session
        own = columns(table.times[at])
        parts.append(np.zeros((table.n_units, own.shape[1])))
        parts[-1][at] = own
    return np.concatenate(parts, axis=1)


def wander(times: Array) -> Array:
    """Return columns (u, k) of a slow drift of unit variance over the true times of a session.

    Ornstein-Uhlenbeck of two correlation times, shares of the length of the session.
    """
    span = float(np.ptp(times)) or 1.0
    marks = np.linspace(times.min(), times.max(), max(min(WANDER_RANK, len(times) // 6), 1))
    near, among = (
        np.mean([np.exp(-np.abs(t[:, None] - marks) / (own * span)) for own in WANDER_SHARES], 0)
        for t in (times, marks)
    )
    factor = np.linalg.cholesky(among + 1e-9 * np.eye(len(marks)))
    return np.asarray(solve_triangular(factor, near.T, lower=True).T)


def _kernel(one: Array, other: Array, lengths: Sequence[float]) -> Array:
    square = cdist(one, other, "sqeuclidean")
    return np.asarray(sum(np.exp(-0.5 * square / each**2) for each in lengths) / len(lengths))
