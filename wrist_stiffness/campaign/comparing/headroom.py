"""How far any law of the recorded conditions could bring the error down.

A Gaussian process over the conditions stands for every law that nobody has thought of.  It is told
nothing of the wrist, and is judged on blocks of the recordings that it has not seen.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wrist_stiffness.campaign.comparing.conditions import FORCES, MOMENTS, OWN
from wrist_stiffness.inference import Observations
from wrist_stiffness.inference.blocks import time_blocks
from wrist_stiffness.inference.features import features
from wrist_stiffness.inference.observations import Labels, Mask
from wrist_stiffness.inference.outliers import robust_scale
from wrist_stiffness.mechanism.components import Array

BLOCKS = 10

LENGTHS = (0.5, 1.5)
"""Length scales of the process in standard deviations of a condition."""

SIGNALS = (0.01, 0.1, 1.0, 10.0)
"""Variance of the process against that of one number's scatter."""

MOST_UNITS_OF_POSE = 24
"""Features of the pose that are multiplied with each component of the load."""


def held_out_process(observations: Observations, rng: np.random.Generator) -> Array:
    """Return what a Gaussian process over the conditions leaves of blocks it has not seen.

    Length and signal are those that leave least, for each component; all is left if none helps.

    Parameters
    ----------
    observations : Observations
        Values are residuals; covariates as `observing.observe` names them.
    rng : numpy.random.Generator
        Chooses the landmarks.

    Returns
    -------
    (n, m) float
        Residual, NaN where not measured.
    """
    values, measured = observations.values, observations.measured
    scale = robust_scale(values)
    flat = np.where(measured, values / scale, 0.0)
    # One lost beam would tell the process more than all others together.
    told = np.clip(flat, -10.0, 10.0)
    blocks = time_blocks(observations.sessions, min(BLOCKS, observations.n_units))
    best, least = flat.copy(), np.sum(told**2, axis=0)
    for length in LENGTHS:
        columns = _columns(observations.covariates, length, rng)
        for signal in SIGNALS:
            left = np.empty_like(flat)
            for pattern in np.unique(measured, axis=1).T:
                same = np.flatnonzero((measured == pattern[:, None]).all(axis=0))
                left[:, same] = left_by_others(
                    columns, flat[:, same], told[:, same], pattern, blocks, signal
                )
            energy = np.sum(np.clip(left, -10.0, 10.0) ** 2, axis=0)
            better = energy < least
            best[:, better], least[better] = left[:, better], energy[better]
    return np.where(measured, best * scale, np.nan)


def left_by_others(
    columns: Array, values: Array, told: Array, known: Mask, blocks: Labels, signal: float
) -> Array:
    """Return what ridge regression on all other blocks leaves of each block.

    Parameters
    ----------
    columns : (n, q) float
        Features.
    values, told : (n, m) float
        What is to be predicted, and the same as the regression learns it.
    known : (n,) bool
        Rows that were measured.
    blocks : (n,) int
        Block of each row.
    signal : float
        Prior variance of a weight against the noise.

    Returns
    -------
    (n, m) float
        Zero where not known.
    """
    seen = columns * known[:, None]
    gram, moment = seen.T @ seen, seen.T @ told
    left = np.zeros_like(values)
    for block in np.unique(blocks):
        own = blocks == block
        system = gram - seen[own].T @ seen[own] + np.eye(len(gram)) / signal
        weights = np.linalg.solve(system, moment - seen[own].T @ told[own])
        left[own] = known[own, None] * (values[own] - seen[own] @ weights)
    return left


def _columns(covariates: Mapping[str, Array], length: float, rng: np.random.Generator) -> Array:
    """Features of the process, (n, q): the pose times what acts there, and each by itself."""
    pose = _standardised(covariates, ("theta_1", "theta_2"))
    load = _standardised(covariates, (*FORCES, *MOMENTS))
    approach = _standardised(covariates, ("approach_1", "approach_2"))
    force = np.stack([covariates[name] for name in FORCES], axis=1)
    size = np.linalg.norm(force, axis=1, keepdims=True)
    # Play follows the direction of a load and not its size.
    direction = np.divide(force, size, out=np.zeros_like(force), where=size > 0.0)
    acting = np.hstack([np.ones((len(force), 1)), load, approach, direction])
    blocks = [acting]
    if pose.shape[1]:
        where = features(pose, length, rng)[:, -MOST_UNITS_OF_POSE:]
        blocks += [where * column[:, None] for column in acting.T]
    strength = _standardised(covariates, ("force",))
    others = [name for name in covariates if name not in (*OWN, *FORCES, *MOMENTS)]
    groups = [np.hstack([approach, strength]), strength]
    # Time itself is left out: what only drifts is no law.
    groups += [
        _standardised(covariates, (name,))
        for name in ("held_s", "loaded_at_rest", "speed_1", "speed_2", *others)
    ]
    blocks += [features(group, length, rng) for group in groups if group.shape[1]]
    return np.hstack(blocks)


def _standardised(covariates: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    """Those of the conditions that vary, centred and of unit deviation, (n, d)."""
    found = []
    for name in names:
        column = covariates[name]
        column = np.log10(np.maximum(column, 0.1)) if name == "held_s" else column
        deviation = column.std()
        if deviation > 1e-9 * (1.0 + np.abs(column).max()):
            found.append((column - column.mean()) / deviation)
    n = len(covariates["time_s"])
    return np.column_stack(found) if found else np.empty((n, 0))
