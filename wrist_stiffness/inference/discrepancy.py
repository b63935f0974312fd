"""What has no name: the slow drift of an instrument, and the discrepancy of a model.

The discrepancy is a Gaussian process, additive over questions that an engineer asks: does the error
depend on the pose, on the load, on both together, on the side of approach?  Each question is a
kernel over the units, and its amplitude is 0 unless the evidence wants it otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.inference.observations import Array
from wrist_stiffness.inference.point import Background, Group
from wrist_stiffness.inference.projection import low_rank
from wrist_stiffness.inference.shared import Whitened
from wrist_stiffness.inference.smooth import Smooth

DRIFT = 0.5
"""Expected size of an instrument's slow drift where it states none, in scatters of one
measurement (assumed)."""

DRIFT_S = (20.0, 200.0)
"""Correlation times of an instrument's slow drift, half of its variance each [s] (assumed)."""

DRIFT_RANK = 12
"""Columns of the drift of one component in one session."""

PASSING = 0.3
"""What an instrument drifts within seconds, as a share of what it drifts slowly (assumed)."""

WIDER = 4
"""So many times the columns of a kernel are found before the largest of them are kept."""

SLOW_DRIFT, PASSING_DRIFT = "slow drift of the instrument", "the time"


@dataclass(frozen=True)
class Question:
    """On what an error may depend."""

    name: str  # as a person reads it after "depends on"
    # conditions by name -> (u, u) float, or None where nothing of it was recorded
    kernel: Callable[[Mapping[str, Array]], Array | None]
    rank: int  # most columns of it
    conditions: tuple[str, ...] = ()  # names of those that the kernel looks at

    def features(self, conditions: Mapping[str, Array]) -> Array | None:
        """Return columns (u, k) of mean square 1 together; None where there is nothing to ask."""
        kernel = self.kernel(conditions)
        if kernel is None or np.trace(kernel) <= 1e-9 * len(kernel):
            return None
        return leading(kernel * len(kernel) / np.trace(kernel), self.rank)


def leading(kernel: Array, rank: int) -> Array:
    """Return the columns (u, k), k <= rank, that hold most of a kernel (u, u)."""
    left, sizes, _ = np.linalg.svd(low_rank(kernel, WIDER * rank)[0], full_matrices=False)
    return np.asarray(left[:, :rank] * sizes[:rank])


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


def drift_features(times: Array) -> Array:
    """Columns (u, k) of an instrument's slow drift in one session: Ornstein-Uhlenbeck over time."""
    apart = np.abs(times[:, None] - times)
    kernel = np.asarray(sum(np.exp(-apart / each) for each in DRIFT_S) / len(DRIFT_S))
    return low_rank(kernel, DRIFT_RANK)[0]


def background(
    units: Whitened,
    questions: Iterable[Question | Smooth],
    scatter: Array,
    noise_width: float,
    drift: Array,
    wander: Array | None = None,
    passing: Array | None = None,
) -> Background:
    """Put together what has no name.

    `units`: u units of m components; `questions`: asked of the discrepancy; `scatter` (m,): usual
    scatter of a unit: what amplitudes are measured in; `noise_width`: see `Background`; `drift`
    (m,): expected size of the instrument's drift; `wander` (u, k): columns of that drift; none
    where the order of the rows is no time; `passing` (u, k): columns of what the instrument drifts
    within seconds.
    """
    table = units.observations
    asked = [(each.name, each.features(table.covariates), scatter, 0.0) for each in questions]
    kinds = (
        (SLOW_DRIFT, wander, drift, 1.0),
        *asked,
        (PASSING_DRIFT, passing, PASSING * drift, 1.0),
    )
    groups = []
    for name, features, size, expected in kinds:
        if features is None:
            continue
        for quantity in table.quantities:
            at = list(quantity.components)
            own = np.zeros(table.n_components)
            own[at] = size[at]
            spread = features[:, None, :, None] * np.diag(own)[:, None, at]
            columns = units.whiten(spread.reshape(*table.values.shape, -1))
            if np.any(columns):
                groups.append(
                    Group(name, quantity.name, columns, expected, features=features, size=own)
                )
    return Background(tuple(groups), noise_width)
