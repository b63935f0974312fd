"""Which candidate explains most beyond the base, for what it costs."""

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.diagnosis.estimates import possible
from wrist_stiffness.diagnosis.hypotheses import Addition, Hypothesis, addition
from wrist_stiffness.diagnosis.observations import Array
from wrist_stiffness.diagnosis.projection import Base
from wrist_stiffness.diagnosis.structure import background, lack_of_fit
from wrist_stiffness.diagnosis.worth import worth_along


@dataclass(frozen=True, eq=False)
class Ranked:
    """One hypothesis against one base.

    Parameters
    ----------
    hypothesis : Hypothesis
        The effect.
    directions : (N, r) array
        What it adds to the base.
    gain : float
        Sum of squares that it explains.
    remaining : float
        Excess over the noise floor with it in the model.
    score : float
        Evidence against the base, in units of the background: larger is better.
    price : float
        What the effect's freedom costs, in sums of squares.
    """

    hypothesis: Hypothesis
    directions: Array
    gain: float
    remaining: float
    score: float
    price: float

    @property
    def name(self) -> str:
        """Effect and place."""
        return self.hypothesis.candidate.name


def scored(
    base: Base,
    hypotheses: list[Hypothesis],
    dimension: float,
    noise_dof: float,
) -> list[Ranked]:
    """Score every hypothesis that adds something, best first.

    Parameters
    ----------
    base : Base
        What is refitted first.
    hypotheses : list of Hypothesis
        The catalogue.
    dimension : float
        Independent chances of structure.
    noise_dof : float
        Degrees of freedom of the noise floor.
    """
    found = []
    for hypothesis in hypotheses:
        added = addition(base, hypothesis)
        directions, gain = added.directions, added.gain
        if directions.shape[1]:
            freedom = base.freedom - directions.shape[1]
            remaining = lack_of_fit(base.energy - gain, freedom, noise_dof).energy
            found.append((hypothesis, directions, gain, remaining))
    if not found:
        return []
    scale = float(background(min(entry[3] for entry in found), dimension))
    scores = [evidence_of(base, entry[0], entry[2], scale) for entry in found]
    ranked = [
        Ranked(*entry, score, entry[2] - scale * score)
        for entry, score in zip(found, scores, strict=True)
    ]
    return sorted(ranked, key=lambda each: -each.score)


def evidence_of(base: Base, hypothesis: Hypothesis, gain: float, scale: float = 1.0) -> float:
    """Return what a hypothesis explains, less what its freedom costs, in units of the background.

    Parameters
    ----------
    base : Base
        What is refitted first.
    hypothesis : Hypothesis
        The effect.
    gain : float
        Sum of squares that it explains.
    scale : float
        Variance of the background.
    """
    price = float(np.log(base.freedom))
    added = addition(base, hypothesis)
    if added.sized is None:
        candidate = hypothesis.candidate
        return (gain - candidate.strain) / scale - candidate.freedom * price
    own = float(worth_along(added.moment, added.sized[1], scale))
    return own - len(hypothesis.candidate.shape) * price


def rank(
    base: Base,
    hypotheses: list[Hypothesis],
    dimension: float,
    noise_dof: float,
) -> list[Ranked]:
    """Score as `scored` does, without those whose estimates are physically impossible."""
    ranked = scored(base, hypotheses, dimension, noise_dof)
    if not ranked:
        return []
    scale = float(background(min(each.remaining for each in ranked), dimension))
    return [each for each in ranked if possible(base, each.hypothesis, scale)]


def chance_of_best(base: Base, ranked: list[Ranked], rearranged: Array) -> float:
    """Probability that the best of all candidates looks this good by chance (max-statistic).

    Parameters
    ----------
    base : Base
        What is refitted first.
    ranked : list of Ranked
        The catalogue against this base, the one in question first.
    rearranged : (N, repeats) array
        From `rearranged_residuals`.
    """
    everything = np.column_stack([base.residual, rearranged])
    energy = np.sum(everything**2, axis=0)
    added = [addition(base, each.hypothesis) for each in ranked]
    # All columns at once: each hypothesis by itself has too few to keep the processor busy.
    parts = [[each.directions, *(each.sized or ())[:1]] for each in added]
    moments = np.hstack([columns for part in parts for columns in part]).T @ everything
    own, by_chance = 0.0, np.full(rearranged.shape[1], -np.inf)
    start = 0
    for number, (each, part) in enumerate(zip(added, parts, strict=True)):
        found = []
        for columns in part:
            found.append(moments[start : start + columns.shape[1]])
            start += columns.shape[1]
        scores = _scores(base, each, found[0], found[-1], energy)
        own = scores[0] if number == 0 else own
        by_chance = np.maximum(by_chance, scores[1:])
    return float((1 + np.sum(by_chance >= own)) / (1 + len(by_chance)))


def _scores(base: Base, added: Addition, along: Array, moment: Array, energy: Array) -> Array:
    """Score one hypothesis as the ranking does, on many residuals, (q,).

    The variance is what it leaves of each: with a large effect in it, chance is large as well.

    Parameters
    ----------
    base : Base
        What is refitted first.
    added : Addition
        The hypothesis against it.
    along, moment : (r, q) and (k, q) arrays
        Product of its directions, and of those at usual sizes, with each residual.
    energy : (q,) array
        Sum of squares of each residual, the measured one first.
    """
    gain = np.sum(along**2, axis=0)
    left = base.freedom - len(along)
    variance = np.maximum(energy - gain, 1e-12 * energy) / max(left, 1)
    price = float(np.log(base.freedom))
    candidate = added.hypothesis.candidate
    if added.sized is None:
        # What a fit relieved the priors of is evidence, and no rearranged residual did that.
        relieved = np.zeros(len(energy))
        relieved[0] = -candidate.strain
        return np.asarray((gain + relieved) / variance - candidate.freedom * price)
    return worth_along(moment, added.sized[1], variance) - len(candidate.shape) * price
