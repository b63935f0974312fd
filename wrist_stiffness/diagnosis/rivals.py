"""Classes: effects that these data cannot tell apart."""

from wrist_stiffness.diagnosis.ranking import Ranked
from wrist_stiffness.diagnosis.settings import Settings
from wrist_stiffness.diagnosis.structure import background

DECISIVE = 6.0
"""Twice the logarithm of a Bayes factor that counts as strong (Kass, Raftery 1995)."""

MISFIT_RATIO = 2.0
"""A rival may leave this much more structure than the best one, if both laws are inexact."""


def indistinguishable(ranked: list[Ranked], dimension: float, settings: Settings) -> list[Ranked]:
    """List the best candidate and all that explain the observations about as well.

    Against noise alone a rival falls behind by the usual criterion.  Where even the best leaves
    structure, no law is exact: then a rival stays as long as what it leaves is of the size that
    an inexact law leaves.

    Parameters
    ----------
    ranked : list of Ranked
        Candidates for this place, best first.
    dimension : float
        Independent chances of structure.
    settings : Settings
        Accuracy of laws.
    """
    best = ranked[0]
    scale = float(background(best.remaining, dimension))
    inexact = min(settings.law_accuracy**2 * best.gain, MISFIT_RATIO * best.remaining)
    tolerance = DECISIVE + inexact / scale
    members: dict[str, Ranked] = {}
    for each in ranked:
        if best.score - each.score <= tolerance:
            members.setdefault(each.name, each)
    return list(members.values())
