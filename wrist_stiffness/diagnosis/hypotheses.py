"""Candidates at definite shapes, whitened and ready to be asked about."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from wrist_stiffness.diagnosis.candidates import Candidate
from wrist_stiffness.diagnosis.nuisance import NuisanceColumns
from wrist_stiffness.diagnosis.observations import Array, Observations
from wrist_stiffness.diagnosis.projection import (
    ABSORBED,
    Base,
    least_squares,
    make_base,
    orthonormal,
)
from wrist_stiffness.diagnosis.whitening import NoiseModel, Whitener
from wrist_stiffness.diagnosis.worth import directions_of

SEARCH_STEPS = 8
"""Evaluations by which a shape is refined along each of its parameters."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One candidate at one shape.

    Parameters
    ----------
    candidate : Candidate
        The effect.
    shape : tuple of float
        Values of its non-linear parameters.
    columns : (N, k) array
        Whitened columns, zero in the rows of the priors.
    """

    candidate: Candidate
    shape: tuple[float, ...]
    columns: Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """A table with its noise and its base: all that a hypothesis needs to be tested.

    Parameters
    ----------
    observations : Observations
        Cleaned table.
    noise : NoiseModel
        Scatter of its units.
    nuisance : NuisanceColumns
        Columns of the base and their priors, not whitened.
    base : Base
        The base refitted without any effect.
    """

    observations: Observations
    noise: NoiseModel
    nuisance: NuisanceColumns
    base: Base

    def whiten(self, columns: Array) -> Array:
        """Whitened columns above the (empty) rows of the priors, (N, k)."""
        white = self._whitener(columns)
        n_priors = self.base.residual.size - white.shape[0]
        return np.vstack([white, np.zeros((n_priors, white.shape[1]))])

    @cached_property
    def _whitener(self) -> Whitener:
        return Whitener(self.noise, self.observations)

    def hypothesis(self, candidate: Candidate, shape: tuple[float, ...]) -> Hypothesis:
        """Evaluate and whiten one candidate at one shape."""
        columns = candidate.evaluate(self.observations, shape)
        return Hypothesis(candidate, shape, self.whiten(columns))


class Addition:
    """What a hypothesis adds to a base, worked out when first asked for.

    Parameters
    ----------
    base : Base
        What is refitted first.
    hypothesis : Hypothesis
        The effect, not in the base.
    """

    def __init__(self, base: Base, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self.norm = np.linalg.norm(hypothesis.columns, axis=0)
        self.beyond = base.beyond(hypothesis.columns)
        self._residual = base.residual

    @cached_property
    def directions(self) -> Array:
        """Orthonormal basis of what the columns add to the base, (N, r)."""
        return orthonormal(self.beyond, self.norm)

    @cached_property
    def gain(self) -> float:
        """Sum of squares that the hypothesis explains beyond the base."""
        return float(np.sum((self.directions.T @ self._residual) ** 2))

    @cached_property
    def sized(self) -> tuple[Array, Array] | None:
        """Independent directions (N, k) of the columns at their usual sizes, and their squares.

        None where a parameter has no usual size.
        """
        scales = [p.scale for p in self.hypothesis.candidate.parameters if p.scale is not None]
        if len(scales) < len(self.norm):
            return None
        seen = np.linalg.norm(self.beyond, axis=0) > ABSORBED * self.norm
        return directions_of(self.beyond[:, seen], np.array(scales)[seen])

    @cached_property
    def moment(self) -> Array:
        """Product of each of these directions with what the base leaves, (k,)."""
        return np.empty(0) if self.sized is None else self.sized[0].T @ self._residual

    @cached_property
    def fitted(self) -> tuple[Array, Array]:
        """Linear parameters (k,) and their covariance (k, k), all of the base refitted along."""
        return least_squares(self.beyond, self._residual, self.norm)


def addition(base: Base, hypothesis: Hypothesis) -> Addition:
    """Return what a hypothesis adds to a base; the search asks of both again and again."""
    found = base.known.get(id(hypothesis))
    if found is None:
        # It holds the hypothesis, so that no other one can get its identity.
        found = base.known[id(hypothesis)] = Addition(base, hypothesis)
    return found


def make_evidence(
    observations: Observations, noise: NoiseModel, nuisance: NuisanceColumns
) -> Evidence:
    """Whiten the table and refit the base."""
    white = noise.whiten(
        observations, np.concatenate([nuisance.columns, observations.values[:, :, None]], axis=2)
    )
    base = make_base(white, nuisance.prior_std, int(observations.measured.sum()))
    return Evidence(observations, noise, nuisance, base)


def all_hypotheses(evidence: Evidence, candidates: tuple[Candidate, ...]) -> list[Hypothesis]:
    """Every candidate at every point of its grid."""
    points = [(candidate, shape) for candidate in candidates for shape in candidate.shapes]
    columns = [candidate.evaluate(evidence.observations, shape) for candidate, shape in points]
    if not points:
        return []
    # Together: the filter of the wander goes from unit to unit, whatever stands beside.
    white = evidence.whiten(np.concatenate(columns, axis=2))
    ends = np.cumsum([each.shape[2] for each in columns])
    own = (np.ascontiguousarray(each) for each in np.split(white, ends[:-1], axis=1))
    return [Hypothesis(*point, each) for point, each in zip(points, own, strict=True)]


def refined(evidence: Evidence, hypothesis: Hypothesis, base: Base) -> Hypothesis:
    """Shape that explains most beyond the base, searched along each shape parameter.

    Parameters
    ----------
    evidence : Evidence
        Table and noise.
    hypothesis : Hypothesis
        Best point of the grid.
    base : Base
        What is refitted besides, other effects included.
    """
    best, best_gain = hypothesis, gain(base, hypothesis)

    def missed(value: float, axis: int) -> float:
        nonlocal best, best_gain
        point = (*best.shape[:axis], float(value), *best.shape[axis + 1 :])
        trial = evidence.hypothesis(hypothesis.candidate, point)
        explained = gain(base, trial)
        if explained > best_gain:
            best, best_gain = trial, explained
        return -explained

    for axis, parameter in enumerate(hypothesis.candidate.shape):
        grid = np.array(parameter.grid)
        at = int(np.argmin(np.abs(grid - hypothesis.shape[axis])))
        minimize_scalar(
            missed,
            bounds=(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]),
            args=(axis,),
            method="bounded",
            options={"maxiter": SEARCH_STEPS},
        )
    return best


def gain(base: Base, hypothesis: Hypothesis) -> float:
    """Sum of squares that the hypothesis explains beyond the base."""
    return addition(base, hypothesis).gain
