"""What one condition does to the error, along the way it goes most: a curve, or a map of poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.inference import Observations, Quantity
from wrist_stiffness.inference.observations import Labels
from wrist_stiffness.mechanism.components import Array

CLASSES, FINE = 12, 60
"""Units are averaged in so many classes of a condition, and of the only one that is looked at."""

CELL_DEG = 6.0
"""Side of a cell of a map of poses."""

ALONG_AXIS = 0.9
"""Cosine from which a direction is called by the name of an axis."""

ANGLES = ("theta_1", "theta_2")

PLAIN = {
    **{f"f{axis}": (f"the force along {axis}", "N", 1.0) for axis in "xyz"},
    **{f"m{axis}": (f"the moment about {axis}", "mN m", 1e3) for axis in "xyz"},
    "held_s": ("the time at rest", "s", 1.0),
    "time_s": ("the time", "min", 1.0),
}
"""What conditions are called, their units, and how many of these are one of the table."""

OF_MOTORS = {
    "theta": ("angle", "deg", 180.0 / np.pi),
    "approach": ("approach", "-1 falling, 1 rising", 1.0),
    "speed": ("speed", "deg/s", 180.0 / np.pi),
}
"""The same of each motor."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A part of the error against the condition that shows it best."""

    quantity: Quantity  # what is shown
    direction: Array  # (3,), of gauges (K,), unit vector in F along which it goes most
    names: tuple[str, ...]  # the condition, or both angles for a map
    values: Array  # (u, 1) or (u, 2), of the condition, in the unit of `labels`
    labels: tuple[str, ...]  # the conditions as axes of a picture, with units
    # (u,), what is left when everything else that was found is taken out, NaN where not measured,
    # in the unit of the quantity
    measured: Array
    places: Array  # (c, 1) or (c, 2), mean of the condition in classes of units
    mean: Array  # (c,), of the fitted law there
    covariance: Array  # (c, c), its uncertainty

    @property
    def sigma(self) -> Array:
        """One standard uncertainty of the fitted law, (c,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def along(self, values: Array) -> Array:
        """Return the part of values (u, m) along the direction in the quantity's unit, (u,)."""
        columns, used = list(self.quantity.components), self.direction != 0.0
        part = values[:, columns][:, used] @ self.direction[used]
        return np.asarray(part * self.quantity.per_si)

    @property
    def where(self) -> str:
        """The direction in words, as `extend --direction` takes it."""
        preposition = "along" if self.quantity.name == "s" else "about"
        axis = int(np.argmax(np.abs(self.direction)))
        if self.quantity.called:
            return f"most at gauge {self.quantity.called[axis]}"
        if abs(self.direction[axis]) >= ALONG_AXIS:
            return f"{preposition} {'+' if self.direction[axis] > 0.0 else '-'}{'xyz'[axis]}"
        return f"{preposition} ({', '.join(f'{value:z.2f}' for value in self.direction)})"

    @property
    def sentence(self) -> str:
        """What it does, for a technician."""
        weights = np.zeros(len(self.mean))
        if len(self.names) == 2:
            at = int(np.argmax(np.abs(self.mean)))
            weights[at] = 1.0
            one, two = self.places[at]
            told = f"It is largest about motor angles of {one:z.0f} and {two:z.0f} deg"
            return f"{told}: {self._amount(weights)} {self.where}."
        low, high = sorted((int(np.argmin(self.mean)), int(np.argmax(self.mean))))
        weights[[low, high]] = -1.0, 1.0
        moves = "turns" if self.quantity.unit == "mdeg" else "moves"
        does = f"the platform {moves} by {self._amount(weights)} {self.where}."
        name, label = self.names[0], self.labels[0].partition(" [")[0]
        if name.startswith("approach"):
            motor = f"motor {name[-1]}"
            return f"When {motor} is approached with rising rather than falling angle, {does}"
        ends = [f"{self.places[each, 0]:.3g}" for each in (low, high)]
        unit = f" {self.labels[0].partition(' [')[2][:-1]}".rstrip()
        return f"As {label} goes from {ends[0]} to {ends[1]}{unit}, {does}"

    def _amount(self, weights: Array) -> str:
        """Size with uncertainty and unit, two digits of the uncertainty."""
        size = abs(float(weights @ self.mean))
        sigma = float(np.sqrt(max(float(weights @ self.covariance @ weights), 0.0)))
        digits = max(0, 1 - int(np.floor(np.log10(max(sigma, 1e-6)))))
        return f"{size:.{digits}f} +- {sigma:.{digits}f} {self.quantity.unit}"


def curve_of(
    observations: Observations,
    quantity: Quantity,
    conditions: tuple[str, ...],
    residual: Array,
    columns: Array,
    values: Array,
    covariance: Array,
) -> Curve:
    """Return the curve of one group against the condition that shows it best.

    `observations`: conditions of the units; `quantity`: which the group changes; `conditions`: at
    which its question looks; `residual` (u, 6): what is left when everything else is taken out [m,
    rad]; `columns` (u, 6, k): what the group's columns leave of the units; `values`, `covariance`
    (k,) and (k, k): of the columns.
    """
    at = [c for c in quantity.components if observations.measured[:, c].any()]
    law = (columns @ values)[:, at]
    _, _, ways = np.linalg.svd(law, full_matrices=False)
    along = columns[:, at].transpose(0, 2, 1) @ ways[0] * quantity.per_si
    names, shown = _best(observations, conditions, along @ values)
    most = FINE if len(conditions) == 1 else CLASSES
    labels = _cells(shown) if len(names) == 2 else classes_of(shown[:, 0], most)
    count = int(labels.max()) + 1
    share = np.zeros((count, len(labels)))
    share[labels, np.arange(len(labels))] = 1.0
    share /= share.sum(axis=1, keepdims=True)
    places, of_classes = share @ shown, share @ along
    order = np.argsort(places[:, 0], kind="stable") if len(names) == 1 else np.arange(count)
    mean = (of_classes @ values)[order]
    # Towards what it does for more of the condition; on a map, where it does most.
    turned = np.argmax(mean) - np.argmin(mean)
    if len(names) == 2:
        turned = mean[np.argmax(np.abs(mean))]
    sign = -1.0 if turned < 0.0 else 1.0
    direction = np.zeros(len(quantity.components))
    direction[[quantity.components.index(c) for c in at]] = sign * ways[0]
    return Curve(
        quantity,
        direction,
        names,
        shown,
        tuple(condition_label(name) for name in names),
        sign * residual[:, at] @ ways[0] * quantity.per_si,
        places[order],
        sign * mean,
        (of_classes @ covariance @ of_classes.T)[np.ix_(order, order)],
    )


def _best(
    observations: Observations, conditions: tuple[str, ...], law: Array
) -> tuple[tuple[str, ...], Array]:
    """Return the condition that shows a law (u,) best, or both angles where none shows half."""
    told: Mapping[str, Array] = observations.covariates
    names = conditions or tuple(name for name in told if name.startswith("T_"))
    varied = [name for name in names if np.ptp(told[name]) > 0.0]
    found = []
    for name in varied:
        shown = condition_shown(observations, name)
        classes = classes_of(shown)
        means = np.bincount(classes, law) / np.bincount(classes)
        found.append((float(np.var(means[classes])), name, shown))
    share, name, shown = max(found, key=lambda each: each[0])
    if share < 0.5 * np.var(law) and set(ANGLES) <= set(varied):
        return ANGLES, np.stack([condition_shown(observations, angle) for angle in ANGLES], axis=1)
    return (name,), shown[:, None]


def condition_shown(observations: Observations, name: str) -> Array:
    """Return a condition by name in the unit of its label, (u,)."""
    values = observations.covariate(name)
    if name == "time_s":
        return since_start_s(observations) / 60.0
    return values * _unit(name)[2]


def since_start_s(observations: Observations) -> Array:
    """Return the time since the first unit of the same session, (u,) [s]."""
    starts = np.full(observations.sessions.max() + 1, np.inf)
    np.minimum.at(starts, observations.sessions, observations.times)
    return np.asarray(observations.times - starts[observations.sessions])


def _unit(name: str) -> tuple[str, str, float]:
    """Return what a condition is called, its unit, and how many of it are one of the table."""
    first, _, rest = name.partition("_")
    if name in PLAIN:
        return PLAIN[name]
    if first == "T":
        return f"the temperature of {rest.replace('_', ' ')}", "degC", 1.0
    if first in OF_MOTORS and rest in ("1", "2"):
        what, unit, per = OF_MOTORS[first]
        return f"the {what} of motor {rest}", unit, per
    return name, "", 1.0


def condition_label(name: str) -> str:
    """Return what a condition is called on an axis, with its unit."""
    text, unit, _ = _unit(name)
    return f"{text} [{unit}]" if unit else text


def classes_of(values: Array, most: int = CLASSES) -> Labels:
    """Return classes of about equal numbers of units; what is equal is in one class."""
    _, place, count = np.unique(np.round(values, 9), return_inverse=True, return_counts=True)
    if len(count) <= most:
        return place
    below = np.cumsum(count) - 0.5 * count
    labels = np.floor(below * most / len(values))
    return np.unique(labels, return_inverse=True)[1][place]


def _cells(values: Array) -> Labels:
    """Return the cell of a map of each pair of angles [deg]."""
    return np.unique(np.floor(values / CELL_DEG), axis=0, return_inverse=True)[1].reshape(-1)
