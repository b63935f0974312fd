"""Means over dwells and single moments in motion, for solvers that take one table of residuals."""

from __future__ import annotations

import numpy as np
from bench_wrist import Array, Mask

from wrist_stiffness.simulation.program import Program

MOVING_EVERY = 10
"""One sample in so many counts as a unit of its own while the wrist moves."""

LOST = 8.0
"""Robust standard deviations from the median of its neighbours at which a sample is lost."""

NEIGHBOURS = 5


def unit_labels(program: Program, time_s: Array, static: bool) -> np.ndarray:
    """Return the number of the unit that each sample belongs to, -1 for none, (n,).

    `static`: only the last sample of each rest is a unit.
    """
    phase = program.phase(time_s)
    path = np.concatenate([program.angles(phase), program.load(phase)], axis=1)
    still = ~np.any(np.diff(path, axis=0, prepend=path[:1]) != 0.0, axis=1)
    labels = np.full(len(time_s), -1)
    number = -1
    for i, rests in enumerate(still):
        ends = rests and i + 1 < len(still) and not still[i + 1]
        if static:
            if ends:
                number += 1
                labels[i] = number
            continue
        if rests and (i == 0 or not still[i - 1]):
            number += 1
        if rests:
            labels[i] = number
        elif i % MOVING_EVERY == 0:
            number += 1
            labels[i] = number
    return labels


def unit_means(labels: np.ndarray, values: Array) -> Array:
    """Return the mean of the finite samples (n, ...) over each unit, (u, ...); NaN for none."""
    used = labels >= 0
    place, flat = labels[used], values[used].reshape(int(used.sum()), -1)
    finite = np.isfinite(flat)
    out, count = np.zeros((2, labels.max() + 1, flat.shape[1]))
    np.add.at(out, place, np.where(finite, flat, 0.0))
    np.add.at(count, place, finite)
    with np.errstate(invalid="ignore"):
        return (out / count).reshape(-1, *values.shape[1:])


def lost_samples(values: Array) -> Mask:
    """Return which of the samples (n, 6) lie far from the median of their neighbours, (n,)."""
    n, reach = len(values), NEIGHBOURS // 2
    padded = np.pad(values, ((reach, reach), (0, 0)), constant_values=np.nan)
    around = np.stack([padded[k : k + n] for k in range(NEIGHBOURS)])
    out = np.zeros(n, dtype=bool)
    for k in range(values.shape[1]):
        own = values[:, k]
        if not np.isfinite(own).any():
            continue
        known = np.isfinite(around[:, :, k]).sum(axis=0) >= reach + 1
        middle = np.full(n, np.nan)
        middle[known] = np.nanmedian(around[:, known, k], axis=0)
        away = np.abs(own - middle)
        if known.any():
            out |= np.nan_to_num(away) > LOST * 1.4826 * np.nanmedian(away)
    return out


def last_sense(speed: Array) -> Array:
    """Return the sign of each motor's motion now or before its rest, (n, 2)."""
    out = np.sign(speed)
    for i in range(1, len(out)):
        out[i] = np.where(out[i] == 0.0, out[i - 1], out[i])
    return out
