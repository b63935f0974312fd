"""On what a residual depends, in a technician's words, strongest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.campaign.comparing.conditions import Condition, conditions
from wrist_stiffness.campaign.comparing.dependence import (
    Dependence,
    Dependences,
    beyond,
    dependences,
    noise_energy,
)
from wrist_stiffness.campaign.noise_floor import NoiseFloor
from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.blocks import time_blocks
from wrist_stiffness.inference.observations import Labels, Mask
from wrist_stiffness.mechanism.components import Array

SURE = 3.0
"""Standard uncertainties from which the shift's or the rotation's part of a change is told."""

ALONG_AXIS = 0.9
"""Cosine from which a direction is called by the name of an axis."""

TWINS = 0.95
"""Correlation from which two conditions are the same in these recordings."""

WANDER_S = 60.0
"""Instruments wander over about this time.  Conditions that change faster are judged beyond every
slower motion of the residual; slower ones against that motion, which takes far more to be sure."""

SLOW = 0.3
"""A condition is slow if less than this share of its variance is faster than the wander."""

FAST_BLOCKS = 30
"""Parts of the recordings whose signs are turned by chance, for fast conditions."""

SLOW_BLOCK_S, FEWEST_SLOW_BLOCKS = 70.0, 8
"""For slow conditions a part outlasts the wander; from fewer parts nothing could be sure."""

LEAST_SHARE = 0.01
"""A condition that takes less of the residual's square is not worth a sentence of its own."""

SLOW_SHARE = 0.1
"""A slow condition that explains less of the residual is not told apart from wander."""

MOST_TWINS = 3
"""No more twins of a condition are named."""

FAMILIES = 2
"""Fast and slow conditions are asked apart, and both pay for it."""

FEWEST_PER_MOTION = 6
"""Units for each slow motion that is taken out."""


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
        Part of the residual's square, in variances of the noise, that goes with the condition.
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
            more = len(self.twins) - MOST_TWINS
            names = "; ".join(self.twins[:MOST_TWINS]) + (f"; {more} more" if more > 0 else "")
            text += f" (In these recordings the same as: {names}.)"
        return text

    def _told(self, change: Change) -> str:
        shift = change.quantity == "s"
        amount, where = change.amount, change.where
        preposition = "along" if shift else "about"
        if self.condition.swings:
            return f"{'swings' if shift else 'rocks'} by +-({amount}) {preposition} {where}"
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
    minor : tuple of str
        Topics that matter beyond chance, but so little that they are only named.
    silent : dict of str to float
        Topics on which nothing depends beyond chance, with their smallest chance.
    not_varied : tuple of str
        Topics of which these recordings say nothing.
    too_short : tuple of str
        Topics that change so slowly that the recordings are too short to tell them from the
        wander of the instrument; of a topic that is told of nevertheless, only the slow conditions.
    """

    statements: tuple[Statement, ...]
    minor: tuple[str, ...]
    silent: dict[str, float]
    not_varied: tuple[str, ...]
    too_short: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """All of it for a technician."""
        lines = [each.sentence for each in self.statements]
        if self.minor:
            lines.append(
                f"Beyond chance, but with less than {100.0 * LEAST_SHARE:g} % of the error's "
                f"square: {', '.join(self.minor)}."
            )
        if self.silent:
            also = " else" if lines else ""
            lines.append(f"Nothing{also} depends beyond chance on {_listed(tuple(self.silent))}.")
        if self.not_varied:
            lines.append(
                f"Not varied here, so nothing can be said of: {', '.join(self.not_varied)}."
            )
        if self.too_short:
            lines.append(
                f"Too short to be told from slow wander of the instrument: "
                f"{', '.join(self.too_short)}; that takes "
                f"{np.ceil(FEWEST_SLOW_BLOCKS * SLOW_BLOCK_S / 60.0):g} minutes of recording."
            )
        return tuple(lines)

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "depends_on": [each.as_values() for each in self.statements],
            "hardly_depends_on": list(self.minor),
            "nothing_depends_on": dict(self.silent),
            "not_varied": list(self.not_varied),
            "too_short_for": list(self.too_short),
        }


def tell(observations: Observations, floor: NoiseFloor, rng: np.random.Generator) -> Told:
    """Say on which conditions the residual depends.

    Parameters
    ----------
    observations : Observations
        Values are residuals after the registrations were refitted; covariates as
        `observing.observe` names them.
    floor : NoiseFloor
        Scatter of the units.
    rng : numpy.random.Generator
        For what chance gives.
    """
    asked, not_varied = conditions(observations)
    sessions = observations.sessions
    constant = (sessions[:, None] == np.unique(sessions)).astype(float)
    trend = np.hstack([constant, _slow_motions(observations.times, sessions)])
    variance = np.maximum(floor.variance, np.finfo(float).tiny)
    total = noise_energy(observations.values, variance, constant)
    slow = _which_are_slow([each.columns for each in asked], constant, trend)
    span = _span(observations.times, sessions)
    slow_blocks = int(span / SLOW_BLOCK_S)
    too_slow: tuple[Condition, ...] = ()
    if slow_blocks < FEWEST_SLOW_BLOCKS:
        # A temperature times an angle is as fast as the angle, and wanders with the temperature.
        factors = [e.columns if e.factor is None else e.factor[:, None] for e in asked]
        left_out = slow | _which_are_slow(factors, constant, trend)
        too_slow = tuple(asked[which] for which in np.flatnonzero(slow))
        asked = tuple(asked[which] for which in np.flatnonzero(~left_out))
        slow = slow[~left_out]

    def answer(chosen: Labels, base: Array, blocks: int) -> Dependences:
        columns = [asked[which].columns for which in chosen]
        labels = time_blocks(sessions, min(blocks, observations.n_units))
        return dependences(observations.values, variance, base, columns, labels, rng)

    statements: list[Statement] = []
    chances = np.full(len(asked), np.nan)
    base = constant
    for chosen, under, blocks in (
        (np.flatnonzero(~slow), trend, FAST_BLOCKS),
        (np.flatnonzero(slow), constant, min(slow_blocks, FAST_BLOCKS)),
    ):
        found = answer(chosen, np.hstack([under, base]), blocks)
        chances[chosen] = np.minimum(FAMILIES * found.p_values, 1.0)
        for each in found.entered:
            condition = asked[chosen[each.which]]
            if under is constant and each.fall < SLOW_SHARE * total:
                continue
            base = np.hstack([base, condition.columns])
            changes = _changes(each, condition, observations)
            p_value = min(1.0, FAMILIES * each.p_value)
            twins = _twins(condition, asked, constant)
            statements.append(Statement(condition, changes, p_value, each.fall / total, twins))
    chance_of = list(zip(asked, chances.tolist(), strict=True))
    return _by_topic(statements, chance_of, not_varied, too_slow)


def _by_topic(
    statements: Sequence[Statement],
    asked: Sequence[tuple[Condition, float]],
    not_varied: tuple[str, ...],
    too_slow: Sequence[Condition],
) -> Told:
    """Sort out what is told, only named, or ruled out, each topic once.

    Of conditions that entered as statements, of all that were asked with their chances (NaN for
    none), and of those that were not asked as the recordings are too short.
    """
    worth = [each for each in statements if each.share >= LEAST_SHARE]
    entered = {each.condition.topic for each in statements}
    minor = entered - {each.condition.topic for each in worth}
    too_short = dict.fromkeys(e.name if e.topic in entered else e.topic for e in too_slow)
    silent: dict[str, float] = {}
    for condition, p_value in asked:
        if condition.topic not in entered | too_short.keys() and np.isfinite(p_value):
            silent[condition.topic] = min(p_value, silent.get(condition.topic, 1.0))
    return Told(
        tuple(sorted(worth, key=lambda each: -each.share)),
        tuple(sorted(minor)),
        silent,
        not_varied,
        tuple(too_short),
    )


def _span(times: Array, sessions: Labels) -> float:
    """Time that was recorded in all sessions together [s]."""
    return sum(float(np.ptp(times[sessions == each])) for each in np.unique(sessions))


def _slow_motions(times: Array, sessions: Labels) -> Array:
    """Cosines of each session's time down to the period of the wander, (n, p)."""
    columns = []
    for session in np.unique(sessions):
        own = sessions == session
        passed = times[own] - times[own][0]
        span = max(float(passed[-1]), 1e-9)
        count = min(int(2.0 * span / WANDER_S) + 1, own.sum() // FEWEST_PER_MOTION)
        for order in range(1, count + 1):
            column = np.zeros(len(times))
            column[own] = np.cos(np.pi * order * passed / span)
            columns.append(column)
    return np.column_stack(columns) if columns else np.empty((len(times), 0))


def _which_are_slow(asked: Sequence[Array], constant: Array, trend: Array) -> Mask:
    """Tell which conditions, by their columns (n, q), change no faster than the wander, (k,)."""
    every = np.hstack([np.empty((len(constant), 0)), *asked])
    owner = np.repeat(np.arange(len(asked)), [columns.shape[1] for columns in asked])
    whole, fast = (
        np.bincount(owner, np.sum(beyond(base, every) ** 2, axis=0), len(asked))
        for base in (constant, trend)
    )
    return np.asarray(fast < SLOW * whole)


def _changes(
    answer: Dependence, condition: Condition, observations: Observations
) -> tuple[Change, ...]:
    """Shift and rotation of one condition: those that are sure, else the surer one."""
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
        # A swing is told as far as it was seen, not over a whole turn.
        factor = quantity.per_si
        if condition.swings:
            factor *= 0.5 * float(np.ptp(condition.columns @ mix))
        found.append(
            Change(
                quantity.name,
                quantity.unit,
                float(size[0]) * factor,
                float(np.sqrt(max(variance, 0.0))) * factor,
                direction,
            )
        )
    found = [each for each in found if each.uncertainty > 0.0]
    sure = [each for each in found if each.size >= SURE * each.uncertainty]
    return tuple(sure or sorted(found, key=lambda each: -each.size / each.uncertainty)[:1])


def _twins(own: Condition, asked: tuple[Condition, ...], constant: Array) -> tuple[str, ...]:
    """Names of conditions whose columns span the same as this one's, beyond the constants."""
    basis = _directions(own.columns, constant)
    found = []
    for condition in asked:
        other = _directions(condition.columns, constant)
        if condition is not own and other.shape[1] == basis.shape[1]:
            alike = np.linalg.svd(basis.T @ other, compute_uv=False)
            if alike.min(initial=1.0) > TWINS:
                found.append(condition.name)
    return tuple(found)


def _directions(columns: Array, constant: Array) -> Array:
    """Orthonormal basis of columns beyond the constants, (n, r)."""
    left, size, _ = np.linalg.svd(beyond(constant, columns), full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * max(float(size[0]), 1e-300)])


def _listed(words: tuple[str, ...]) -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} or {words[-1]}"
