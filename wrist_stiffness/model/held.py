"""What an effect did at a block, held as it was while others change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law, Outcome, SIValues
from wrist_stiffness.model.situation import Situation

FIELDS = [field.name for field in fields(Contribution) if field.name != "rubbing"]


class HeldLaw(Law):
    """Adds what another effect added, whatever the others do."""

    own = ()

    def __init__(self, effect: Effect, added: Contribution) -> None:
        self.id, self.places, self.stage = effect.law.id, (effect.component,), effect.stage
        self._added = added

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return what was added to these samples; the state counts those before."""
        begun = state or 0
        end = begun + len(at.block)
        every = ((name, getattr(self._added, name)) for name in FIELDS)
        return Contribution(**{n: v[begun:end] for n, v in every if v is not None}), end


def held(effect: Effect, chunks: Sequence[Contribution], mean: Callable[[Array], Array]) -> Effect:
    """Return an effect as it was in the mean over units.

    `chunks`: what it added at the moments of a session, one after the other; `mean`: turns values
    at the moments to means over the units.  What else its friction holds is left out.
    """
    found = {}
    for name in FIELDS:
        parts = [getattr(each, name) for each in chunks]
        if any(part is not None for part in parts):
            found[name] = mean(np.concatenate(parts))
    return Effect(HeldLaw(effect, Contribution(**found)), effect.component)
