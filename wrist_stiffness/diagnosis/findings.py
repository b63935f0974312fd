"""From an effect in the model to a finding that a technician can use."""

from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.diagnosis.estimates import estimate
from wrist_stiffness.diagnosis.hypotheses import Evidence, Hypothesis
from wrist_stiffness.diagnosis.observations import Array, Labels
from wrist_stiffness.diagnosis.projection import Base
from wrist_stiffness.diagnosis.ranking import Ranked, scored
from wrist_stiffness.diagnosis.resampling import BlockGrams, stability
from wrist_stiffness.diagnosis.result import Finding
from wrist_stiffness.diagnosis.rivals import indistinguishable
from wrist_stiffness.diagnosis.sealed import HeldOut, bought
from wrist_stiffness.diagnosis.selection import Entered, base_with, rivals_of
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.structure import background


@dataclass(frozen=True, eq=False)
class Model:
    """Outcome of the search with all that is needed to judge it.

    Parameters
    ----------
    evidence : Evidence
        Table, noise and base.
    catalogue : list of Hypothesis
        Everything that was testable.
    effects : tuple of Entered
        What is in the model.
    stages : tuple of HeldOut
        Sealed part before the first effect and after each.
    blocks : (n,) array
        Blocks for resampling.
    dimension : float
        Independent chances of structure.
    settings : Settings
        Thresholds.
    """

    evidence: Evidence
    catalogue: list[Hypothesis]
    effects: tuple[Entered, ...]
    stages: tuple[HeldOut, ...]
    blocks: Labels
    dimension: float
    settings: Settings


def describe(model: Model, which: int, rng: np.random.Generator) -> Finding:
    """Judge one effect with all the others in the model.

    Parameters
    ----------
    model : Model
        Outcome of the search.
    which : int
        Which of its effects.
    rng : numpy.random.Generator
        For the resamples.
    """
    entered = model.effects[which]
    candidate = entered.hypothesis.candidate
    others, ranked = _in_its_place(model, which)
    own = ranked[0]
    members = indistinguishable(ranked, model.dimension, model.settings)
    scale = float(background(own.remaining, model.dimension))
    fitted = estimate(model.evidence, others, own.hypothesis, scale)
    names = [p.name for p in candidate.parameters] + [p.name for p in candidate.shape]
    before, after = model.stages[which], model.stages[which + 1]
    return Finding(
        tuple((m.hypothesis.candidate.effect, m.hypothesis.candidate.component) for m in members),
        {
            name: (float(value), float(error))
            for name, value, error in zip(names, fitted.values, fitted.uncertainty, strict=True)
        },
        float(np.linalg.norm(after.white) / np.linalg.norm(before.white)),
        own.score,
        entered.p_value,
        _stability(model, others, ranked, {m.name for m in members}, rng),
        {q.key: bought(before, after, q) for q in model.evidence.observations.reported},
        candidate.compensable,
        _told(own),
        candidate.check,
    )


def _in_its_place(model: Model, which: int) -> tuple[Base, list[Ranked]]:
    """Return the rest of the model, and the effect ahead of all that could stand in its place."""
    entered = model.effects[which]
    others = base_with(model.evidence.base, model.effects[:which] + model.effects[which + 1 :])
    rivals = rivals_of(model.evidence, model.catalogue, model.effects, which, model.dimension)
    hypotheses = [entered.hypothesis, *(r.hypothesis for r in rivals if r.name != entered.name)]
    ranked = scored(others, hypotheses, model.dimension, model.evidence.noise.dof)
    own = next(each for each in ranked if each.hypothesis is entered.hypothesis)
    return others, [own, *(each for each in ranked if each is not own)]


def with_values(finding: Finding, values: Array) -> Finding:
    """Return the finding with corrected linear parameters, their uncertainty in proportion.

    Parameters
    ----------
    finding : Finding
        As fitted.
    values : (k,) array
        Corrected linear parameters; shape parameters stay.
    """
    corrected = dict(finding.parameters)
    for (name, (old, error)), value in zip(finding.parameters.items(), values, strict=False):
        growth = max(1.0, abs(value / old)) if old else 1.0
        corrected[name] = (float(value), error * growth)
    return replace(finding, parameters=corrected)


def _stability(
    model: Model,
    others: Base,
    ranked: list[Ranked],
    members: set[str],
    rng: np.random.Generator,
) -> float:
    """Share of block resamples that choose a member of the class."""
    first: dict[str, Ranked] = {}
    for each in ranked:
        first.setdefault(each.name, each)
    best = list(first.values())
    grams = BlockGrams(others, [each.hypothesis for each in best], model.blocks)
    inside = np.array([name in members for name in first])
    return stability(grams, inside, np.array([each.price for each in best]), rng)


def _told(own: Ranked) -> str:
    """One sentence for a technician."""
    candidate = own.hypothesis.candidate
    misfit = own.remaining / (own.remaining + own.gain)
    sentence = candidate.evidence or f"{candidate.effect} at {candidate.component}"
    sentence += (
        f": where it was fitted it explains {100 * (1 - misfit):.1f} % of what the rest of the "
        "model leaves above the noise"
    )
    if misfit > 0:
        sentence += f"; what remains is {100 * np.sqrt(misfit):.0f} % of its size"
    return sentence
