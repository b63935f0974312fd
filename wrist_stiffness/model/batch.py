"""Evaluate models over a whole recording, a chunk of samples at a time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, repeat

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.evaluation import evaluate, evaluate_beside, seen_by
from wrist_stiffness.model.formula import UndefinedFormulaError
from wrist_stiffness.model.prediction import BlockPrediction
from wrist_stiffness.model.stages import NO_GUESSES, Evaluable, Guesses, Memory

CHUNK = 2048
"""Samples evaluated at a time: about 150 MB of operators with 24 flange sectors."""

STACK = 8192
"""Samples, counted once for each model, whose contacts are solved together."""


def predicted(
    models: Sequence[Evaluable],
    block: Block,
    accepted: NDArray[np.bool_],
    near: Sequence[Guesses] = (),
) -> list[BlockPrediction]:
    """Predict a recording with models that share their table.

    Parameters
    ----------
    models : sequence of Evaluable
        What they have in common with the first one is computed once.
    block : Block
        n samples.
    accepted : (n,) bool
        Samples inside the table's domain and load range; the effects' memory passes over the rest.
    near : sequence of dict, optional
        `guesses` of an earlier prediction of this block.

    Returns
    -------
    list of BlockPrediction
        One for each model.

    Raises
    ------
    InputError
        If a user's formula has no finite value; the message says how long after the first sample.
    """
    try:
        return _predicted(models, block, accepted, near)
    except UndefinedFormulaError as error:
        after = error.time_s - float(block.time[0])
        raise InputError(f"{error}, {after:.3f} s after the start") from error


def _predicted(
    models: Sequence[Evaluable],
    block: Block,
    accepted: NDArray[np.bool_],
    near: Sequence[Guesses],
) -> list[BlockPrediction]:
    usable, rows = block.take(accepted), np.flatnonzero(accepted)
    twists, measured = np.full((2, len(models), len(block), 6), np.nan)
    memories: list[Memory | None] = [None] * len(models)
    warnings: list[dict[str, None]] = [{} for _ in models]
    guesses: list[Guesses] = []
    for start, guess in zip(
        range(0, len(usable), CHUNK), chain(near, repeat(NO_GUESSES)), strict=False
    ):
        part = usable.take(slice(start, start + CHUNK))
        own = rows[start : start + CHUNK]
        first = evaluate(models[0], part, memories[0], near=guess)
        guesses.append(first.staged.guesses)
        beside = max(1, STACK // len(part))
        groups = [slice(begin, begin + beside) for begin in range(1, len(models), beside)]
        for group in (slice(0, 1), *groups):
            found = [first]
            if group.start:
                found = evaluate_beside(models[group], memories[group], first)
            memories[group] = [each.memory for each in found]
            twists[group, own] = [each.twist for each in found]
            measured[group, own] = seen_by(found)
            for known, each in zip(warnings[group], found, strict=True):
                known.update(dict.fromkeys(each.warnings))
    return [
        BlockPrediction(twists[i], measured[i], accepted, tuple(warnings[i]), tuple(guesses))
        for i in range(len(models))
    ]
