"""A noisy load is a noisy regressor: estimates shrink, and are brought back.

SIMEX (Cook and Stefanski 1994): known noise is added to the conditions in growing doses, the model
is refitted, and the trend of each parameter is followed back to a dose of minus one.
"""

from dataclasses import replace

import numpy as np

from wrist_stiffness.diagnosis.candidates import Candidate
from wrist_stiffness.diagnosis.estimates import joint_fit
from wrist_stiffness.diagnosis.hypotheses import Evidence, make_evidence
from wrist_stiffness.diagnosis.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.diagnosis.observations import Array, Observations

DOSES = (0.5, 1.0, 1.5, 2.0)
"""Added variance over the variance that is there already."""

REPEATS = 10


def dosed(observations: Observations, dose: float, rng: np.random.Generator) -> Observations:
    """Return the table with more noise on its uncertain conditions."""
    noisier = {
        name: column
        + rng.normal(0, observations.covariate_std.get(name, 0.0) * np.sqrt(dose), len(column))
        for name, column in observations.covariates.items()
    }
    return replace(observations, covariates=noisier)


def without_attenuation(
    evidence: Evidence,
    effects: list[tuple[Candidate, tuple[float, ...]]],
    nuisances: tuple[Nuisance, ...],
    rng: np.random.Generator,
) -> list[Array]:
    """Linear parameters of each effect as if the conditions were known exactly.

    Parameters
    ----------
    evidence : Evidence
        Table, with `covariate_std` on the uncertain conditions, and its noise.
    effects : list of (Candidate, shape)
        All effects in the model; their columns must follow the conditions of the table.
    nuisances : tuple of Nuisance
        The base.
    rng : numpy.random.Generator
        For the doses.

    Returns
    -------
    list of (k,) arrays
        One per effect.
    """

    def fitted(table: Observations) -> Array:
        again = make_evidence(table, evidence.noise, nuisance_columns(table, nuisances))
        hypotheses = [again.hypothesis(candidate, shape) for candidate, shape in effects]
        return np.concatenate(joint_fit(again, hypotheses)[1])

    table = evidence.observations
    doses, values = [0.0], [fitted(table)]
    for dose in DOSES:
        doses.append(dose)
        values.append(np.mean([fitted(dosed(table, dose, rng)) for _ in range(REPEATS)], axis=0))
    exact = np.array([_followed_back(np.array(doses), column) for column in np.array(values).T])
    ends = np.cumsum([len(candidate.parameters) for candidate, _ in effects])
    return np.split(exact, ends[:-1])


def _followed_back(doses: Array, values: Array) -> float:
    """Trend of one parameter at a dose of minus one.

    A slope over one noisy condition is exactly the inverse of a straight line in the dose; a
    parameter that does not shrink like that follows a parabola.
    """
    size = np.abs(values)
    if (np.sign(values) == np.sign(values[0])).all() and size.min() > 0.3 * size.max():
        level, slope = np.polynomial.polynomial.polyfit(doses, 1 / values, 1)
        if abs(slope) < abs(level):
            return float(1 / (level - slope))
    trend = np.polynomial.polynomial.polyfit(doses, values, 2)
    return float(np.polynomial.polynomial.polyval(-1.0, trend))
