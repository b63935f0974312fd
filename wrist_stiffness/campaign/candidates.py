"""The catalogue as candidates of a diagnosis: columns of every law at every place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from wrist_stiffness.campaign.columns import Effects, SessionModel
from wrist_stiffness.campaign.recipes import Column, Recipe, Shape, effect_at, recipe
from wrist_stiffness.diagnosis import Candidate, Observations
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.registry import catalogue

SET_UP = ("measurement_frame", "target_mounting", "encoder_offset", "load_bias")
"""Refitted in every session before any search; there is nothing to find."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class WristCandidate:
    """A law at a place, its recipe, and its columns on all points of its grid.

    Parameters
    ----------
    law : Law
        The physics.
    place : str
        Component.
    recipe : Recipe
        How it became columns.
    known : dict of shape to (u, 6, k) arrays
        Columns on the grid [m, rad].
    """

    law: Law
    place: str
    recipe: Recipe
    known: Mapping[Shape, Array]

    @property
    def name(self) -> str:
        """`law@place`."""
        return f"{self.law.id}@{self.place}"

    def effect(self, found: Mapping[str, float], shape: Shape) -> Effect:
        """Return the effect with which a fit may begin.

        Parameters
        ----------
        found : dict of str to float
            Factors of the columns by their names.
        shape : tuple of float
            Values of the shape parameters.
        """
        return effect_at(self.law, self.place, self.recipe.start(found, shape))

    def columns(self, units: Observations, shape: Shape) -> Array:
        """Return the columns at a shape, linear between the points of the grid, (u, 6, k)."""
        return self._between(shape)[units.rows]

    def _between(self, shape: Shape) -> Array:
        if shape in self.known:
            return self.known[shape]
        corners, weights = [], []
        for value, parameter in zip(shape, self.recipe.shape, strict=True):
            grid = np.array(parameter.grid)
            above = int(np.clip(np.searchsorted(grid, value), 1, len(grid) - 1))
            share = float((value - grid[above - 1]) / (grid[above] - grid[above - 1]))
            corners.append((parameter.grid[above - 1], parameter.grid[above]))
            weights.append((1.0 - share, share))
        total = np.zeros_like(next(iter(self.known.values())))
        for corner, weight in zip(product(*corners), product(*weights), strict=True):
            total = total + float(np.prod(weight)) * self.known[corner]
        return total

    def candidate(self) -> Candidate:
        """Return it as the statistics take it."""
        first = self.recipe.columns(tuple(p.grid[0] for p in self.recipe.shape))
        law = self.law
        return Candidate(
            law.id,
            self.place,
            tuple(column.factor for column in first),
            self.columns,
            self.recipe.shape,
            needs=law.excited_by,
            evidence=law.sentence.format(place=self.place),
            check=law.check,
            compensable=compensable(law, self.place),
        )


def compensable(law: Law, place: str) -> str:
    """Tell whether the nodes can correct for an effect: `yes`, `needs_signal` or `no`."""
    if place == "pose_sensor":
        return "no"
    return "needs_signal" if law.signals else "yes"


def wrist_candidates(
    models: tuple[SessionModel, ...],
    used: tuple[np.ndarray, ...],
    present: Mapping[str, Effect],
    progress: Progress,
) -> tuple[WristCandidate, ...]:
    """Evaluate the whole catalogue about a point.

    Parameters
    ----------
    models : tuple of SessionModel
        The base of each session on its units.
    used : tuple of (u,) bool
        Units of each session that are in the table.
    present : dict of str to Effect
        Effects of the model itself that are no part of the refitted base, by name: a second one of
        the same name cannot be added.
    progress : callable
        Told (done, total).
    """
    signals = frozenset(
        name
        for name in models[0].session.block.temperatures
        if all(name in each.session.block.temperatures for each in models)
    )
    plans = [
        (law, place, recipe(law, place, signals))
        for law in catalogue().values()
        if law.id not in SET_UP
        for place in law.places
        if f"{law.id}@{place}" not in present
    ]
    found = []
    for number, (law, place, own) in enumerate(plans):
        known = _on_grid(models, used, law, place, own)
        if known is not None:
            found.append(WristCandidate(law, place, own, known))
        progress(number + 1, len(plans))
    return tuple(found)


def _on_grid(
    models: tuple[SessionModel, ...],
    used: tuple[np.ndarray, ...],
    law: Law,
    place: str,
    own: Recipe,
) -> dict[Shape, Array] | None:
    """Return the columns at every point of the grid, None where a signal is missing."""
    shapes = list(product(*(parameter.grid for parameter in own.shape)))
    columns = [own.columns(shape) for shape in shapes]
    blocks = []
    for model, rows in zip(models, used, strict=True):
        wanted = [effects for each in columns for c in each for effects in _ends(model, law, place, c)]
        changes = iter(model.changes(wanted))
        block = [
            np.stack([(next(changes) - next(changes)) / c.size for c in each], axis=-1)
            for each in columns
        ]
        blocks.append([np.nan_to_num(each[rows]) for each in block])
    return {
        shape: np.concatenate([block[number] for block in blocks])
        for number, shape in enumerate(shapes)
    }


def _ends(
    model: SessionModel, law: Law, place: str, column: Column
) -> tuple[Effects, Effects]:
    """Return the effects at the trial and at the origin of a column."""
    return (
        _with(model.effects, law, place, column.trial),
        _with(model.effects, law, place, column.origin) if column.origin else model.effects,
    )


def _with(effects: Effects, law: Law, place: str, values: Mapping[str, float]) -> Effects:
    """Return effects with one more, added to its like where the base has it."""
    added = effect_at(law, place, values)
    for number, own in enumerate(effects):
        if own.name == added.name:
            both = {key: own.estimates[key].value + values[key] for key in values}
            return (*effects[:number], effect_at(law, place, both), *effects[number + 1 :])
    return (*effects, added)
