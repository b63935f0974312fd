"""What these data could have shown at all, asked before anything is ranked."""

import numpy as np

from wrist_stiffness.diagnosis.hypotheses import Hypothesis, addition
from wrist_stiffness.diagnosis.projection import Base

DETECTABLE = 3.0
"""Norm in standard deviations that an effect of plausible size must leave beyond the base."""


def strength(base: Base, hypothesis: Hypothesis) -> float:
    """Whitened norm that an effect of plausible size leaves beyond the base.

    Zero if the base imitates it entirely; infinite if it does not and no size is plausible.
    """
    sizes = [p.plausible for p in hypothesis.candidate.parameters]
    added = addition(base, hypothesis)
    if added.directions.shape[1] == 0:
        return 0.0
    if any(size is None for size in sizes):
        return np.inf
    scaled = added.beyond * np.array(sizes, dtype=np.float64)
    return float(np.linalg.norm(scaled, 2))


def excited(base: Base, hypotheses: list[Hypothesis]) -> tuple[list[Hypothesis], list[str]]:
    """Split the catalogue into what the data could show and what they could not.

    Parameters
    ----------
    base : Base
        What is refitted first.
    hypotheses : list of Hypothesis
        The catalogue at the points of its grids.

    Returns
    -------
    list of Hypothesis
        Those worth testing.
    list of str
        Names of the candidates that no point of their grid excites.
    """
    testable = [each for each in hypotheses if strength(base, each) >= DETECTABLE]
    alive = {each.candidate.name for each in testable}
    silent = dict.fromkeys(
        each.candidate.name for each in hypotheses if each.candidate.name not in alive
    )
    return testable, list(silent)
