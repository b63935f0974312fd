"""Who has not looked at the residuals: suspects what usually does most in such an experiment."""

from __future__ import annotations

import numpy as np
from bench_wrist import wrist
from dictionary import Dictionary
from observe import Riddle
from solvers import Answer, nothing

from wrist_stiffness.campaign.searching.base_fit import fit_base
from wrist_stiffness.campaign.searching.candidates import wrist_candidates
from wrist_stiffness.campaign.searching.contributions import Decomposed
from wrist_stiffness.campaign.searching.place import point_of
from wrist_stiffness.campaign.unit_session import as_units
from wrist_stiffness.model.error_model import ErrorModel


def usual_sizes(riddle: Riddle, words: Dictionary) -> Answer:
    """Name nothing; order effects by what the usual size of each would do to the first day.

    The measured poses serve for the registration alone.  It shows how much of a rank correlation
    is knowledge of what wrists are like, which is assumed, and how much the data add.
    """
    model = ErrorModel("benchmark", wrist(), "closed_form")
    base = fit_base(model, (as_units(model, riddle.days[0].read),))
    whole = Decomposed(base)
    usual = {
        name: base.columns[:, :, places] for name in whole.names if (places := whole.places(name))
    }
    for each in wrist_candidates(point_of(base), usual):
        usual[each.name] = each.at(each.shapes[len(each.shapes) // 2]) * each.usual
    lengths = {name: np.linalg.norm(base.whiten(whole.beyond(c))) for name, c in usual.items()}
    silent = nothing(riddle)
    return Answer("none", (), silent.explained, (), {n: float(s) for n, s in lengths.items()})
