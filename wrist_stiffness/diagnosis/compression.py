"""From many samples to few units: means over dwells, at a cost linear in the samples."""

from dataclasses import replace

import numpy as np

from wrist_stiffness.diagnosis.candidates import Candidate
from wrist_stiffness.diagnosis.observations import Array, Labels, Mask, Observations
from wrist_stiffness.errors import InputError


def group_mean(values: Array, group: Labels, n_groups: int) -> Array:
    """Mean over the rows of each group, ignoring NaN.

    Parameters
    ----------
    values : (n, ...) array
        Rows to average.
    group : (n,) array of int
        Group of each row; negative = not used.
    n_groups : int
        Number of groups.

    Returns
    -------
    (n_groups, ...) array
        NaN where a group has no measured row.
    """
    used = group >= 0
    rows = values[used].reshape(used.sum(), -1)
    labels = group[used]
    mean = np.empty((n_groups, rows.shape[1]))
    for column in range(rows.shape[1]):
        good = np.isfinite(rows[:, column])
        count = np.bincount(labels[good], minlength=n_groups)
        total = np.bincount(labels[good], rows[good, column], minlength=n_groups)
        mean[:, column] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean.reshape(n_groups, *values.shape[1:])


def dwell_groups(moving: Mask, sessions: Labels, shortest: int = 5) -> Labels:
    """Give every stretch at rest a number.

    Parameters
    ----------
    moving : (n,) array of bool
        Whether anything (angles, load) changes at a sample.
    sessions : (n,) array of int
        A dwell never spans two sessions.
    shortest : int, optional
        Stretches with fewer samples are dropped.

    Returns
    -------
    (n,) array of int
        Dwell of each sample, in order of time; -1 = none.
    """
    starts = np.ones(len(moving), dtype=bool)
    starts[1:] = (moving[1:] != moving[:-1]) | (sessions[1:] != sessions[:-1])
    stretch = np.cumsum(starts) - 1
    length = np.bincount(stretch)
    keep = ~moving[starts] & (length >= shortest)
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    return number[stretch]


def compress(observations: Observations, group: Labels) -> Observations:
    """Average the samples of each group into one unit.

    The scatter of a unit is left open: the mean of a thousand samples with coloured noise is
    not a thousand times as certain as one, so it is measured on the units.

    Parameters
    ----------
    observations : Observations
        Samples.
    group : (n,) array of int
        Unit of each sample, numbered from 0 in order of time; negative = not used.

    Raises
    ------
    InputError
        If no sample belongs to a group, or a group spans two sessions.
    """
    if not (group >= 0).any():
        raise InputError("no sample belongs to a unit: the recording never comes to rest")
    n_groups = int(group.max()) + 1

    def mean(column: Array | Labels) -> Array:
        return group_mean(column.astype(np.float64), group, n_groups)

    def label(column: Labels | None) -> Labels | None:
        return None if column is None else np.rint(mean(column)).astype(np.int64)

    if observations.session is not None:
        spread = mean(observations.session) % 1
        if (spread > 0).any():
            raise InputError(f"unit {int(np.argmax(spread > 0))} spans two sessions")
    return Observations(
        mean(observations.values),
        {name: mean(column) for name, column in observations.covariates.items()},
        None,
        mean(observations.times),
        label(observations.session),
        label(observations.replicate),
        np.bincount(group[group >= 0], minlength=n_groups).astype(np.float64),
        observations.quantities,
    )


def averaged(candidate: Candidate, samples: Observations, group: Labels) -> Candidate:
    """Evaluate a candidate on samples and average it over the units.

    For effects with a memory, whose value at a dwell depends on the way there.  The columns
    then belong to these units alone, so they are looked up by the time of the unit.

    Parameters
    ----------
    candidate : Candidate
        Its columns take samples.
    samples : Observations
        The recording.
    group : (n,) array of int
        As given to `compress`.
    """
    n_groups = int(group.max()) + 1
    times = group_mean(samples.times, group, n_groups)
    computed: dict[tuple[float, ...], Array] = {}

    def columns(units: Observations, shape: tuple[float, ...]) -> Array:
        if shape not in computed:
            computed[shape] = group_mean(candidate.evaluate(samples, shape), group, n_groups)
        rows = np.searchsorted(times, units.times)
        if (rows >= n_groups).any() or not np.array_equal(times[rows], units.times):
            raise InputError(f"{candidate.name} was averaged over other units than these")
        return computed[shape][rows]

    return replace(candidate, columns=columns)
