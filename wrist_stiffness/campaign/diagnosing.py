"""Which physical effect is missing in a model of this wrist?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.campaign.base_fit import BaseFit, fit_base
from wrist_stiffness.campaign.candidates import WristCandidate, wrist_candidates
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.observing import Observed, as_units
from wrist_stiffness.diagnosis import Diagnosis, Nuisance, Observations, Settings, diagnose
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class WristDiagnosis:
    """Answer of a diagnosis on the wrist.

    Parameters
    ----------
    diagnosis : Diagnosis
        What the statistics say.
    observed : Observed
        Table of what the refitted base leaves.
    effects : tuple of Effect
        Best member of each finding, with the values found: where a fit may begin.
    """

    diagnosis: Diagnosis
    observed: Observed
    effects: tuple[Effect, ...]


def silent(done: int, total: int) -> None:
    """Show no progress."""


def diagnose_sessions(
    model: ErrorModel,
    sessions: Sequence[MeasuredSession],
    rng: np.random.Generator,
    settings: Settings | None = None,
    progress: Progress = silent,
) -> WristDiagnosis:
    """Find the effects of the catalogue that a model misses.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    sessions : sequence of MeasuredSession
        In the order of time; the last one judges what the others found, the end of the only one
        where there is one.
    rng : numpy.random.Generator
        Source of chance.
    settings : Settings, optional
        Thresholds.
    progress : callable, optional
        Told (done, total) while the catalogue is evaluated.
    """
    if not sessions:
        raise InputError("no session to diagnose")
    base = fit_base(model, tuple(as_units(model, session) for session in sessions))
    models = tuple(base.models(number) for number in range(len(sessions)))
    free = {each.effect.name for each in base.problem.free}
    present = {e.name: e for e in model.effects if e.name not in free}
    candidates = wrist_candidates(models, _used(base), present, progress)
    result = diagnose(
        _table(base),
        tuple(each.candidate() for each in candidates),
        _nuisances(base),
        rng,
        settings,
    )
    known = {each.name: each for each in candidates}
    effects = tuple(_started(known[finding.name], finding.parameters) for finding in result.findings)
    return WristDiagnosis(result, base.observed, effects)


def _started(
    candidate: WristCandidate, parameters: dict[str, tuple[float, float]]
) -> Effect:
    shape = [parameters[each.name][0] for each in candidate.recipe.shape]
    found = {name: value for name, (value, _) in parameters.items()}
    return candidate.effect(found, tuple(shape))


def _used(base: BaseFit) -> tuple[Array, ...]:
    return tuple(
        np.isfinite(each.shift).any(1) | np.isfinite(each.turn).any(1)
        for each in base.problem.sessions
    )


def _of_wrist(base: BaseFit) -> Array:
    return np.array([unknown.session is None for unknown in base.problem.unknowns])


def _table(base: BaseFit) -> Observations:
    """Return what is left with the wrist's tolerances at their prior means again, to first order.

    So the priors of the statistics, which lie about zero, are the priors of the wrist.
    """
    observations = base.observed.observations
    own = _of_wrist(base)
    return observations.with_values(observations.values - base.columns[:, :, own] @ base.z[own])


def _nuisances(base: BaseFit) -> tuple[Nuisance, ...]:
    """Return the refitted base as columns; registrations, zeros and tare are free anew."""
    unknowns = base.problem.unknowns
    groups: dict[tuple[str, bool], dict[str, list[int]]] = {}
    for place, unknown in enumerate(unknowns):
        name = base.problem.free[unknown.free].effect.name
        group = groups.setdefault((name, unknown.session is not None), {})
        group.setdefault(unknown.key, []).append(place)
    return tuple(
        _nuisance(base, name, per_session, list(keys.values()))
        for (name, per_session), keys in groups.items()
    )


def _nuisance(base: BaseFit, name: str, per_session: bool, places: list[list[int]]) -> Nuisance:
    # Columns of the residual fall where a prediction rises.  Each session has its own rows.
    columns = -np.stack([base.columns[:, :, each].sum(axis=2) for each in places], axis=-1)
    prior = None if per_session else (1.0,) * columns.shape[2]
    return Nuisance(name, lambda units: columns[units.rows], prior, per_session)
