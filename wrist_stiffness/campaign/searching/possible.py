"""What else a fitted wrist may have: the likeliest shares of effects in what nothing explains.

Where a little of everything is wrong, many effects are there of which none can be proven.  Each is
expected to be of its usual size; what was measured says how much of it, much where it would show,
little where the base or another effect can imitate it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wrist_stiffness.campaign.searching.base_fit import BaseFit
from wrist_stiffness.campaign.searching.candidates import WristCandidate
from wrist_stiffness.campaign.searching.contributions import (
    Contribution,
    Decomposed,
    contribution,
    root_of,
)
from wrist_stiffness.campaign.searching.place import point_of
from wrist_stiffness.campaign.searching.screening import Screen


def possible(fitted: BaseFit, catalogue: Sequence[WristCandidate]) -> tuple[Contribution, ...]:
    """Return what each effect that a fitted wrist does not have may add.

    All at once and to first order, with Gaussian priors of the usual size (Bayesian linear
    regression, Bishop 2006, section 3.3).  What laws leave that are not exact counts as noise.

    Parameters
    ----------
    fitted : BaseFit
        The base along with everything that was found or is suspected.
    catalogue : sequence of WristCandidate
        With columns.

    Returns
    -------
    tuple of Contribution
        Of kind `possible`.
    """
    whole = Decomposed(fitted)
    absent = [each for each in catalogue if each.name not in whole.names]
    if not absent:
        return ()
    screen = Screen(fitted, point_of(fitted), variance=max(1.0, fitted.variance))
    names, usual = [], []
    for _, each, shape in screen.leaders(absent):
        names.append(each.name)
        usual.append(each.at(shape) * each.usual)
    rows = screen.white(np.concatenate(usual, axis=2))
    covariance = np.asarray(np.linalg.inv(rows.T @ rows + np.eye(rows.shape[1])))
    mean = covariance @ (rows.T @ screen.left)
    found, end = [], 0
    for name, columns in zip(names, usual, strict=True):
        own = slice(end, end := end + columns.shape[2])
        beyond = whole.beyond(columns)
        spread = beyond @ root_of(covariance[own, own])
        found.append(contribution(fitted, name, "possible", beyond @ mean[own], spread))
    return tuple(found)
