"""What the statistics are asked at a place of the search: table, candidates and nuisances."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander

from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.searching.place import Place
from wrist_stiffness.diagnosis import Diagnosis, Nuisance, Observations, Settings, diagnose

WANDER_SHARES = (0.7, 0.5, 0.35)
"""Root mean square of slope, curvature and third order of a wander, against its own."""

LEAST_WANDER = 0.5
"""Of the scatter of one sample: what repeated rests of a few minutes show of a wander is uncertain,
and a drift below it is not told from one."""

FOUND = ", found"
"""After the name of an effect that is refitted beside the base, because it is known by now."""


def asked(place: Place, rng: np.random.Generator, settings: Settings) -> Diagnosis:
    """Return what the statistics say at a place."""
    known = tuple(each.candidate() for each in place.candidates)
    nuisances = nuisances_of(place.base, place.known)
    return diagnose(table_of(place), known, nuisances, rng, settings)


def table_of(place: Place) -> Observations:
    """Return what is left with the wrist's tolerances at their prior means again, to first order.

    So the priors of the statistics, which lie about zero, are the priors of the wrist.
    """
    base = place.base
    own = base.tolerances if place.known else base.tolerances | base.on_base
    left = base.left(with_extras=place.known).observations
    return left.with_values(left.values - base.columns[:, :, own] @ base.z[own])


def nuisances_of(base: BaseFit, with_extras: bool = False) -> tuple[Nuisance, ...]:
    """Return the refitted base as columns; registrations, zeros and tare are free anew."""
    groups: dict[tuple[str, bool], dict[str, list[int]]] = {}
    for place, unknown in enumerate(base.problem.unknowns):
        if base.of_base[place] or with_extras:
            name = base.problem.free[unknown.free].effect.name
            name += "" if base.of_base[place] else FOUND
            group = groups.setdefault((name, unknown.session is not None), {})
            group.setdefault(unknown.key, []).append(place)
    found = [
        _nuisance(base, name, per_session, list(keys.values()))
        for (name, per_session), keys in groups.items()
    ]
    return (*found, wander_of(base))


def _nuisance(base: BaseFit, name: str, per_session: bool, places: list[list[int]]) -> Nuisance:
    # What is left falls where a prediction rises.  Each session has its own rows.
    columns = -np.stack([base.columns[:, :, each].sum(axis=2) for each in places], axis=-1)
    prior = None if per_session else tuple(base.prior_std[[each[0] for each in places]].tolist())
    return Nuisance(name, lambda units: columns[units.rows], prior, per_session)


def wander_of(base: BaseFit) -> Nuisance:
    """Return the instrument's slow wander over a session: it is no drift.

    Legendre polynomials of the time with the sizes that a wander of a minute or so has.
    """
    columns = []
    for session in base.problem.sessions:
        time = session.mean(session.block.time)[session.measured]
        span = max(float(np.ptp(time)), 1e-9)
        wave = legvander(2.0 * (time - time.min()) / span - 1.0, len(WANDER_SHARES))[:, 1:]
        size = np.maximum(session.wander, LEAST_WANDER * np.nan_to_num(session.white))
        rise = np.sqrt(2.0 * np.arange(1, len(WANDER_SHARES) + 1) + 1.0) * WANDER_SHARES
        each = (wave * rise)[:, None, :, None] * np.diag(size)[None, :, None, :]
        columns.append(each.reshape(len(time), 6, -1))
    rows = np.concatenate(columns)
    prior = (1.0,) * rows.shape[2]
    return Nuisance("slow wander", lambda units: rows[units.rows], prior, per_session=True)
