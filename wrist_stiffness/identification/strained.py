"""Whether a wrist is within its tolerances as a whole, and what to measure first where it is not.

Each tolerance may lie within two standard deviations while all of them together cannot: a load
scale that is far off pulls at every axis.  The most probable values of a sound wrist scatter about
the drawing by what the drawing allows, as far as the data tell it: one chi-square of all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from wrist_stiffness.identification.problem import FitProblem
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.refitted import TOLERATED

KNOWN = 0.1
"""Least share of a prior variance that data must take away of a combination for it to count."""

RARE = 0.01
"""Probability below which a sound wrist is so far off: one of a hundred is told in error."""


@dataclass(frozen=True)
class Strain:
    """How far all tolerances together are from the drawing."""

    square: float  # chi-square of what the data know of them
    freedom: int  # combinations of tolerances that they know
    # probability that a wrist within its tolerances is as far off, in all or in any one of them
    chance: float
    first: str  # `law@place parameter` whose tolerance, given up, explains most
    # what that parameter is then, in the unit of its name, and in its tolerances
    value: float
    times: float
    rest: float  # chi-square that is left then

    @property
    def rare(self) -> bool:
        """Whether hardly any wrist within its tolerances is as far off."""
        return self.chance < RARE

    @property
    def how(self) -> str:
        """How far off all of them are."""
        return f"chi-square {self.square:.0f} where {self.freedom} is usual"

    @property
    def sentence(self) -> str:
        """What it says of the wrist; empty where it is within its tolerances."""
        if not self.rare:
            return ""
        text = (
            f"The wrist is outside its tolerances ({self.how}). Measure {self.first} first: "
            f"{self.value:.3g}, {abs(self.times):.1f} times its tolerance"
        )
        if chdtrc(max(self.freedom - 1, 1), self.rest) > RARE:
            return f"{text}; with that all others are within theirs."
        return f"{text}; that does not explain all of it (chi-square {self.rest:.0f} is left)."


def strain(fit: WristFit) -> Strain | None:
    """Return how far the tolerances of a fit are from the drawing; None where it has none.

    `fit`: with set-up and tolerances.
    """
    base, found = fit.base, fit.evidence
    problem, point = base.problem, found.point
    effects = [each.effect for each in problem.unknowns]
    at = np.array(
        [
            place
            for place, effect in enumerate(effects)
            if base.of_base[place]
            and effect.law.id in TOLERATED
            and np.isfinite(base.prior_std[place])
        ],
        dtype=np.intp,
    )
    if not len(at):
        return None
    weight = point.weight[at]
    z = weight * (point.z[at] + found.step[at])
    left = found.covariance[np.ix_(at, at)] * np.outer(weight, weight)
    # What the data tell of a wrist and of noise: a fit holds both to its prior.
    told = np.eye(len(at)) - left
    scatter = told @ _as_drawn(problem, at) @ told + left - left @ left
    sizes, vectors = np.linalg.eigh(scatter)
    known = sizes > KNOWN
    square = float(np.sum((vectors[:, known].T @ z) ** 2 / sizes[known]))
    freedom = int(np.count_nonzero(known))
    # Without its prior a tolerance would go as far as the data ask for.
    gains = np.where(np.diag(told) > KNOWN, z**2 / np.maximum(np.diag(scatter), KNOWN), 0.0)
    far = int(np.argmax(gains))
    unknown = problem.unknowns[at[far]]
    times = float(z[far] / told[far, far])
    alone = len(at) * chdtrc(1, gains[far])
    return Strain(
        square,
        freedom,
        float(min(2.0 * min(chdtrc(freedom, square), alone), 1.0)),
        f"{unknown.effect.name} {unknown.key}",
        unknown.value(times / float(weight[far])),
        times,
        square - float(gains[far]),
    )


def _as_drawn(problem: FitProblem, at: NDArray[np.intp]) -> Array:
    """Return the covariance of some unknowns over wrists within their tolerances, in steps."""
    found = np.eye(len(at))
    unknowns = [problem.unknowns[place] for place in at]
    for name in {each.effect.name for each in unknowns}:
        own = {each.key: n for n, each in enumerate(unknowns) if each.effect.name == name}
        effect = unknowns[next(iter(own.values()))].effect
        keys = [parameter.key for parameter in effect.parameters]
        kept = [n for n, key in enumerate(keys) if key in own]
        places = [own[keys[n]] for n in kept]
        drawn = effect.law.as_drawn(problem.model.table.geometry, effect.component)
        found[np.ix_(places, places)] = drawn[np.ix_(kept, kept)]
    return found
