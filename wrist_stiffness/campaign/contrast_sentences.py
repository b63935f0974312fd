"""On what a residual depends, in a technician's words, strongest first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.campaign.conditions import Condition, conditions
from wrist_stiffness.campaign.dependence import Dependence, dependences
from wrist_stiffness.diagnosis import Observations
from wrist_stiffness.diagnosis.resampling import time_blocks
from wrist_stiffness.diagnosis.whitening import NoiseModel
from wrist_stiffness.mechanism.components import Array

SURE = 3.0
"""Standard uncertainties from which the shift's or the rotation's part of a change is told."""

ALONG_AXIS = 0.9
"""Cosine from which a direction is called by the name of an axis."""

TWINS = 0.95
"""Correlation from which two conditions are the same in these recordings."""

FEWEST_BLOCKS, MOST_BLOCKS = 12, 40
WANDERS_IN_BLOCK = 3.0
"""A block lasts so many correlation times of the slow wander, if enough blocks are left."""


@dataclass(frozen=True, eq=False)
class Change:
    """What a condition does to one quantity.

    Parameters
    ----------
    quantity, unit : str
        `s` in um or `phi` in mdeg.
    size, uncertainty : float
        Length, and one standard uncertainty along the direction.
    direction : (3,) float
        Unit vector in F.
    """

    quantity: str
    unit: str
    size: float
    uncertainty: float
    direction: Array

    @property
    def amount(self) -> str:
        """Size with uncertainty and unit, two digits of the uncertainty."""
        digits = max(0, 1 - int(np.floor(np.log10(max(self.uncertainty, 1e-6)))))
        return f"{self.size:.{digits}f} +- {self.uncertainty:.{digits}f} {self.unit}"

    @property
    def where(self) -> str:
        """The direction in words."""
        axis = int(np.argmax(np.abs(self.direction)))
        if abs(self.direction[axis]) >= ALONG_AXIS:
            return f"{'+' if self.direction[axis] > 0.0 else '-'}{'xyz'[axis]}"
        return f"({', '.join(f'{value:.2f}' for value in self.direction)})"


@dataclass(frozen=True, eq=False)
class Statement:
    """One condition and what it does.

    Parameters
    ----------
    condition : Condition
        What was asked.
    changes : tuple of Change
        Of shift and rotation, those that are sure.
    p_value : float
        Chance, corrected for the number of conditions.
    share : float
        Part of the residual's weighted square that goes with the condition.
    twins : tuple of str
        Conditions that these recordings cannot tell from it.
    """

    condition: Condition
    changes: tuple[Change, ...]
    p_value: float
    share: float
    twins: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """For a technician."""
        what = " and ".join(self._told(change) for change in self.changes)
        text = f"{self.condition.lead}, {self.condition.subject} {what}."
        if self.twins:
            text += f" (In these recordings the same as: {', '.join(self.twins)}.)"
        return text

    def _told(self, change: Change) -> str:
        shift = change.quantity == "s"
        amount, where = change.amount, change.where
        preposition = "along" if shift else "about"
        if self.condition.swings:
            return f"{'swings' if shift else 'rocks'} by {amount} {preposition} {where}"
        if self.condition.subject != "the platform":
            return f"grows by {amount} {preposition} {where}"
        if shift:
            return f"stands {amount} further along {where}"
        return f"is turned {amount} further about {where}"

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        return {
            "topic": self.condition.topic,
            "condition": self.condition.name,
            "sentence": self.sentence,
            "p_value": self.p_value,
            "share": self.share,
            "twins": list(self.twins),
            "changes": [
                {
                    f"{change.quantity}_{change.unit}": [change.size, change.uncertainty],
                    "direction": change.direction.tolist(),
                }
                for change in self.changes
            ],
        }


@dataclass(frozen=True)
class Told:
    """Everything that the conditions say of a residual.

    Parameters
    ----------
    statements : tuple of Statement
        Strongest first.
    silent : dict of str to float
        Topics on which nothing depends beyond chance, with their smallest chance.
    not_varied : tuple of str
        Topics of which these recordings say nothing.
    """

    statements: tuple[Statement, ...]
    silent: dict[str, float]
    not_varied: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of it for a technician."""
        lines = [each.sentence for each in self.statements]
        if self.silent:
            also = " else" if lines else ""
            lines.append(f"Nothing{also} depends beyond chance on {_listed(tuple(self.silent))}.")
        if self.not_varied:
            lines.append(
                f"Not varied here, so nothing can be said of: {', '.join(self.not_varied)}."
            )
        return tuple(lines)

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "depends_on": [each.as_values() for each in self.statements],
            "nothing_depends_on": dict(self.silent),
            "not_varied": list(self.not_varied),
        }


def tell(observations: Observations, noise: NoiseModel, rng: np.random.Generator) -> Told:
    """Say on which conditions the residual depends.

    Parameters
    ----------
    observations : Observations
        Values are residuals after the registrations were refitted; covariates as
        `observing.observe` names them.
    noise : NoiseModel
        Their scatter and its colour.
    rng : numpy.random.Generator
        For what chance gives.
    """
    asked, not_varied = conditions(observations)
    constant = (observations.sessions[:, None] == np.unique(observations.sessions)).astype(float)
    answer = dependences(
        observations.values,
        _weights(observations, noise),
        constant,
        [each.columns for each in asked],
        _blocks(observations, noise),
        rng,
    )
    statements = tuple(
        Statement(
            asked[each.which],
            _changes(each, observations),
            each.p_value,
            each.share,
            _twins(each.which, asked, constant),
        )
        for each in answer.entered
    )
    told = {each.condition.topic for each in statements}
    silent: dict[str, float] = {}
    for condition, p_value in zip(asked, answer.p_values.tolist(), strict=True):
        if condition.topic not in told and np.isfinite(p_value):
            silent[condition.topic] = min(p_value, silent.get(condition.topic, 1.0))
    return Told(statements, silent, not_varied)


def _weights(observations: Observations, noise: NoiseModel) -> Array:
    """Inverse variances of noise and of the misfit itself, (n, m)."""
    inverse = np.linalg.inv(noise.factors(observations))
    variance = np.einsum("nij,nij->ni", inverse, inverse)
    misfit = np.nanmean(observations.values**2 - variance, axis=0, where=observations.measured)
    total = variance + np.nan_to_num(np.maximum(misfit, 0.0))
    return np.asarray(1.0 / total)


def _blocks(observations: Observations, noise: NoiseModel) -> np.ndarray:
    """Blocks of neighbours, longer than the slow wander where there are units enough."""
    times, sessions = observations.times, observations.sessions
    span = sum(float(np.ptp(times[sessions == each])) for each in np.unique(sessions))
    wanted = MOST_BLOCKS
    if noise.colour_share > 0.0 and span > 0.0:
        longest = WANDERS_IN_BLOCK * noise.colour_time
        wanted = int(np.clip(span / longest, FEWEST_BLOCKS, MOST_BLOCKS))
    return time_blocks(sessions, min(wanted, observations.n_units))


def _changes(answer: Dependence, observations: Observations) -> tuple[Change, ...]:
    """Shift and rotation of one condition, the surer one first if only one is sure."""
    q, m = answer.slope.shape
    covariance = answer.covariance.reshape(q, m, q, m)
    found = []
    for quantity in observations.reported:
        rows = list(quantity.components)
        left, size, right = np.linalg.svd(answer.slope[:, rows], full_matrices=False)
        mix, direction = left[:, 0], right[0]
        if q == 1 and mix[0] < 0.0:
            mix, direction = -mix, -direction
        own = covariance[:, rows][:, :, :, rows]
        variance = np.einsum("a,i,aibj,b,j->", mix, direction, own, mix, direction)
        found.append(
            Change(
                quantity.name,
                quantity.unit,
                float(size[0]) * quantity.per_si,
                float(np.sqrt(max(variance, 0.0))) * quantity.per_si,
                direction,
            )
        )
    found = [each for each in found if each.uncertainty > 0.0]
    sure = [each for each in found if each.size >= SURE * each.uncertainty]
    return tuple(sure or sorted(found, key=lambda each: -each.size / each.uncertainty)[:1])


def _twins(which: int, asked: tuple[Condition, ...], constant: Array) -> tuple[str, ...]:
    """Names of conditions whose columns span the same as this one's, beyond the constants."""
    basis = [_directions(each.columns, constant) for each in asked]
    own = basis[which]
    return tuple(
        condition.name
        for number, (condition, other) in enumerate(zip(asked, basis, strict=True))
        if number != which
        and own.shape[1] == other.shape[1]
        and np.linalg.svd(own.T @ other, compute_uv=False).min(initial=1.0) > TWINS
    )


def _directions(columns: Array, constant: Array) -> Array:
    """Orthonormal basis of columns beyond the constants, (n, r)."""
    beyond = columns - constant @ np.linalg.lstsq(constant, columns, rcond=None)[0]
    left, size, _ = np.linalg.svd(beyond, full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * max(float(size[0]), 1e-300)])


def _listed(words: tuple[str, ...]) -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} or {words[-1]}"


