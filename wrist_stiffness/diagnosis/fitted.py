"""A model fitted to some units and asked about others."""

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.candidates import Candidate
from wrist_stiffness.diagnosis.estimates import joint_fit
from wrist_stiffness.diagnosis.hypotheses import Evidence, Hypothesis, make_evidence
from wrist_stiffness.diagnosis.noise import estimate_noise
from wrist_stiffness.diagnosis.nuisance import Nuisance, nuisance_columns
from wrist_stiffness.diagnosis.observations import Array, Observations
from wrist_stiffness.diagnosis.projection import augmented
from wrist_stiffness.diagnosis.whitening import NoiseModel


@dataclass(frozen=True, eq=False)
class FittedModel:
    """Base and effects with their parameters.

    Parameters
    ----------
    nuisances : tuple of Nuisance
        The base.
    known : dict
        Its parameters by group, session and place.
    effects : tuple of (Candidate, shape, parameters)
        The effects.
    noise : NoiseModel
        Scatter of the units that it was fitted to.
    """

    nuisances: tuple[Nuisance, ...]
    known: dict[tuple[str, int | None, int], float]
    effects: tuple[tuple[Candidate, tuple[float, ...], Array], ...]
    noise: NoiseModel

    def residual(self, observations: Observations) -> Array:
        """Observations minus prediction, (n, m), NaN where not measured.

        What is set up anew in a session that the fit has not seen (a registration) is refitted
        to these observations; everything else keeps its fitted value.

        Parameters
        ----------
        observations : Observations
            Any units of the same machine.
        """
        columns = nuisance_columns(observations, self.nuisances)
        residual = observations.values.copy()
        for candidate, shape, parameters in self.effects:
            residual -= candidate.evaluate(observations, shape) @ parameters
        residual -= columns.columns @ np.array([self.known.get(key, 0.0) for key in columns.keys])
        fresh = np.array([key not in self.known for key in columns.keys], dtype=bool)
        if fresh.any():
            anew, prior_std = columns.columns[:, :, fresh], columns.prior_std[fresh]
            residual -= anew @ self._refitted(observations, residual, anew, prior_std)
        return residual

    def _refitted(
        self, observations: Observations, residual: Array, columns: Array, prior_std: Array
    ) -> Array:
        white = self.noise.whiten(
            observations, np.concatenate([columns, residual[:, :, None]], axis=2)
        )
        rows = augmented(white, prior_std)
        norm = np.linalg.norm(rows[:, :-1], axis=0)
        norm = np.where(norm > 0, norm, 1.0)
        return np.linalg.lstsq(rows[:, :-1] / norm, rows[:, -1], rcond=1e-10)[0] / norm


def fit_to(
    evidence: Evidence, effects: list[Hypothesis], nuisances: tuple[Nuisance, ...]
) -> FittedModel:
    """Fit base and effects together to units whose noise is known."""
    base_parameters, effect_parameters = joint_fit(evidence, effects)
    return FittedModel(
        nuisances,
        dict(zip(evidence.nuisance.keys, base_parameters.tolist(), strict=True)),
        tuple(
            (effect.candidate, effect.shape, parameters)
            for effect, parameters in zip(effects, effect_parameters, strict=True)
        ),
        evidence.noise,
    )


def fit(
    observations: Observations,
    effects: tuple[tuple[Candidate, tuple[float, ...]], ...],
    nuisances: tuple[Nuisance, ...],
) -> FittedModel:
    """Fit base and chosen effects to a table.

    Parameters
    ----------
    observations : Observations
        Table.
    effects : tuple of (Candidate, shape)
        Effects at the shapes to use.
    nuisances : tuple of Nuisance
        The base.
    """
    nuisance = nuisance_columns(observations, nuisances)
    columns = [np.empty((*observations.values.shape, 0))]
    columns += [candidate.evaluate(observations, shape) for candidate, shape in effects]
    noise = estimate_noise(observations, nuisance.columns, np.concatenate(columns, axis=2))
    evidence = make_evidence(observations, noise, nuisance)
    hypotheses = [evidence.hypothesis(candidate, shape) for candidate, shape in effects]
    return fit_to(evidence, hypotheses, nuisances)
