"""Cut one session into units: what counts as one measurement, and the moments that tell its path.

A unit is a dwell (angles and load at rest) or a few moments of a motion.  In motion each moment
hides an encoder count of its own, so the mean of a few knows the angles better than any rest does.
The path between units matters to effects with a memory, so moments are kept that tell it: both
ends of every rest, log-spaced moments within, regular ones in motion, and the turning points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block

Labels = NDArray[np.intp]
Mask = NDArray[np.bool_]

WINDOW_S = 0.15
"""Means over this time before and after a sample are compared to tell rest from change."""

PATH_S = 0.1
"""Time between the moments that are kept in motion."""

UNIT_S = 0.5
"""Regular moments within this time of a motion are one unit."""

MOST_MOVING, MOST_ON_PATH = 300, 2500
"""So many units in motion, and moments that tell the path, are enough of however long a session."""

SPARSE_S = 1.0
"""Samples further apart than this are poses measured one by one, each at rest."""

FEWEST_IN_DWELL = 3
"""Samples that make a dwell."""

COUNTS = 1.5
"""Encoder counts by which a motor at rest may seem to move."""

SIGNIFICANT = 5.0
"""Standard deviations by which a noisy load must change to change."""

LEAST_LOAD_CHANGE = 2e-3
"""Share of the load's range below which it rests whatever its noise."""

FIRST_S, GROWTH = 0.05, 2.0
"""First moment kept after the start of a rest, and the ratio of one to the next."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Units of n samples and the moments that are kept of them."""

    label: Labels  # (n,), unit of each sample in the order of time, -1 for none
    dwell: Mask  # (u,), whether a unit is a dwell
    kept: Labels  # (k,), samples that are kept
    # their signals, smoothed: means of angles and load over a rest, motor speeds over a window
    block: Block
    unit: Labels  # (k,), unit of each kept sample, -1 for none
    weight: Array  # (k,), its share of the unit's mean; the shares of a unit add up to 1
    held_s: Array  # (n,), time since anything changed [s]
    mean_speed: Array  # (k, 2), means of motor speeds over a window around kept samples [rad/s]
    at_rest: Mask  # (n,), whether the load changed after the last motion rather than before it
    sense: Array  # (n, 2), sign of each motor's last motion, 0 before the first

    @property
    def without_path(self) -> Cut:
        """The same units with only those moments kept that belong to one."""
        used = self.unit >= 0
        return replace(
            self,
            kept=self.kept[used],
            block=self.block.take(used),
            unit=self.unit[used],
            weight=self.weight[used],
            mean_speed=self.mean_speed[used],
        )

    def extremes(self, values: Array | Labels) -> tuple[Array, Array]:
        """Return the least and largest in each unit (u, ...) of values at kept moments (k, ...)."""
        used = self.unit >= 0
        least, largest = np.full((2, len(self.dwell), *values.shape[1:]), np.nan)
        np.fmin.at(least, self.unit[used], values[used])
        np.fmax.at(largest, self.unit[used], values[used])
        return least, largest

    def of_units(self, chosen: Labels) -> Cut:
        """Return some of the units (c,) in their order; moments of the others tell the path."""
        number = np.full(len(self.dwell) + 1, -1)
        number[chosen] = np.arange(len(chosen))
        label, unit = number[self.label], number[self.unit]
        return replace(self, label=label, dwell=self.dwell[chosen], unit=unit)


def cut(block: Block, encoder_step: float, measured: Mask) -> Cut:
    """Find the units of a session, at a cost linear in its samples.

    `block`: signals at the stamps of the measurements.  `encoder_step` [rad].  `measured` (n,):
    where anything was measured; the other samples only tell the path.
    """
    n = len(block)
    # Moments that only tell the path between two poses do not make these denser.
    step = float(np.median(np.diff(block.time[measured]))) if measured.sum() > 1 else np.inf
    sparse = step > SPARSE_S
    width = max(WINDOW_S, 1.5 * step) if not sparse else 0.0
    # The first sample of the window before each sample, and the end of the one after; neither
    # reaches over a time without any.
    burst: Labels = np.cumsum(np.diff(block.time, prepend=block.time[0]) > SPARSE_S)
    before = np.searchsorted(block.time, block.time - width, side="left")
    after = np.searchsorted(block.time, block.time + width, side="right")
    before = np.maximum(before, np.searchsorted(burst, burst, side="left"))
    after = np.minimum(after, np.searchsorted(burst, burst, side="right"))
    turning = _changes(block.theta, before, after, np.full(2, COUNTS * encoder_step), 0.0)
    loading = _changes(block.load, before, after, *_load_tolerance(block.load))
    mean_speed = np.zeros((n, 2)) if sparse else _speed(block, before, after)
    speed = mean_speed if block.theta_dot is None else block.theta_dot
    stretch, resting = _stretches(turning | loading, burst, block.theta, encoder_step, sparse)
    # Told speeds are those of a moment: as a motion ends, of a count that flickers.
    sense = _last_sign(block.theta, mean_speed, turning, sparse)
    last_turn, last_load = _last(turning, block.time), _last(loading, block.time)
    start = np.searchsorted(stretch, np.arange(stretch[-1] + 1))
    held_s: Array = np.where(resting, block.time - block.time[start[stretch]], 0.0)
    kept, in_motion = _moments(block.time, stretch, start, resting, speed, measured)
    smooth = _smoothed(block, before, after, stretch, resting, speed)
    label, dwell = _units(block.time, stretch, resting, in_motion)
    unit = label[kept]
    return Cut(
        label,
        dwell,
        kept,
        smooth.take(kept),
        unit,
        _weights(block.time[kept], unit, dwell),
        held_s,
        np.where(resting[kept, None], 0.0, mean_speed[kept]),
        last_load > last_turn,
        sense,
    )


def _window_means(values: Array, first: Labels, end: Labels) -> Array:
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    return (total[end] - total[first]) / np.maximum(end - first, 1)[:, None]


def _changes(values: Array, first: Labels, end: Labels, level: Array, noise: Array | float) -> Mask:
    """Tell where the means before and after a sample differ by more than level and noise, (n,)."""
    here = np.arange(len(values))
    # Sums of differences to the first value: no digits are lost in a long recording.
    values = values - values[0]
    early, late = _window_means(values, first, here + 1), _window_means(values, here, end)
    spread = noise * np.sqrt(1.0 / (here + 1 - first) + 1.0 / (end - here))[:, None]
    return np.asarray((np.abs(late - early) > level + spread).any(axis=1))


def _load_tolerance(load: Array) -> tuple[Array, Array]:
    """Return how far each component may move without changing, and its noise times a margin."""
    step = np.abs(np.diff(load, axis=0))
    noise = MAD_TO_SIGMA / np.sqrt(2.0) * (np.median(step, axis=0) if len(step) else np.zeros(6))
    level = np.repeat([np.ptp(load[:, i : i + 3], axis=0).max() for i in (0, 3)], 3)
    return LEAST_LOAD_CHANGE * level, SIGNIFICANT * noise


def _speed(block: Block, first: Labels, end: Labels) -> Array:
    """Return the mean motor speeds over the windows, (n, 2) [rad/s]."""
    last = end - 1
    span = block.time[last] - block.time[first]
    step = block.theta[last] - block.theta[first]
    return np.divide(step, span[:, None], out=np.zeros_like(step), where=span[:, None] > 0.0)


def _stretches(
    changing: Mask, burst: Labels, theta: Array, encoder_step: float, sparse: bool
) -> tuple[Labels, Mask]:
    """Return the number of the stretch of rest or of change of each sample, and which rest.

    A burst in which nothing changes is a rest, however few samples it has: a pose that was read
    once or a few times.
    """
    n = len(changing)
    if sparse:
        return np.arange(n), np.ones(n, dtype=bool)
    new_burst = np.diff(burst, prepend=-1) != 0
    starts = np.flatnonzero((np.diff(changing, prepend=~changing[0]) != 0) | new_burst)
    stretch = np.repeat(np.arange(len(starts)), np.diff(starts, append=n))
    span = np.maximum.reduceat(theta, starts) - np.minimum.reduceat(theta, starts)
    # A motion slower than the windows can see is no rest.
    creeping = (span > 2.0 * COUNTS * encoder_step).any(axis=1)
    short = np.diff(starts, append=n) < FEWEST_IN_DWELL
    short &= ~(new_burst[starts] & np.append(new_burst[starts[1:]], True))
    resting = (~changing[starts] & ~creeping & ~short)[stretch]
    starts = np.flatnonzero(np.diff(resting, prepend=~resting[0]) | np.diff(stretch, prepend=-1))
    # Neighbouring stretches without rest are one.
    merged = [0, *(s for s in starts[1:] if resting[s] or resting[s - 1])]
    return np.repeat(np.arange(len(merged)), np.diff(merged, append=n)), resting


def _last(event: Mask, time: Array) -> Array:
    """Return the time of the last event up to each sample, minus infinity before the first."""
    return np.maximum.accumulate(np.where(event, time, -np.inf))


def _last_sign(theta: Array, speed: Array, turning: Mask, sparse: bool) -> Array:
    if sparse:
        moved = np.sign(np.diff(theta, axis=0, prepend=theta[:1]))
    else:
        moved = np.where(turning[:, None], np.sign(speed), 0.0)
    last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(theta))[:, None], 0), axis=0)
    return np.take_along_axis(moved, last, axis=0)


def _moments(
    time: Array, stretch: Labels, start: Labels, resting: Mask, speed: Array, measured: Mask
) -> tuple[Labels, Mask]:
    """Return the samples to keep, and which of all are regular measured ones in motion."""
    n = len(time)
    end = np.append(start[1:], n) - 1
    keep, regular = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    keep[start], keep[end] = True, True
    turned = np.diff(np.sign(speed), axis=0, prepend=np.sign(speed[:1])) != 0.0
    keep |= turned.any(axis=1) & ~resting
    inside = np.diff(time, append=time[-1])[~resting]
    grid = np.floor((time - time[0]) / max(PATH_S, inside.sum() / MOST_ON_PATH) + 1e-6)
    keep |= (np.diff(grid, prepend=-1.0) > 0.0) & ~resting
    seen = np.flatnonzero(measured & ~resting)
    regular[seen] = np.diff(grid[seen], prepend=-1.0) > 0.0
    since = time - time[start[stretch]]
    with np.errstate(divide="ignore"):
        octave = np.floor(np.log(np.maximum(since, 1e-12) / FIRST_S) / np.log(GROWTH))
    keep |= resting & (octave >= 0) & (np.diff(octave, prepend=-np.inf) != 0.0)
    return np.flatnonzero(keep | regular), regular


def _units(time: Array, stretch: Labels, resting: Mask, regular: Mask) -> tuple[Labels, Mask]:
    """Return the unit of each sample and which units are dwells."""
    moments = np.flatnonzero(regular)
    since = time[moments] - time[np.searchsorted(stretch, stretch[moments])]
    part = np.floor(since / UNIT_S + 1e-6)
    new = (np.diff(stretch[moments], prepend=-1) != 0) | (np.diff(part, prepend=-1.0) != 0.0)
    number = np.cumsum(new) - 1
    every = -(-int(new.sum()) // MOST_MOVING) or 1
    starts = resting & (np.diff(stretch, prepend=-1) != 0)
    starts[moments[new & (number % every == 0)]] = True
    inside = resting.copy()
    inside[moments[number % every == 0]] = True
    return np.where(inside, np.cumsum(starts) - 1, -1), resting[starts]


def _smoothed(
    block: Block, first: Labels, end: Labels, stretch: Labels, resting: Mask, speed: Array
) -> Block:
    """Return the block with means of angles and load over rests, and over short windows else."""
    size = np.bincount(stretch)

    def mean(values: Array) -> Array:
        columns = [np.bincount(stretch, column) / size for column in values.T]
        return np.stack(columns, axis=1)[stretch]

    rests = resting[:, None]
    near = np.minimum(np.arange(len(stretch)) - first, end - 1 - np.arange(len(stretch))) // 3
    here = np.arange(len(stretch))
    # Short and symmetric, so that a ramp is not shifted.
    local = _window_means(block.load, here - near, here + near + 1)
    return replace(
        block,
        theta=np.where(rests, mean(block.theta), block.theta),
        load=np.where(rests, mean(block.load), local),
        theta_dot=np.where(rests, 0.0, speed),
    )


def _weights(time: Array, unit: Labels, dwell: Mask) -> Array:
    """Return the shares of kept moments in the means of their units.

    The trapezoid rule over a rest; in motion the moments kept are those that were measured.
    """
    same = unit[1:] == unit[:-1]
    half = 0.5 * np.where(same, np.diff(time), 0.0)
    weight = np.append(half, 0.0) + np.append(0.0, half)
    used = unit >= 0
    total = np.bincount(unit[used], weight[used], minlength=len(dwell))
    alike = ~dwell | (total == 0.0)
    count = np.bincount(unit[used], minlength=len(dwell))
    share = np.where(alike[unit], 1.0 / count[unit], weight / np.where(alike, 1.0, total)[unit])
    return np.where(used, share, 0.0)
