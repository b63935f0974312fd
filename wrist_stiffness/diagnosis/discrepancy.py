"""None of these: the conditions predict what is left, whatever the law.

A Gaussian process over the conditions (squared-exponential kernel, Nystroem features) stands for
every law that nobody thought of.  It is judged by what it predicts of blocks it has not seen, and
against the same on rearranged residuals.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from wrist_stiffness.diagnosis.hypotheses import Evidence
from wrist_stiffness.diagnosis.observations import Array, Labels
from wrist_stiffness.diagnosis.permutation import rearranged_residuals
from wrist_stiffness.diagnosis.projection import Base

LANDMARKS = 60
LENGTHS = (0.7, 2.0)
"""Length scales in standard deviations of a condition, times the root of their number."""

SIGNALS = (0.1, 3.0)
"""Variance of the process against the noise of one number."""


@dataclass(frozen=True)
class Discrepancy:
    """What a flexible law would explain.

    Parameters
    ----------
    energy : float
        Sum of squares that it predicts of unseen blocks; zero if chance does as much.
    p_value : float
        Omnibus: probability that rearranged residuals are predicted as well.
    depends_on : tuple of str
        Conditions that predict the residual by themselves, strongest first.
    """

    energy: float
    p_value: float
    depends_on: tuple[str, ...]


def standardised(evidence: Evidence) -> tuple[tuple[str, ...], Array]:
    """Names and columns of the conditions that vary, centred and of unit deviation, (n, d)."""
    names, columns = [], []
    for name, column in evidence.observations.covariates.items():
        deviation = column.std()
        if deviation > 1e-9 * (1 + np.abs(column).max()):
            names.append(name)
            columns.append((column - column.mean()) / deviation)
    n = evidence.observations.n_units
    return tuple(names), np.column_stack(columns) if columns else np.empty((n, 0))


def features(conditions: Array, length: float, rng: np.random.Generator) -> Array:
    """Nystroem features of a squared-exponential process, (n, q)."""
    n, d = conditions.shape
    length = length * np.sqrt(d)
    distinct = np.unique(conditions, axis=0)
    marks = distinct
    if len(distinct) > LANDMARKS:
        marks = distinct[rng.choice(len(distinct), LANDMARKS, replace=False)]

    def kernel(a: Array, b: Array) -> Array:
        return np.exp(-0.5 * cdist(a, b, "sqeuclidean") / length**2)

    size, vectors = np.linalg.eigh(kernel(marks, marks))
    keep = size > 1e-6 * size[-1]
    return kernel(conditions, marks) @ (vectors[:, keep] / np.sqrt(size[keep]))


def predicted_energy(
    white_features: Array, residuals: Array, blocks: Labels, signal: float
) -> Array:
    """How much of unseen blocks the features predict, summed over components, (repeats,).

    Parameters
    ----------
    white_features : (n, q) array
        Features filtered like the residual.
    residuals : (n, m, repeats) array
        Whitened residuals.
    blocks : (n,) array
        Block of each unit.
    signal : float
        Prior variance of a weight against the noise.
    """
    n, m, repeats = residuals.shape
    flat = residuals.reshape(n, m * repeats)
    gram, moment = white_features.T @ white_features, white_features.T @ flat
    total = np.zeros(m * repeats)
    for block in np.unique(blocks):
        rows = blocks == block
        own = white_features[rows]
        system = gram - own.T @ own + np.eye(gram.shape[0]) / signal
        seen = flat[rows]
        # A block has fewer rows than there are residuals: the inverse is applied to these.
        weight = np.linalg.solve(system, own.T).T
        predicted = weight @ moment - (weight @ own.T) @ seen
        total += np.sum(seen**2 - (seen - predicted) ** 2, axis=0)
    return total.reshape(m, repeats).sum(axis=0)


def find_discrepancy(
    evidence: Evidence,
    base: Base,
    blocks: Labels,
    repeats: int,
    alpha: float,
    rng: np.random.Generator,
) -> Discrepancy:
    """Test what a model leaves against the conditions.

    Parameters
    ----------
    evidence : Evidence
        Table and noise.
    base : Base
        The model, effects included.
    blocks : (n,) array
        Blocks for cross-validation.
    repeats : int
        Rearrangements.
    alpha : float
        Level of the omnibus test.
    rng : numpy.random.Generator
        For landmarks and rearrangements.
    """
    names, conditions = standardised(evidence)
    n, m = evidence.observations.values.shape
    if not names:
        return Discrepancy(0.0, 1.0, ())
    by_chance = rearranged_residuals(base, evidence.observations.exchangeable, repeats, rng)
    every = np.column_stack([base.residual, by_chance])[: n * m].reshape(n, m, repeats + 1)

    def best(columns: Array) -> Array:
        energies = []
        for length in LENGTHS:
            white = evidence.noise.filtered(evidence.observations, features(columns, length, rng))
            energies += [predicted_energy(white, every, blocks, signal) for signal in SIGNALS]
        return np.max(energies, axis=0)

    energy = best(conditions)
    p_value = float((1 + np.sum(energy[1:] >= energy[0])) / (1 + repeats))
    if p_value > alpha:
        return Discrepancy(0.0, p_value, ())
    alone = [best(conditions[:, [i]]) for i in range(len(names))]
    strong = [
        (single[0], name)
        for single, name in zip(alone, names, strict=True)
        if single[0] > np.quantile(single[1:], 1 - alpha)
    ]
    depends_on = tuple(name for _, name in sorted(strong, reverse=True))
    return Discrepancy(float(max(energy[0], 0.0)), p_value, depends_on)
