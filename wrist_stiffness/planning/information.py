"""How well an experiment separates effects, from the Gram matrices of its visits.

Everything is additive over visits: the Gram matrix of an experiment is the sum of theirs.  The
discrimination of a truth y from a rival X is the length, in standard deviations, of what the best
fit of X and of all nuisances N leaves of y,

    d^2 = min over x, n of |y - X x - N n|^2 + |n / prior|^2 + |x / loose|^2,

so a likelihood ratio between the two errs with a probability of about Phi(-d/2) (T-optimality,
Atkinson and Fedorov 1975).  Of two effects that fit alike the evidence prefers the simpler one: for
parameters that the measurements tell better than a plausible size does, it charges the logarithm of
how much better, log det(I + X'X) (MacKay 1992).  What the rival is charged more than the truth
counts like d^2, but never beyond what lets the truth be seen at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.planning.signatures import Signature
from wrist_stiffness.planning.timeline import Experiment

RESOLVED = 5.0
"""Discrimination at which a pair counts as separated: the wrong one wins in 0.6 % of cases."""

FREE = 10.0
"""Prior of what is free, in plausible sizes: registrations, zeros, and a rival's parameters."""

MOTION_NOISE = 3.0
"""Noise of one moment in motion against that of a dwell, which averages some ten samples."""


@dataclass(frozen=True, eq=False)
class MeasurementNoise:
    """White noise of one dwell, and the encoder count that hides in it."""

    white: Array  # (6,), standard deviations of a dwell's mean pose [m, rad]
    encoder_step: float  # [rad]


@dataclass(frozen=True)
class Goal:
    """A question that the experiment shall answer."""

    truth: str  # effect that is there
    rival: str  # effect that might be taken for it; empty where the truth shall only be seen at all


@dataclass(frozen=True, eq=False)
class Layout:
    """Which column of the Gram matrices is what."""

    # (p,), precision of each nuisance in plausible sizes, first columns of the Gram matrices
    prior: Array
    nuisances: dict[str, NDArray[np.intp]]  # dict of str to (k,), of each nuisance among these
    # dict of str to (k,), of each effect among the columns after the nuisances
    columns: dict[str, NDArray[np.intp]]
    truths: dict[str, NDArray[np.intp]]  # dict of str to (t,), likewise


def whitened(
    experiment: Experiment, twists: Array, table: Table, noise: MeasurementNoise
) -> list[Array]:
    """Whiten columns visit by visit.

    Between two approaches the hidden place within the encoder's count stays the same, so all dwells
    of a visit have that error in common.

    `twists` (n, 6, p): columns at all samples of the path [m, rad]; `noise`: of one dwell.  Gives
    list of (6 rows, p): by visit.
    """
    mechanism = table.mechanism
    theta = experiment.block.theta[experiment.rows]
    jacobian = np.zeros((len(theta), 6, 2))
    jacobian[:, 3:] = mechanism.jacobian(mechanism.forward(theta))
    jacobian *= noise.encoder_step / np.sqrt(12.0)
    found = []
    for number in range(int(experiment.visit.max()) + 1):
        rows = np.flatnonzero(experiment.visit == number)
        moving = experiment.moving[rows]
        size = np.where(moving, MOTION_NOISE, 1.0)
        covariance = np.diag((size[:, None] * noise.white).ravel() ** 2)
        # In motion every sample has a count of its own.
        groups = [np.array([row]) for row in np.flatnonzero(moving)]
        for group in (*groups, np.flatnonzero(~moving)):
            shared = np.zeros((len(rows), 6, 2))
            shared[group] = jacobian[rows[group]]
            flat = shared.reshape(-1, 2)
            covariance += flat @ flat.T
        values = twists[experiment.rows[rows]].reshape(6 * len(rows), -1)
        found.append(np.linalg.solve(np.linalg.cholesky(covariance), values))
    return found


@dataclass(frozen=True, eq=False)
class Information:
    """Gram matrices of the visits of an experiment."""

    grams: Array  # (v, q, q), one for each visit
    layout: Layout  # of their columns

    @cached_property
    def total(self) -> Array:
        """Of the whole experiment, (q, q)."""
        total: Array = self.grams.sum(axis=0)
        return total


def information(
    experiment: Experiment,
    nuisances: Sequence[Signature],
    free: Sequence[str],
    effects: Sequence[Signature],
    table: Table,
    noise: MeasurementNoise,
) -> Information:
    """Return the Gram matrices of an experiment.

    `nuisances`: refitted whatever is asked.  `free`: names of those of which nothing is known
    beforehand; the others are known to one plausible size.  `effects`: what is asked for.
    """
    blocks = [each.columns for each in nuisances]
    prior: list[float] = []
    groups: dict[str, NDArray[np.intp]] = {}
    columns: dict[str, NDArray[np.intp]] = {}
    truths: dict[str, NDArray[np.intp]] = {}
    for each in nuisances:
        count = each.columns.shape[2]
        groups[each.name] = np.arange(len(prior), len(prior) + count)
        prior += [FREE**-2 if each.name in free else 1.0] * count
    at = 0
    for each in effects:
        for names, values in ((columns, each.columns), (truths, each.truths)):
            blocks.append(values)
            names[each.name] = np.arange(at, at + values.shape[2])
            at += values.shape[2]
    stacked = np.concatenate(blocks, axis=2)
    grams = [rows.T @ rows for rows in whitened(experiment, stacked, table, noise)]
    return Information(np.array(grams), Layout(np.array(prior), groups, columns, truths))


def carried_over(known: Information, names: Sequence[str]) -> Array:
    """Return what an experiment tells for another one in which some nuisances are set anew.

    Gives its Gram matrix (q, q), zero for those nuisances.
    """
    gram, layout = known.total, known.layout
    own = np.concatenate([layout.nuisances[name] for name in names if name in layout.nuisances])
    rest = np.setdiff1d(np.arange(len(gram)), own)
    order = np.concatenate([own, rest])
    left = np.zeros_like(gram)
    left[np.ix_(rest, rest)] = _beyond(gram[np.ix_(order, order)], layout.prior[own])
    return left


def beyond_nuisances(gram: Array, layout: Layout) -> Array:
    """Return what the nuisances leave of Gram matrices (..., q, q), (..., q - p, q - p)."""
    return _beyond(gram, layout.prior)


def _beyond(gram: Array, prior: Array) -> Array:
    """Return what the first p columns leave of the others; `prior` (p,): their precisions."""
    p = len(prior)
    inner, cross = gram[..., :p, :p] + np.diag(prior), gram[..., :p, p:]
    left: Array = gram[..., p:, p:] - np.swapaxes(cross, -1, -2) @ np.linalg.solve(inner, cross)
    return left


def discrimination(
    gram: Array, layout: Layout, goals: Sequence[Goal], before: Array | None = None
) -> Array:
    """Return the discrimination of each goal.

    `gram` (..., q, q): of one experiment or several.  `before` (q, q): part of them that was
    measured before the questions were asked; only what comes on top counts.  Gives (..., g): d in
    standard deviations; over several truths, what errs as often as they do on average.
    """
    squares = np.zeros((*gram.shape[:-2], len(goals)))
    for number, own in enumerate(by_truth(gram, layout, goals, before)):
        wrong = logsumexp(-0.125 * own**2, axis=-1) - np.log(own.shape[-1])
        squares[..., number] = np.maximum(-8.0 * wrong, 0.0)
    return np.sqrt(squares)


def by_truth(
    gram: Array, layout: Layout, goals: Sequence[Goal], before: Array | None = None
) -> list[Array]:
    """Return the discriminations (..., t) of each goal at each of its t truths.

    What was measured `before` a question was asked has left it open, whatever is reckoned here: a
    law that is not quite right, or a rival that bends further than its tangent, fits better than
    it should.  Counted as an answer it would let one more pose pass for enough, again and again.
    """
    squares = _squares(gram, layout, goals)
    if before is not None:
        known = _squares(before, layout, goals)
        squares = [np.maximum(s - k, 0.0) for s, k in zip(squares, known, strict=True)]
    return [np.sqrt(each) for each in squares]


def _squares(gram: Array, layout: Layout, goals: Sequence[Goal]) -> list[Array]:
    """Return the squares of the discriminations (..., t) of each goal."""
    left = beyond_nuisances(gram, layout)
    names = {name for goal in goals if goal.rival for name in (goal.truth, goal.rival)}
    charge = {name: _charge(left, layout.columns[name]) for name in names}
    found = []
    for goal in goals:
        truth = layout.truths[goal.truth]
        own = left[..., truth, truth]
        if goal.rival:
            rival = layout.columns[goal.rival]
            inner = left[..., rival[:, None], rival] + np.eye(len(rival)) / FREE**2
            cross = left[..., rival[:, None], truth]
            apart = own - np.sum(cross * np.linalg.solve(inner, cross), axis=-2)
            more = (charge[goal.rival] - charge[goal.truth])[..., None]
            own = np.minimum(apart + more, own)
        found.append(np.maximum(own, 0.0))
    return found


def _charge(left: Array, columns: NDArray[np.intp]) -> Array:
    """Return what the evidence charges for the parameters of an effect, (...)."""
    own = left[..., columns[:, None], columns]
    charge: Array = np.linalg.slogdet(own + np.eye(len(columns)))[1]
    return charge


def chance_right(discriminations: Array | float) -> Array:
    """Return the probability that the data prefer the truth to its rival."""
    right: Array = ndtr(0.5 * np.asarray(discriminations))
    return right


def wrong_bound(discriminations: Array) -> Array:
    """Return the Chernoff bound exp(-d^2/8) on the probability of a wrong answer, times two."""
    return np.exp(-0.125 * np.asarray(discriminations) ** 2)


def calibrated(gram: Array, layout: Layout) -> Array:
    """Return the mean gain of what is calibrated over its prior, in nats (D-optimality).

    Of Gram matrices (..., q, q) the mean over the nuisances of the log of prior over posterior
    deviation, (...).
    """
    p = len(layout.prior)
    weight = 1.0 / np.sqrt(layout.prior)
    scaled = weight[:, None] * gram[..., :p, :p] * weight
    value: Array = np.linalg.slogdet(np.eye(p) + scaled)[1] / (2.0 * p)
    return value


def improvement(gram: Array, layout: Layout) -> dict[str, float]:
    """Return by how much each nuisance's uncertainty falls, the geometric mean of its parameters.

    Of a Gram matrix (q, q): prior over posterior standard deviation, 1 for nothing gained.
    """
    p = len(layout.prior)
    posterior = np.diagonal(np.linalg.inv(gram[:p, :p] + np.diag(layout.prior)))
    ratio = 1.0 / np.sqrt(layout.prior * posterior)
    return {name: float(np.exp(np.log(ratio[at]).mean())) for name, at in layout.nuisances.items()}
