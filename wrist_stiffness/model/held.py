"""What an effect added to a block, held as it was while others change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law, Outcome, SIValues
from wrist_stiffness.model.situation import Situation

FIELDS = [field.name for field in fields(Contribution) if field.name != "rubbing"]


class HeldLaw(Law):
    """Adds to the samples of a block what an effect added to them.

    `added`: that, chunk by chunk; what its friction may hold besides is left out.
    """

    own = ()

    def __init__(self, effect: Effect, added: Sequence[Contribution]) -> None:
        self.id, self.places, self.stage = effect.law.id, (effect.component,), effect.stage
        self._added: dict[str, Any] = {}
        for name in FIELDS:
            parts = [getattr(each, name) for each in added]
            if any(part is not None for part in parts):
                self._added[name] = np.concatenate(parts)

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return what was added to these samples; the state counts those before."""
        begun = state or 0
        end = begun + len(at.block)
        return Contribution(**{name: v[begun:end] for name, v in self._added.items()}), end
