"""What is always refitted before any effect is considered.

Registrations, zeros, tare and well-known tolerances explain whatever they can first; an effect
counts only for what it explains beyond them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.observations import Array, Observations


@dataclass(frozen=True)
class Nuisance:
    """A group of columns that belongs to the base.

    Parameters
    ----------
    name : str
        What a person calls it, for example ``registration of the tracker``.
    columns : callable
        observations -> (n, m, p).
    prior_std : tuple of float, optional
        Standard deviation of each of the p parameters around zero; without it they are free.
    per_session : bool, optional
        Set anew in every session (a registration) instead of once for the machine.
    """

    name: str
    columns: Callable[[Observations], Array]
    prior_std: tuple[float, ...] | None = None
    per_session: bool = False


@dataclass(frozen=True, eq=False)
class NuisanceColumns:
    """All nuisance groups over one table.

    Parameters
    ----------
    columns : (n, m, p) array
        Change of the observations per parameter.
    prior_std : (p,) array
        Infinite where the parameter is free.
    keys : tuple of (str, int or None, int)
        Group, session (None = the same in all sessions) and place in the group.
    """

    columns: Array
    prior_std: Array
    keys: tuple[tuple[str, int | None, int], ...]


def nuisance_columns(
    observations: Observations, nuisances: tuple[Nuisance, ...]
) -> NuisanceColumns:
    """Evaluate every group, with one copy per session where it is set anew.

    Raises
    ------
    InputError
        If columns and priors do not fit together, or a column is not a number.
    """
    n, m = observations.values.shape
    blocks, priors = [np.empty((n, m, 0))], [np.empty(0)]
    keys: list[tuple[str, int | None, int]] = []
    for nuisance in nuisances:
        columns = np.asarray(nuisance.columns(observations), dtype=np.float64)
        if columns.shape[:2] != (n, m) or columns.ndim != 3:
            raise InputError(f"{nuisance.name} returned columns {columns.shape}, not {(n, m)} x p")
        if not np.isfinite(columns).all():
            raise InputError(f"{nuisance.name} returned a column that is not a number")
        p = columns.shape[2]
        prior = np.full(p, np.inf) if nuisance.prior_std is None else np.array(nuisance.prior_std)
        if prior.shape != (p,) or not (prior > 0).all():
            raise InputError(f"{nuisance.name} needs {p} positive prior deviations, has {prior}")
        sessions: list[int | None] = [None]
        if nuisance.per_session:
            sessions = [int(session) for session in np.unique(observations.sessions)]
        for session in sessions:
            inside = 1.0 if session is None else (observations.sessions == session)[:, None, None]
            blocks.append(columns * inside)
            priors.append(prior)
            keys += [(nuisance.name, session, place) for place in range(p)]
    return NuisanceColumns(np.concatenate(blocks, axis=2), np.concatenate(priors), tuple(keys))
