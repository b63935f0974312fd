"""What effects would leave in a planned experiment, by differences of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.progress import Progress, silent

STEP = 0.1
"""Step of a difference, in plausible sizes; a law linear in its parameters is taken at full size
instead."""

SENSOR_STEP = 0.01
"""What the pose sensor says goes along no straight line: of a delay a longer step would be off by
some thousandths."""


@dataclass(frozen=True, eq=False)
class Signature:
    """Of one effect in an experiment of n samples."""

    effect: Effect  # at the plausible values about which the differences were taken
    # (n, 6, k), change of the measured twist by one plausible size of each parameter [m, rad]
    columns: Array
    truths: Array  # (n, 6, t), change by the whole effect at t plausible sets of values [m, rad]
    lacks: str = ""  # why the experiment cannot show it: the signal that is missing; else empty

    @property
    def name(self) -> str:
        """`law@component`."""
        return self.effect.name


def plausible(effect: Effect, rng: np.random.Generator) -> Effect:
    """Return an effect with values drawn where its parameters would not surprise."""
    values = {}
    for each in effect.parameters:
        size = each.scale * rng.uniform(0.5, 1.5)
        down = each.mean - size >= each.lower and rng.uniform() < 0.5
        values[each.key] = float(np.clip(each.mean + (-size if down else size), None, each.upper))
    return effect.with_values(values)


def signatures(
    model: ErrorModel,
    block: Block,
    candidates: Sequence[Sequence[Effect]],
    progress: Progress = silent,
) -> list[Signature]:
    """Evaluate what effects would leave.

    `model`: without them, or with them at other values.  `block`: the experiment's path.
    `candidates`: each effect at one or more sets of values; the differences are taken at the first.
    Gives one for each.  Raises `InputError` if a sample lies outside the table's domain or load
    range.
    """
    if model.evaluation == "spline":
        model = model.with_evaluation("closed_form")
    found = []
    for number, sets in enumerate(candidates):
        found.append(_signature(model, block, sets))
        progress(number + 1, len(candidates))
    return found


def _signature(model: ErrorModel, block: Block, sets: Sequence[Effect]) -> Signature:
    first = sets[0]
    own = [effect for effect in model.effects if effect.name == first.name]
    others = model.with_effects(*(e for e in model.effects if e.name != first.name))
    linear = first.stage != "sensor" and all(p.linear for p in first.parameters)
    base = first.with_values({p.key: 0.0 for p in first.parameters}) if linear else first
    steps = [_step(p, base, linear) for p in first.parameters]
    moved = [
        base.with_values({p.key: base.estimates[p.key].value + step})
        for p, step in zip(first.parameters, steps, strict=True)
    ]
    whole = [] if linear else sets
    without, at_base, *further = others.batch_with(
        block, [own, *([effect] for effect in (base, *moved, *whole))]
    )
    if not without.accepted.all():
        raise InputError(
            f"plan: {np.count_nonzero(~without.accepted)} moments lie outside the table's domain "
            "or load range"
        )
    scale = np.array([p.scale for p in first.parameters])
    changes = [each.measured - at_base.measured for each in further[: len(moved)]]
    columns = np.stack(changes, axis=-1) * (scale / np.array(steps))
    if linear:
        sizes = np.array([_values(effect) for effect in sets]) - (_values(own[0]) if own else 0.0)
        truths = columns @ (sizes / scale).T
    else:
        changes = [each.measured - without.measured for each in further[len(moved) :]]
        truths = np.stack(changes, axis=-1)
    return Signature(first, columns, truths, at_base.lacking.get(first.name, ""))


def _step(parameter: Parameter, base: Effect, linear: bool) -> float:
    """Return a step of the difference in the parameter's unit, away from its upper bound."""
    share = 1.0 if linear else SENSOR_STEP if base.stage == "sensor" else STEP
    step = share * parameter.scale
    return step if base.estimates[parameter.key].value + step <= parameter.upper else -step


def _values(effect: Effect) -> Array:
    return np.array([effect.estimates[p.key].value for p in effect.parameters])
