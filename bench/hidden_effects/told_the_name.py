"""What naming is worth: the project's `extend`, told the true names.

Where this does not come to the floor either, no better search would: the law of the catalogue, the
fit or two minutes of data are what is missing.
"""

from __future__ import annotations

from bench_wrist import wrist
from cases import REGISTRATIONS
from dictionary import Dictionary
from observe import Riddle
from own_diagnosis import predicted
from solvers import Answer, nothing

from wrist_stiffness.identification.extension import extend
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.registry import find_law


def told_the_name(riddle: Riddle, words: Dictionary | None = None) -> Answer:
    """Add what hides, by effect and place alone, to the wrist as it was on the first day.

    Asked are one effect of the catalogue and two.
    """
    if riddle.case.kind not in ("single", "double"):
        return nothing(riddle)
    names = [f"{hidden.effect}@{hidden.component}" for hidden in riddle.hidden]
    sessions = [riddle.days[0].read]
    known = ErrorModel("benchmark", wrist(), "closed_form")
    for name in names:
        law, _, place = name.partition("@")
        model = extend(known, Effect(find_law(law), place), sessions).model
        # A recording is no knowledge twice.
        known = model.with_effects(*(each for each in model.effects if each.name in names))
    # Where the sensors stood on the first day is not of the wrist.
    lasting = model.with_effects(*(e for e in model.effects if e.law.id not in REGISTRATIONS))
    one, two = (predicted(lasting, day) for day in riddle.days)
    return Answer("effect", tuple((name,) for name in names), (one, two))
