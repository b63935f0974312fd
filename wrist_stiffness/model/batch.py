"""Evaluate models over a whole recording, a chunk of samples at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.model.block import Block
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.evaluation import (
    NO_GUESSES,
    Evaluated,
    Guesses,
    Memory,
    evaluate,
    evaluate_beside,
    seen_by,
)
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.model.prediction import BlockPrediction

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel

CHUNK = 2048
"""Samples evaluated at a time: about 150 MB of operators with 24 flange sectors."""

STACK = 8192
"""Samples, counted once for each model, whose contacts are solved together."""

MOST_KEPT = 4
"""So many chunks of a block are kept for the next models; of a longer one the rest is done anew."""


class Recent:
    """What the first of the last models did at a block, and what it rests on.

    The next ones often begin with it again.
    """

    def __init__(self) -> None:
        # what its effects added to each chunk, by their names, but for constant ones
        self.added: list[dict[str, Contribution]] = []
        self._model: ErrorModel | None = None
        self._chunks: list[Evaluated] = []
        self._begun: list[dict[str, Any]] = []
        # where pins rested last in each chunk, by the effects' names: there a search begins
        self._rests: list[Guesses] = []

    def like(self, model: ErrorModel) -> ErrorModel:
        """Return the known model if it is the same as one; else this one, from now on known."""
        known = self._model
        if known is not None and _same(known, model):
            return known
        alike = known is not None and _alike(known, model)
        self._begun = [_begun(each, model) for each in self._chunks if alike]
        self._rests = self._rests if alike else []
        self._model, self._chunks, self.added = model, [], []
        return model

    def chunk(self, number: int, evaluated: Callable[..., Evaluated]) -> Evaluated:
        """Return what the known model did at a chunk, evaluated now if need be.

        `evaluated` takes the `statics` and the `guess` of an earlier model, where there was one,
        and the rests `near`.
        """
        if number < len(self._chunks):
            return self._chunks[number]
        begun = self._begun[number] if number < len(self._begun) else {}
        near = self._rests[number] if number < len(self._rests) else NO_GUESSES
        found = evaluated(near=near, **begun)
        self._rests[number : number + 1] = [{**near, **found.guesses}]
        if number < MOST_KEPT:
            self._chunks.append(found)
        if number == len(self.added):
            self.added.append({each.effect.name: each.added for each in found.known.values()})
        return found


def _begun(known: Evaluated, model: ErrorModel) -> dict[str, Any]:
    """Return what another model may take over of what one did at a chunk."""
    statics = known.situations[0].statics
    if statics.parts is not model.parts:
        statics = statics.without_operators(statics.parts)
    return {"statics": statics, "guess": known.active}


def _alike(one: ErrorModel, other: ErrorModel) -> bool:
    """Tell whether two models rest on the same table."""
    return one.table is other.table and one.evaluation == other.evaluation


def _same(one: ErrorModel, other: ErrorModel) -> bool:
    """Tell whether two models have the very same effects on the same table."""
    return (
        _alike(one, other)
        and len(one.effects) == len(other.effects)
        # A user's own law may write into its state: what it did cannot be begun from again.
        and all(
            own is its and not own.law.foreign
            for own, its in zip(one.effects, other.effects, strict=True)
        )
    )


def predicted(
    models: Sequence[ErrorModel],
    block: Block,
    accepted: NDArray[np.bool_],
    recent: Recent | None = None,
    slopes: bool = False,
) -> list[BlockPrediction]:
    """Predict a recording with models that share their table.

    What they have in common with the first one is computed once.

    `block`: n samples; `accepted` (n,): those inside the table's domain and load range; the
    effects' memory passes over the rest; `recent`: of this block; then `models` begin with what it
    says is like the first; `slopes`: as for `evaluate_beside`.  Raises `UndefinedFormulaError` if a
    user's formula has no finite value; the message says how long after the first sample.
    """
    try:
        return _predicted(models, block, accepted, recent or Recent(), slopes)
    except UndefinedFormulaError as error:
        after = error.time_s - float(block.time[0])
        told = f"{error}, {after:.3f} s after the start"
        raise UndefinedFormulaError(told, error.time_s) from error


def _predicted(
    models: Sequence[ErrorModel],
    block: Block,
    accepted: NDArray[np.bool_],
    recent: Recent,
    slopes: bool,
) -> list[BlockPrediction]:
    usable, rows = block.take(accepted), np.flatnonzero(accepted)
    twists, measured = np.full((2, len(models), len(block), 6), np.nan)
    memories: list[Memory | None] = [None] * len(models)
    warnings: list[dict[str, None]] = [{} for _ in models]
    lacking: list[dict[str, str]] = [{} for _ in models]
    for number in range(-(-len(usable) // CHUNK)):
        chosen = slice(number * CHUNK, (number + 1) * CHUNK)
        part, own = usable.take(chosen), rows[chosen]
        first = recent.chunk(number, partial(evaluate, models[0], part, memories[0]))
        beside = max(1, STACK // len(part))
        groups = [slice(begin, begin + beside) for begin in range(1, len(models), beside)]
        for group in (slice(0, 1), *groups):
            found = [first]
            if group.start:
                found = evaluate_beside(models[group], memories[group], first, slopes)
            memories[group] = [each.memory for each in found]
            twists[group, own] = [each.twist for each in found]
            measured[group, own] = seen_by(found)
            for n, each in zip(range(len(models))[group], found, strict=True):
                warnings[n].update(dict.fromkeys(each.warnings))
                lacking[n].update(each.lacking)
    return [
        BlockPrediction(twists[i], measured[i], accepted, tuple(warnings[i]), lacking[i])
        for i in range(len(models))
    ]
