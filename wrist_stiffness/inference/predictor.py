"""What a diagnosis learned, as predictions for units that it has not seen."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.candidates import Candidate, Nuisance, nuisance_columns
from wrist_stiffness.inference.evidence import OFF, Evidence
from wrist_stiffness.inference.linear import LinearFit, LinearProblem, Shape
from wrist_stiffness.inference.observations import Array, Observations
from wrist_stiffness.inference.smooth import Smooth

SCHEMA = 2
"""Of the file."""

LEAST = 1e-3
"""Probability from which a set has a part in the predictions."""


@dataclass(frozen=True, eq=False)
class PredictedSet:
    """One set of effects with its values, and what it leaves that depends on the conditions."""

    probability: float  # its share in the predictions
    effects: Mapping[str, tuple[Shape, Shape]]  # shape (s,) and parameters (k,) of each
    # values by group, session and place in the group
    nuisances: Mapping[tuple[str, int | None, int], float]
    # the discrepancy: smooth functions of the conditions with their values, (k, m) each
    smooth: tuple[tuple[Smooth, Array], ...] = ()
    # what of these functions candidates could do, by name, shape and parameters: it is no
    # discrepancy, and is taken out again
    beside: tuple[tuple[str, Shape, Shape], ...] = ()


@dataclass(frozen=True, eq=False)
class Predictor:
    """Predicts what was measured beside the model, averaged over the sets of effects.

    Parameters
    ----------
    sets : tuple of PredictedSet
        Their probabilities sum up to 1.
    candidates : sequence of Candidate
        The laws.
    nuisances : sequence of Nuisance
        What was refitted.
    """

    sets: tuple[PredictedSet, ...]
    candidates: Sequence[Candidate]
    nuisances: Sequence[Nuisance]

    def predict(self, units: Observations) -> Array:
        """Return what to add to the model's predictions, (n, m).

        The registration of a session that was not fitted, as that which judged, is 0: set it up
        first.

        Parameters
        ----------
        units : Observations
            Conditions; the values are not looked at.
        """
        base = nuisance_columns(units, tuple(self.nuisances))
        laws = {each.name: each for each in self.candidates}
        total = np.zeros(units.values.shape)
        for each in self.sets:
            values = np.array([each.nuisances.get(key, 0.0) for key in base.keys])
            change = base.columns @ values
            named = [(name, *effect) for name, effect in each.effects.items()]
            for name, shape, sizes in (*named, *each.beside):
                change = change + laws[name].evaluate(units, shape) @ np.array(sizes)
            for question, own in each.smooth:
                change = change + question.features(units.covariates) @ own
            total += each.probability * change
        return total

    def save(self, path: str | Path) -> None:
        """Write the values as JSON; the laws themselves stay in the program."""
        sets = [
            {
                "probability": each.probability,
                "effects": dict(each.effects),
                "nuisances": [[*key, value] for key, value in each.nuisances.items()],
                "smooth": [[q.as_dict(), own.tolist()] for q, own in each.smooth],
                "beside": each.beside,
            }
            for each in self.sets
        ]
        with replacing(path) as temporary:
            temporary.write_text(json.dumps({"schema": SCHEMA, "sets": sets}, indent=1) + "\n")


def load_predictor(
    path: str | Path, candidates: Sequence[Candidate], nuisances: Sequence[Nuisance]
) -> Predictor:
    """Read a predictor that was saved.

    Parameters
    ----------
    path : path
        File.
    candidates, nuisances : sequence
        Those of the diagnosis.

    Raises
    ------
    InputError
        If the file is none of these, or holds values of a law that is not among the candidates or
        of a nuisance that is not among those given.
    """
    try:
        content: Any = json.loads(Path(path).read_text())
        if content["schema"] != SCHEMA:
            raise InputError(f"{path}: schema {content['schema']}, not {SCHEMA}")
        sets = tuple(
            PredictedSet(
                float(each["probability"]),
                {n: (tuple(s), tuple(v)) for n, (s, v) in each["effects"].items()},
                {
                    (name, session, place): value
                    for name, session, place, value in each["nuisances"]
                },
                tuple((Smooth.from_dict(q), np.array(own)) for q, own in each["smooth"]),
                tuple((name, tuple(s), tuple(v)) for name, s, v in each["beside"]),
            )
            for each in content["sets"]
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: no saved predictor ({error})") from error
    named = {name for each in sets for name in (*each.effects, *(b[0] for b in each.beside))}
    unknown = named - {c.name for c in candidates}
    if unknown:
        raise InputError(f"{path}: {sorted(unknown)[0]} is not among the candidates")
    refitted = {(key[0], key[1] is not None) for each in sets for key in each.nuisances}
    for name, anew in sorted(refitted - {(each.name, each.per_session) for each in nuisances}):
        how = "set up anew in every session" if anew else "the same in all sessions"
        raise InputError(f"{path}: {name}, {how}, is not among the nuisances")
    return Predictor(sets, candidates, nuisances)


def predicted_set(
    fit: LinearFit, found: Evidence, probability: float, whole: bool = False
) -> PredictedSet:
    """Return a fitted set at its most probable values.

    `found`: its evidence; `probability`: its share in the predictions; `whole`: whether the
    discrepancy that it leaves is predicted too.
    """
    problem = fit.problem
    z = (found.point.z + found.step)[: len(fit.z)]
    z = np.where(problem.held(fit), fit.z, z)
    effects = {
        name: (term.shape, tuple((problem.sizes[name] * z[fit.places[name]]).tolist()))
        for name, term in fit.terms.items()
    }
    base = problem.base_sizes * z[: problem.n_nuisances]
    smooth = _discrepancy(problem, found) if whole else []
    beside = []
    if smooth:
        conditions = problem.observations.covariates
        change = np.sum([q.features(conditions) @ own for q, own in smooth], axis=0)
        of_base, of_laws = problem.named_share(change)
        base = base - of_base
        for term, sizes in of_laws:
            beside.append((term.candidate.name, term.shape, tuple((-sizes).tolist())))
    nuisances = dict(zip(problem.nuisances.keys, base.tolist(), strict=True))
    return PredictedSet(probability, effects, nuisances, tuple(smooth), tuple(beside))


def _discrepancy(problem: LinearProblem, found: Evidence) -> list[tuple[Smooth, Array]]:
    """Return the smooth functions that are there, with their most probable values (k, m)."""
    ground = found.background
    asked = {each.name: each for each in problem.table.questions}
    smooth = []
    for number, group in enumerate(ground.groups):
        if found.amplitude[number] > OFF and group.name in asked:
            at = np.flatnonzero(group.size)
            own = found.unnamed[ground.group == number].reshape(-1, len(at))
            values = np.zeros((len(own), len(group.size)))
            # What is left and this add up to noise.
            values[:, at] = -own * group.size[at]
            smooth.append((asked[group.name], values))
    return smooth
