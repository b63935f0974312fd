"""The amplitudes of what has no name: those of the largest evidence (MacKay 1992)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from wrist_stiffness.inference.evidence import (
    OFF,
    Array,
    Evidence,
    beside_known,
    log_amplitude,
    log_excess,
)
from wrist_stiffness.inference.point import Background, Group, Point

LAST_STEPS = 3
"""Steps to the most probable unknowns where slopes hold everywhere; only the tails of the priors
ask for more than one."""

AMPLITUDES = np.geomspace(0.02, 1e4, 60)
"""Sizes of a group, in scatters of a unit, among which the best is sought first."""

MOST_STEPS, ENOUGH = 15, 0.1
"""Steps of the search for the amplitudes, and the gain of log evidence below which it ends."""

FURTHEST, MOST_HALVINGS = 1.5, 5
"""Longest step of the logarithm of an amplitude, and how often one that gains nothing is halved."""

LOG_EXCESS = np.linspace(-9.0, 16.0, 2400)
"""Logarithms of the excess among which the best is sought."""


def evidence(point: Point, background: Background, near: Evidence | None = None) -> Evidence:
    """Return a fitted set at the amplitudes of its largest evidence.

    Groups of the discrepancy that do not pay are not there.

    `point`: where its fit ended; `background`: of the table; of a part no further groups are asked;
    `near`: of a set like it, beside the same background: where the search for the amplitudes
    begins.
    """
    at = beside_known(point, background) if near is None else settled(replace(near, point=point))
    while background.whole is None:
        asked = {n: size for n, (gain, size) in further(at, background).items() if gain > 0.0}
        tried = _pruned(settled(beside(at, {**sizes_of(at), **asked}))) if asked else at
        if not tried.unbounded > at.unbounded + ENOUGH:
            break
        at = tried
    at = _pruned(settled(at))
    for _ in range(LAST_STEPS if point.linear else 0):
        at = replace(at, point=at.point.moved(at.step))
    return at


def settled(at: Evidence) -> Evidence:
    """Return a set at the best amplitudes of the groups that are there."""
    for _ in range(MOST_STEPS):
        step, excess = _step(at), _excess_beside(at)
        for halvings in range(MOST_HALVINGS):
            share = 0.5**halvings
            trial = replace(
                at,
                amplitude=np.maximum(at.amplitude * np.exp(share * step), OFF),
                excess=at.excess * (excess / at.excess) ** share,
            )
            if trial.unbounded > at.unbounded:
                break
        gained = trial.unbounded - at.unbounded
        at = trial if gained > 0.0 else at
        if gained < ENOUGH:
            break
    return at


def further(at: Evidence, background: Background) -> dict[int, tuple[float, float]]:
    """Return what groups that are not there would add, all else held.

    `at`: of a set beside a part of the background; `background`: the whole.
    Returns by the place of each absent group the gain of log evidence at its best amplitude, and
    that.
    """
    absent = background.part(set(range(len(background.groups))) - set(at.background.numbers))
    if not absent.groups:
        return {}
    whole_gram = background.gram[np.ix_(at.background.places, absent.places)]
    mixed = np.vstack([at.point.mixed(absent), whole_gram])
    blocks = [each.columns.T @ each.columns for each in absent.groups]
    scores = at.scores(mixed, absent.products(at.point.left), blocks)
    found = {}
    for number, group, score in zip(absent.numbers, absent.groups, scores, strict=True):
        gain, size = _group_gain(*score, group)
        found[number] = gain + (0.0 if group.expected else background.log_odds), size
    return found


def _group_gain(information: Array, slope: Array, group: Group) -> tuple[float, float]:
    """Return what a group adds to the log evidence at its best amplitude, and that."""
    sizes, vectors = np.linalg.eigh(information)
    along, sizes = (vectors.T @ slope) ** 2, np.maximum(sizes, 0.0)
    squares = AMPLITUDES[:, None] ** 2
    found = 0.5 * np.sum(squares * along / (1.0 + squares * sizes) - np.log1p(squares * sizes), 1)
    found += [log_amplitude(float(each), group, len(slope)) for each in AMPLITUDES]
    best = int(np.argmax(found))
    return float(found[best]), float(AMPLITUDES[best])


def sizes_of(at: Evidence) -> dict[int, float]:
    """Return the amplitudes of the groups that are there by their places in the whole."""
    return dict(zip(at.background.numbers, at.amplitude.tolist(), strict=True))


def beside(at: Evidence, sizes: Mapping[int, float]) -> Evidence:
    """Return a set beside other groups of the whole, at these amplitudes by their places there."""
    ground = (at.background.whole or at.background).part(sizes)
    amplitude = np.array([sizes[number] for number in ground.numbers])
    return replace(at, background=ground, amplitude=amplitude)


def _pruned(at: Evidence) -> Evidence:
    """Return a set without the groups of the discrepancy that do not pay."""
    sizes = sizes_of(at)
    for number, group in zip(at.background.numbers, at.background.groups, strict=True):
        if group.expected:
            continue
        absent = beside(at, {n: size for n, size in sizes.items() if n != number})
        if absent.unbounded > at.unbounded:
            at = absent
            del sizes[number]
    return at


def _step(at: Evidence) -> Array:
    """Return the step of the logarithms of the amplitudes, (g,) within what a step may reach.

    By the average of observed and expected information (Gilmour, Thompson and Cullis 1995).
    """
    ground, size = at.background, at.amplitude
    second = at.unnamed**2 + at.variances[len(at.variances) - len(ground.group) :]
    squares = np.bincount(ground.group, second, minlength=len(size))
    slope, curvature = _priors(size, ground.groups)
    information = at.average_information + np.diag(curvature)
    step = np.linalg.lstsq(information, squares / size**2 - ground.sizes - slope, rcond=1e-12)[0]
    return np.clip(step, -FURTHEST, FURTHEST)


def _priors(size: Array, groups: Sequence[Group]) -> tuple[Array, Array]:
    """Return slope and curvature of minus the log prior over the logarithm of each amplitude."""
    known = np.array([each.expected or np.nan for each in groups])
    width = np.array([each.width for each in groups])
    # A half-Cauchy density of scale 1 where no size is expected.
    cauchy = (size**2 - 1.0) / (size**2 + 1.0), 4.0 * size**2 / (size**2 + 1.0) ** 2
    slope = np.where(np.isnan(known), cauchy[0], np.log(size / known) / width**2)
    return slope, np.where(np.isnan(known), cauchy[1], 1.0 / width**2)


def _excess_beside(at: Evidence) -> float:
    """Return the best excess for what is left, all else held (expectation maximisation)."""
    # Of the products times the covariance, the inverse of products over excess plus precision.
    trace = at.excess * float(np.sum(1.0 - at.precision * at.variances))
    square, width = at.square + trace, at.background.noise_width
    grid = np.exp(LOG_EXCESS)
    log = -0.5 * (at.point.count * LOG_EXCESS + square / grid) + log_excess(grid, width)
    return float(grid[np.argmax(log)])
