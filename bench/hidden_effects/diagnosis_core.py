"""The project's own statistics as a solver: `wrist_stiffness.diagnosis` with words as candidates.

This judges the search, the colour of the noise, the classes and the abstentions.  It does not judge
the effects of the error model, whose columns would come from laws of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from bench_wrist import SECONDS, Array
from dictionary import Word, nuisance_names
from observe import Riddle
from solvers import Answer, Whitened, predict

from wrist_stiffness.diagnosis.candidates import Candidate, Parameter
from wrist_stiffness.diagnosis.diagnose import diagnose
from wrist_stiffness.diagnosis.nuisance import Nuisance
from wrist_stiffness.diagnosis.observations import Observations, Quantity
from wrist_stiffness.diagnosis.settings import Settings

CONDITIONS = (
    *("theta_1", "theta_2", "speed_1", "speed_2", "sense_1", "sense_2"),
    *("fx", "fy", "fz", "mx", "my", "mz", "time", "temperature"),
)
PERMUTATIONS = 199
QUANTITIES = (Quantity("s", "um", (0, 1, 2), 1e6), Quantity("phi", "mdeg", (3, 4, 5), 57295.8))


def _rows(columns: Array) -> Callable[..., Array]:
    def given(units: Observations, shape: tuple[float, ...] = ()) -> Array:
        return columns[units.rows]

    return given


def diagnosis_core(riddle: Riddle, words: Sequence[Word]) -> Answer:
    """Diagnose the first session; predict the second by a joint fit of the best members."""
    train = riddle.train
    observations = Observations(
        values=train.residual,
        covariates=dict(zip(CONDITIONS, train.conditions.T, strict=True)),
        covariance=train.covariance,
        time_s=train.conditions[:, CONDITIONS.index("time")] * SECONDS,
        quantities=QUANTITIES,
    )
    nuisances, candidates = [], []
    for word in words:
        columns = _rows(word.train)
        if word.name in nuisance_names():
            nuisances.append(Nuisance(word.name, columns, per_session=True))
        else:
            effect, component = word.name.split("@")
            free = tuple(Parameter(f"direction_{i}") for i in range(word.train.shape[2]))
            candidates.append(Candidate(effect, component, free, columns))
    result = diagnose(
        observations,
        tuple(candidates),
        tuple(nuisances),
        np.random.default_rng(riddle.case.seed),
        Settings(permutations=PERMUTATIONS),
    )
    names = tuple(finding.names for finding in result.findings)
    chosen = [word for word in words if word.name in {members[0] for members in names}]
    predicted = np.zeros_like(riddle.test.residual)
    if chosen:
        fit = Whitened(train, [word for word in words if word.name in nuisance_names()])
        predicted = predict(chosen, fit.fit(chosen)[0])
    return Answer(result.verdict, names, predicted)
