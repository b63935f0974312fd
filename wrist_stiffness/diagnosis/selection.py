"""Which effects enter: forward while chance cannot explain the best, then only what must stay.

Forward steps ask one question, is there anything: the best candidate against what the best of all
candidates would show by chance.  What stays is decided at the end, with every rival in the model:
an effect must stand out from the structure that is still unexplained, and a small one next to a
large one must do more than mop up what the large one's law leaves: with enough columns it could
do that down to the noise.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from wrist_stiffness.diagnosis.hypotheses import Evidence, Hypothesis, addition, refined
from wrist_stiffness.diagnosis.permutation import rearranged_residuals
from wrist_stiffness.diagnosis.projection import Base
from wrist_stiffness.diagnosis.ranking import Ranked, chance_of_best, rank
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.structure import lack_of_fit

SWAP_ROUNDS = 3

CONTENDING_SHARE = 0.5
"""A better shape rarely doubles what a candidate explains at a point of its grid."""

CONTENDERS = 3
"""So many candidates get their shape refined before one is chosen."""


@dataclass(frozen=True, eq=False)
class Entered:
    """An effect in the model.

    Parameters
    ----------
    hypothesis : Hypothesis
        Effect and shape.
    p_value : float
        Probability that chance would have shown as much, when it entered.
    """

    hypothesis: Hypothesis
    p_value: float

    @property
    def name(self) -> str:
        """Effect and place."""
        return self.hypothesis.candidate.name


def base_with(base: Base, effects: tuple[Entered, ...]) -> Base:
    """Return the base with effects in it."""
    if not effects:
        return base
    return base.extended(np.hstack([each.hypothesis.columns for each in effects]))


def select(
    evidence: Evidence,
    hypotheses: list[Hypothesis],
    dimension: float,
    settings: Settings,
    rng: np.random.Generator,
) -> tuple[Entered, ...]:
    """Return the effects that a search of the catalogue leaves in the model.

    Parameters
    ----------
    evidence : Evidence
        Table, noise and base.
    hypotheses : list of Hypothesis
        The catalogue at the points of its grids.
    dimension : float
        From `effective_dimension`.
    settings : Settings
        Thresholds.
    rng : numpy.random.Generator
        For the permutations.
    """
    entered: tuple[Entered, ...] = ()
    while len(entered) < settings.most_findings:
        base = base_with(evidence.base, entered)
        ranked = _contest(evidence, base, _others(hypotheses, entered), dimension)
        if not ranked:
            break
        groups = evidence.observations.exchangeable
        rearranged = rearranged_residuals(base, groups, settings.permutations, rng)
        chance = chance_of_best(base, ranked, rearranged)
        if chance > settings.alpha:
            break
        entered = (*entered, Entered(ranked[0].hypothesis, chance))
        entered = _swapped(evidence, hypotheses, entered, dimension)
    return _pruned(evidence, hypotheses, entered, dimension, settings)


def rivals_of(
    evidence: Evidence,
    hypotheses: list[Hypothesis],
    entered: tuple[Entered, ...],
    which: int,
    dimension: float,
) -> list[Ranked]:
    """Everything that could stand in the place of one effect, best first, itself included."""
    others = entered[:which] + entered[which + 1 :]
    base = base_with(evidence.base, others)
    free = [*_others(hypotheses, others), entered[which].hypothesis]
    ranked = rank(base, free, dimension, evidence.noise.dof)
    return _sharpened(evidence, base, free, ranked, dimension)


def _contest(
    evidence: Evidence, base: Base, hypotheses: list[Hypothesis], dimension: float
) -> list[Ranked]:
    """Rank, with shapes refined unless the best one without a shape reaches the noise floor."""
    ranked = rank(base, hypotheses, dimension, evidence.noise.dof)
    if ranked and ranked[0].remaining == 0 and not ranked[0].hypothesis.candidate.shape:
        return ranked
    return _sharpened(evidence, base, hypotheses, ranked, dimension)


def _sharpened(
    evidence: Evidence,
    base: Base,
    hypotheses: list[Hypothesis],
    ranked: list[Ranked],
    dimension: float,
) -> list[Ranked]:
    """Rank again after the best contenders with a shape have had it refined."""
    contenders: dict[str, Hypothesis] = {}
    for each in ranked:
        near = each.gain > CONTENDING_SHARE * ranked[0].gain
        if each.hypothesis.candidate.shape and near and len(contenders) < CONTENDERS:
            contenders.setdefault(each.name, each.hypothesis)
    if not contenders:
        return ranked
    finer = [refined(evidence, each, base) for each in contenders.values()]
    return rank(base, [*hypotheses, *finer], dimension, evidence.noise.dof)


def _others(hypotheses: list[Hypothesis], entered: tuple[Entered, ...]) -> list[Hypothesis]:
    """Return what can still enter: of all that were fitted alone, one at most."""
    taken = {each.name for each in entered}
    alone = any(each.hypothesis.candidate.fitted for each in entered)
    return [
        each
        for each in hypotheses
        if each.candidate.name not in taken and not (alone and each.candidate.fitted)
    ]


def _swapped(
    evidence: Evidence,
    hypotheses: list[Hypothesis],
    entered: tuple[Entered, ...],
    dimension: float,
) -> tuple[Entered, ...]:
    """Give every effect's place to the best candidate, now that the others are known."""
    for _ in range(SWAP_ROUNDS):
        before = [each.name for each in entered]
        for which in range(len(entered)):
            others = entered[:which] + entered[which + 1 :]
            free = [*_others(hypotheses, others), entered[which].hypothesis]
            ranked = _contest(evidence, base_with(evidence.base, others), free, dimension)
            if ranked:
                better = replace(entered[which], hypothesis=ranked[0].hypothesis)
                entered = (*entered[:which], better, *entered[which + 1 :])
        if [each.name for each in entered] == before:
            break
    return entered


def marginal_gains(base: Base, entered: tuple[Entered, ...]) -> list[tuple[float, int]]:
    """Tell what each effect explains beyond all the others, and with how many directions."""
    gains = []
    for which in range(len(entered)):
        others = base_with(base, entered[:which] + entered[which + 1 :])
        added = addition(others, entered[which].hypothesis)
        gains.append((added.gain, added.directions.shape[1]))
    return gains


def _pruned(
    evidence: Evidence,
    hypotheses: list[Hypothesis],
    entered: tuple[Entered, ...],
    dimension: float,
    settings: Settings,
) -> tuple[Entered, ...]:
    """Drop the weakest effect until each one left has reason to stay."""
    while entered:
        full = base_with(evidence.base, entered)
        remaining = lack_of_fit(full.energy, full.freedom, evidence.noise.dof).energy
        gains = marginal_gains(evidence.base, entered)
        explained = evidence.base.energy - full.energy
        weakest = int(np.argmin([gain for gain, _ in gains]))
        gain, size = gains[weakest]
        mops_up = gain < settings.law_accuracy**2 * explained
        if not mops_up and _stands_out(gain, size, remaining, dimension, settings):
            break
        entered = entered[:weakest] + entered[weakest + 1 :]
        entered = _swapped(evidence, hypotheses, entered, dimension)
    return entered


def _stands_out(
    gain: float, size: int, remaining: float, dimension: float, settings: Settings
) -> bool:
    """Whether a gain stands out from the structure that is left."""
    if remaining == 0:
        return True
    spare = max(dimension - size, 2.0)
    ratio = (gain / max(size, 1)) / (1 + remaining / spare)
    return bool(fdtrc(size, spare, ratio) < settings.alpha)
