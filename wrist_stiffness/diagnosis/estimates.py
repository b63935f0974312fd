"""Joint estimate of everything in a model, with honest standard uncertainties."""

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.hypotheses import Evidence, Hypothesis, addition
from wrist_stiffness.diagnosis.observations import Array
from wrist_stiffness.diagnosis.projection import Base, augmented, least_squares

SHAPE_STEP = 0.02
"""Step of the difference quotient, as a share of the range of a shape parameter."""

BOUND_MARGIN = 2.0
"""Standard uncertainties by which an estimate may lie outside what is possible."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters of one effect.

    Parameters
    ----------
    values, uncertainty : (k + j,) arrays
        Linear parameters, then shape parameters; one standard uncertainty.
    """

    values: Array
    uncertainty: Array


def estimate(
    evidence: Evidence, base: Base, hypothesis: Hypothesis, inflation: float = 1.0
) -> Estimate:
    """Parameters of an effect with everything else in the base refitted.

    Parameters
    ----------
    evidence : Evidence
        Table and noise.
    base : Base
        All the rest of the model.
    hypothesis : Hypothesis
        The effect, not in the base.
    inflation : float, optional
        Factor of the variances where structure remains.
    """
    added = addition(base, hypothesis)
    reference, columns = added.norm, added.beyond
    linear = added.fitted[0]
    slopes = [_slope(evidence, hypothesis, axis, linear) for axis in range(len(hypothesis.shape))]
    if slopes:
        slope = np.column_stack(slopes)
        reference = np.concatenate([reference, np.linalg.norm(slope, axis=0)])
        columns = np.hstack([columns, base.beyond(slope)])
    variance = inflation * np.diag(least_squares(columns, base.residual, reference)[1])
    return Estimate(np.concatenate([linear, hypothesis.shape]), np.sqrt(np.maximum(variance, 0)))


def _slope(evidence: Evidence, hypothesis: Hypothesis, axis: int, linear: Array) -> Array:
    """Change of the prediction per unit of one shape parameter, (N,)."""
    grid = hypothesis.candidate.shape[axis].grid
    step = SHAPE_STEP * (grid[-1] - grid[0])
    ends = []
    for at in (
        max(hypothesis.shape[axis] - step, grid[0]),
        min(hypothesis.shape[axis] + step, grid[-1]),
    ):
        shape = (*hypothesis.shape[:axis], at, *hypothesis.shape[axis + 1 :])
        ends.append((at, evidence.hypothesis(hypothesis.candidate, shape).columns @ linear))
    return (ends[1][1] - ends[0][1]) / (ends[1][0] - ends[0][0])


def possible(base: Base, hypothesis: Hypothesis, inflation: float) -> bool:
    """Whether the linear estimates respect their bounds within their uncertainty."""
    values, covariance = addition(base, hypothesis).fitted
    margin = BOUND_MARGIN * np.sqrt(inflation * np.maximum(np.diag(covariance), 0))
    lower = np.array([p.lower for p in hypothesis.candidate.parameters])
    upper = np.array([p.upper for p in hypothesis.candidate.parameters])
    return bool(((values + margin >= lower) & (values - margin <= upper)).all())


def joint_fit(evidence: Evidence, hypotheses: list[Hypothesis]) -> tuple[Array, list[Array]]:
    """Fit base and effects together.

    Parameters
    ----------
    evidence : Evidence
        Table, noise and nuisance columns.
    hypotheses : list of Hypothesis
        Effects at their shapes.

    Returns
    -------
    (p,) array
        Parameters of the nuisance columns.
    list of (k,) arrays
        Linear parameters of each effect.
    """
    nuisance = evidence.nuisance
    p = len(nuisance.prior_std)
    white = evidence.noise.whiten(
        evidence.observations,
        np.concatenate([nuisance.columns, evidence.observations.values[:, :, None]], axis=2),
    )
    rows = augmented(white, nuisance.prior_std)
    columns = np.hstack([rows[:, :-1], *(h.columns for h in hypotheses)])
    parameters = least_squares(columns, rows[:, -1], np.linalg.norm(columns, axis=0))[0]
    ends = np.cumsum([p] + [h.columns.shape[1] for h in hypotheses])
    return parameters[:p], [parameters[a:b] for a, b in zip(ends, ends[1:], strict=False)]
