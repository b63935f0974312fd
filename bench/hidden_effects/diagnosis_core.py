"""The project's statistics with the simulation's words: `wrist_stiffness.inference` alone.

This judges the search, the colour of the noise, the classes and the abstentions.  It does not judge
the laws of the error model; `own_diagnosis` does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from bench_wrist import Array
from dictionary import Dictionary
from observe import Riddle
from solvers import Answer, explained, nothing
from whitened import whitened

from wrist_stiffness.inference.candidates import Candidate, Parameter
from wrist_stiffness.inference.nuisance import Nuisance
from wrist_stiffness.inference.observations import Observations, Quantity
from wrist_stiffness.inference.table_diagnosis import diagnose

CONDITIONS = (
    *("theta_1", "theta_2", "speed_1", "speed_2", "sense_1", "sense_2"),
    *("fx", "fy", "fz", "mx", "my", "mz", "time", "temperature"),
)
QUANTITIES = (Quantity("s", "um", (0, 1, 2), 1e6), Quantity("phi", "mdeg", (3, 4, 5), 57295.8))


def _rows(columns: Array) -> Callable[..., Array]:
    def given(units: Observations, shape: tuple[float, ...] = ()) -> Array:
        return columns[units.rows]

    return given


def diagnosis_core(riddle: Riddle, words: Dictionary) -> Answer:
    """Diagnose the first day; what the findings explain is the fit of their best members."""
    train = riddle.train
    rows = train.measured.any(axis=1)
    values = np.where(train.measured, train.residual, np.nan)[rows]
    observations = Observations(
        values=values,
        covariates=dict(zip(CONDITIONS, train.conditions[rows].T, strict=True)),
        covariance=train.covariance[rows],
        time_s=train.conditions[rows, CONDITIONS.index("time")] * riddle.case.seconds,
        quantities=QUANTITIES,
    )
    nuisances = [
        Nuisance(word.name, _rows(word.train[rows]), per_session=True) for word in words.nuisance
    ]
    base = words.base.train[rows]
    nuisances.append(Nuisance("base", _rows(base), prior_std=(1.0,) * base.shape[2]))
    candidates = []
    for word in words.searched:
        effect, component = word.name.split("@")
        free = tuple(Parameter(f"direction_{i}") for i in range(word.train.shape[2]))
        candidates.append(Candidate(effect, component, free, _rows(word.train[rows])))
    result = diagnose(observations, tuple(candidates), tuple(nuisances))
    names = tuple(finding.names for finding in result.findings)
    chosen = [word for word in words.searched if word.name in {members[0] for members in names}]
    unseen = tuple(f"{each.effect}@{each.component}" for each in result.not_excited)
    if not chosen:
        return replace(nothing(riddle, result.verdict), not_excited=unseen)
    fitted = explained(chosen, whitened(riddle, words).fit(chosen)[0])
    return Answer(result.verdict, names, fitted, unseen)
