"""What has no name: the slow drift of an instrument, and the discrepancy of a model.

The discrepancy is a Gaussian process, additive over questions that an engineer asks: does the error
depend on the pose, on the load, on both together, on the side of approach?  Each question is a
kernel over the units, and its amplitude is 0 unless the evidence wants it otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wrist_stiffness.inference.evidence import Array
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.point import Background, Group

DRIFT_S = (20.0, 200.0)
"""Correlation times of an instrument's slow drift, half of its variance each [s] (assumed)."""

DRIFT_RANK = 12
"""Columns of the drift of one component in one session."""

PASSING = 0.3
"""What an instrument drifts within seconds, as a share of what it drifts slowly (assumed)."""

WIDER = 4
"""So many times the columns of a kernel are found before the largest of them are kept."""

SLOW_DRIFT, PASSING_DRIFT = "slow drift of the instrument", "the time"

LEAST = 1e-3
"""Share of a kernel's trace that its columns may leave out."""


@dataclass(frozen=True)
class Question:
    """On what an error may depend.

    Parameters
    ----------
    name : str
        As a person reads it after "depends on".
    kernel : callable
        Conditions by name -> (u, u) float, or None where nothing of it was recorded.
    rank : int
        Most columns of it.
    conditions : tuple of str
        Names of those that the kernel looks at.
    """

    name: str
    kernel: Callable[[Mapping[str, Array]], Array | None]
    rank: int
    conditions: tuple[str, ...] = ()

    def features(self, conditions: Mapping[str, Array]) -> Array | None:
        """Return columns (u, k) of mean square 1 together; None where there is nothing to ask."""
        kernel = self.kernel(conditions)
        if kernel is None or np.trace(kernel) <= 1e-9 * len(kernel):
            return None
        return leading(kernel * len(kernel) / np.trace(kernel), self.rank)


class Asked(Protocol):
    """A question that is asked of the discrepancy."""

    @property
    def name(self) -> str:
        """As a person reads it after "depends on"."""

    def features(self, conditions: Mapping[str, Array]) -> Array | None:
        """Return columns (u, k) of mean square 1 together; None where there is nothing to ask."""


def leading(kernel: Array, rank: int) -> Array:
    """Return the columns (u, k), k <= rank, that hold most of a kernel (u, u)."""
    left, sizes, _ = np.linalg.svd(low_rank(kernel, WIDER * rank), full_matrices=False)
    return np.asarray(left[:, :rank] * sizes[:rank])


def low_rank(kernel: Array, rank: int) -> Array:
    """Return L (u, k) with L L^T nearly a kernel (u, u), k <= rank, by pivoted Cholesky."""
    left = np.diag(kernel).astype(float)
    whole, columns = left.sum(), np.zeros((len(kernel), 0))
    while columns.shape[1] < rank and left.sum() > LEAST * whole:
        at = int(np.argmax(left))
        column = (kernel[:, at] - columns @ columns[at]) / np.sqrt(left[at])
        columns = np.column_stack([columns, column])
        left = np.maximum(left - column**2, 0.0)
    return columns


def scaled(values: Array) -> Array:
    """Bring columns (u, k) to mean 0 and standard deviation 1; one that never changes to 0."""
    spread = values.std(axis=0)
    changes = spread > 1e-9 * (np.abs(values).max(axis=0, initial=0.0) + 1e-300)
    return np.asarray((values - values.mean(axis=0)) / np.where(changes, spread, np.inf))


def bell(values: Array, length: float = 1.0) -> Array:
    """Squared-exponential kernel (u, u) of columns (u, k)."""
    square = np.sum((values[:, None] - values[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * square / length**2))


def straight(values: Array) -> Array:
    """Kernel (u, u) of what is linear in columns (u, k)."""
    return np.asarray(values @ values.T / values.shape[1])


def centred(kernel: Array) -> Array:
    """Take the mean over the units out of a kernel: a constant depends on nothing."""
    row = kernel.mean(axis=0)
    return np.asarray(kernel - row[:, None] - row + row.mean())


def unresolved(features: Array) -> Array:
    """Return what columns (u, k) of a kernel of unit variance leave of each unit's, (u,).

    It is scatter of the unit by itself (Snelson and Ghahramani 2005): the columns of a long session
    cannot follow all of its drift.
    """
    return np.maximum(1.0 - np.sum(features**2, axis=1), 0.0)


def drift_features(table: Observations) -> Array:
    """Columns (u, k) of an instrument's slow drift, afresh in every session.

    Ornstein-Uhlenbeck over true time.  Zero where no time is told.
    """
    parts = [np.zeros((table.n_units, 0))]
    for session in np.unique(table.sessions) if table.time_s is not None else ():
        at = table.sessions == session
        apart = np.abs(table.times[at][:, None] - table.times[at])
        kernel = np.asarray(sum(np.exp(-apart / each) for each in DRIFT_S) / len(DRIFT_S))
        own = low_rank(kernel, DRIFT_RANK)
        parts.append(np.zeros((table.n_units, own.shape[1])))
        parts[-1][at] = own
    return np.concatenate(parts, axis=1)


def background(
    table: Observations,
    whiten: Callable[[Array], Array],
    questions: Sequence[Asked],
    scatter: Array,
    drift: Array | None,
    noise_width: float,
    wander: Array | None = None,
    passing: Array | None = None,
) -> Background:
    """Put together what has no name.

    Parameters
    ----------
    table : Observations
        u units of m components.
    whiten : callable
        (u, m, k) -> (N, k).
    questions : sequence of Question
        Asked of the discrepancy.
    scatter : (m,) float
        Usual scatter of a unit: what amplitudes are measured in.
    drift : (m,) float or None
        Expected size of the instrument's drift; None where the order of the rows is no time.
    noise_width : float
        See `Background`.
    wander : (u, k) float, optional
        Columns of that drift.
    passing : (u, k) float, optional
        Columns of what the instrument drifts within seconds.
    """
    groups: list[Group] = []

    def add(name: str, features: Array, size: Array, expected: float) -> None:
        for quantity in table.quantities:
            at = list(quantity.components)
            spread = np.zeros((*table.values.shape, features.shape[1], len(at)))
            for number, component in enumerate(at):
                spread[:, component, :, number] = features * size[component]
            columns = whiten(spread.reshape(*table.values.shape, -1))
            if np.any(columns):
                own = np.zeros(table.n_components)
                own[at] = size[at]
                groups.append(
                    Group(name, quantity.name, columns, expected, features=features, size=own)
                )

    if drift is not None and wander is not None:
        add(SLOW_DRIFT, wander, drift, 1.0)
    for question in questions:
        features = question.features(table.covariates)
        if features is not None:
            add(question.name, features, scatter, 0.0)
    if drift is not None and passing is not None:
        add(PASSING_DRIFT, passing, PASSING * drift, 1.0)
    return Background(tuple(groups), noise_width)
