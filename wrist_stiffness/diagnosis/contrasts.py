"""Where a model fails: the residual set against one condition at a time.

No law is assumed.  A condition with two values is a contrast between them; any other is told by
its slope and by its curvature (sizes that act whatever their sign).
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f

from wrist_stiffness.diagnosis.observations import Array, Observations, Quantity

FEWEST = 4
"""Units that each side of a contrast needs."""


@dataclass(frozen=True)
class Contrast:
    """Dependence of one quantity on one condition.

    Parameters
    ----------
    condition : str
        Name of the condition, or ``NAME squared`` for the even part.
    quantity : Quantity
        What depends on it.
    size : float
        Length of the change between the two values, or over two standard deviations of the
        condition, in the unit of the quantity.
    uncertainty : float
        One standard uncertainty of a component of it.
    p_value : float
        Of no dependence, multiplied by the number of contrasts (Bonferroni), at most 1.
    between_values : tuple of float, optional
        The two values of a condition that has no others.
    """

    condition: str
    quantity: Quantity
    size: float
    uncertainty: float
    p_value: float
    between_values: tuple[float, float] | None

    @property
    def sentence(self) -> str:
        """For a person."""
        where = f"over the usual range of {self.condition}"
        if self.between_values is not None:
            low, high = self.between_values
            where = f"between {self.condition} = {low:g} and {high:g}"
        return (
            f"{self.quantity.name} changes by {self.size:.3g} +- {self.uncertainty:.1g} "
            f"{self.quantity.unit} {where} (p = {self.p_value:.1g})"
        )


def contrasts(observations: Observations) -> list[Contrast]:
    """Dependence of every quantity on every condition, surest first.

    Parameters
    ----------
    observations : Observations
        Values are residuals of a fitted model; blanks are left out.
    """
    asked = [
        (label, column, between, quantity)
        for label, column, between in _regressors(observations)
        for quantity in observations.reported
    ]
    answers = []
    for label, column, between, quantity in asked:
        values = observations.values[:, list(quantity.components)]
        known = np.isfinite(values).all(axis=1)
        if known.sum() >= 2 * FEWEST:
            size, error, p_value = _slope(column[known], values[known])
            shown = (quantity, size * quantity.per_si, error * quantity.per_si)
            answers.append(Contrast(label, *shown, min(1.0, p_value * len(asked)), between))
    return sorted(answers, key=lambda each: each.p_value)


Regressor = tuple[str, Array, tuple[float, float] | None]


def _regressors(observations: Observations) -> list[Regressor]:
    """Columns that change by one between two values, or over two standard deviations."""
    found: list[Regressor] = []
    for name, column in observations.covariates.items():
        values, counts = np.unique(column, return_counts=True)
        if len(values) == 2 and counts.min() >= FEWEST:
            between = (float(values[0]), float(values[1]))
            found.append((name, (column == values[1]).astype(np.float64), between))
        elif len(values) > 2:
            centred = column - column.mean()
            found.append((name, centred / (2 * centred.std()), None))
            even = centred**2 - np.mean(centred**2)
            if even.std() > 1e-9 * np.mean(centred**2):
                found.append((f"{name} squared", even / (2 * even.std()), None))
    return found


def _slope(column: Array, values: Array) -> tuple[float, float, float]:
    """Length of the slope of (n, c) values, its uncertainty, and the p-value of none."""
    n, c = values.shape
    x, y = column - column.mean(), values - values.mean(axis=0)
    spread = x @ x
    if spread == 0:
        return 0.0, np.inf, 1.0
    slope = x @ y / spread
    left = np.sum((y - np.outer(x, slope)) ** 2)
    variance = left / (c * (n - 2))
    ratio = spread * (slope @ slope) / (c * variance) if variance > 0 else np.inf
    p_value = float(f.sf(ratio, c, c * (n - 2)))
    return float(np.linalg.norm(slope)), float(np.sqrt(variance / spread)), p_value
