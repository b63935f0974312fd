"""Evaluate models over a whole recording, a chunk of samples at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.model.block import Block
from wrist_stiffness.model.evaluation import Evaluable, Memory, evaluate
from wrist_stiffness.model.prediction import BlockPrediction

CHUNK = 2048
"""Samples evaluated at a time: about 150 MB of operators with 24 flange sectors."""


def predicted(
    models: Sequence[Evaluable], block: Block, accepted: NDArray[np.bool_]
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

    Returns
    -------
    list of BlockPrediction
        One for each model.
    """
    usable, rows = block.take(accepted), np.flatnonzero(accepted)
    twists, measured = np.full((2, len(models), len(block), 6), np.nan)
    memories: list[Memory | None] = [None] * len(models)
    warnings: list[dict[str, None]] = [{} for _ in models]
    for start in range(0, len(usable), CHUNK):
        part = slice(start, start + CHUNK)
        first = None
        for i, model in enumerate(models):
            result, memories[i] = evaluate(model, usable.take(part), memories[i], first)
            first = first or result
            twists[i, rows[part]], measured[i, rows[part]] = result.twist, result.measured
            warnings[i].update(dict.fromkeys(result.warnings))
    return [
        BlockPrediction(twists[i], measured[i], accepted, tuple(warnings[i]))
        for i in range(len(models))
    ]
