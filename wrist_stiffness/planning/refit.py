"""Fit effects to what was measured, as a diagnosis does, so that rivals agree with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.planning.information import FREE, MeasurementNoise, whitened
from wrist_stiffness.planning.question import SESSION, TARE, Question
from wrist_stiffness.planning.signatures import Signature, signatures
from wrist_stiffness.planning.timeline import Experiment
from wrist_stiffness.progress import Progress, silent

EVALUATIONS = 20
"""Of the model at most; a fit nearby is good enough to plan from."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What an effect left in an experiment."""

    experiment: Experiment  # with n samples
    nuisances: Sequence[Signature]  # what is refitted whatever is asked, there
    left: Array  # (n, 6), twists [m, rad]


def fitted(
    model: ErrorModel,
    data: Sequence[Measured],
    effect: Effect,
    free: Sequence[str],
    noise: MeasurementNoise,
) -> Effect:
    """Return an effect with the values that fit all data best.

    `data`: each with instruments set up anew; `effect`: with the values to begin from; `free`:
    nuisances of which nothing is known.
    """
    keys = [p.key for p in effect.parameters]
    scale = np.array([p.scale for p in effect.parameters])
    bounds = np.array([(p.lower, p.upper) for p in effect.parameters]).T / scale
    nuisances = _nuisances(model, data, free, noise)

    def at(sizes: Array) -> Effect:
        return effect.with_values(dict(zip(keys, (sizes * scale).tolist(), strict=True)))

    @lru_cache(maxsize=1)
    def over(sizes: tuple[float, ...]) -> Array:
        """Return whitened columns and, last, what the effect and all nuisances leave over."""
        blocks = []
        for each in data:
            (own,) = signatures(model, each.experiment.block, [(at(np.array(sizes)),)])
            left = own.truths - each.left[..., None]
            stacked = np.concatenate([own.columns, left], axis=2)
            blocks.append(np.concatenate(whitened(each.experiment, stacked, model.table, noise)))
        rows = np.concatenate(blocks)
        rows = np.concatenate([rows, np.zeros((len(nuisances) - len(rows), rows.shape[1]))])
        found: Array = rows - nuisances @ (nuisances.T @ rows)
        return found

    # A rival's own values are known as loosely as everywhere in a plan.
    loose = np.eye(len(keys)) / FREE
    begin = np.clip([effect.estimates[key].value for key in keys] / scale, *bounds)
    found = least_squares(
        lambda sizes: np.append(over(tuple(sizes))[:, -1], loose @ sizes),
        begin,
        lambda sizes: np.concatenate([over(tuple(sizes))[:, :-1], loose]),
        bounds,
        max_nfev=EVALUATIONS,
    )
    return at(np.clip(found.x, *bounds))


def _nuisances(
    model: ErrorModel, data: Sequence[Measured], free: Sequence[str], noise: MeasurementNoise
) -> Array:
    """Return an orthonormal basis of what nuisances can leave, their priors' rows below."""
    blocks, prior = [], []
    for number, each in enumerate(data):
        columns = []
        for own in each.nuisances:
            anew = own.name in (*SESSION, TARE)
            for place in range(len(data)) if anew else (0,):
                columns.append(own.columns if place == number or not anew else 0.0 * own.columns)
                width = own.columns.shape[2]
                prior += [1.0 / FREE if own.name in free else 1.0] * width if number == 0 else []
        stacked = np.concatenate(columns, axis=2)
        blocks.append(np.concatenate(whitened(each.experiment, stacked, model.table, noise)))
    basis: Array = np.linalg.qr(np.concatenate([*blocks, np.diag(prior)]))[0]
    return basis


def rivals_alike(
    model: ErrorModel,
    question: Question,
    earlier: Sequence[Experiment],
    noise: MeasurementNoise,
    progress: Progress = silent,
) -> Question:
    """Return the question with each rival as what would have left what the first one has left.

    A law that is not linear in its values changes its shape with them, so values that the data
    exclude would plan for poses where the rivals do not part.

    `earlier`: what the classes agree on.  Gives one set of values for each member of a class.
    """
    by_name = {sets[0].name: sets for sets in question.effects}
    nuisances = [
        signatures(model, each.block, [(effect,) for effect in question.nuisances])
        for each in earlier
    ]
    for number, members in enumerate(question.alike):
        first = by_name[members[0]][0]
        data = [
            Measured(e, own, signatures(model, e.block, [(first,)])[0].truths[..., 0])
            for e, own in zip(earlier, nuisances, strict=True)
        ]
        for place, name in enumerate(members[1:], start=1):
            by_name[name] = (fitted(model, data, by_name[name][0], question.free, noise),)
            progress(number * len(members) + place, len(question.alike) * len(members))
    return replace(question, effects=tuple(by_name.values()))
