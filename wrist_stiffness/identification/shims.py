"""Whoever fits a wrist shims its flanges: axes that miss the centre leave the gaps at home alone.

So gaps follow the axes in a fit, and only what is beyond that is a parameter of its own.  Without
it a fit of the axes would open and close flanges all over the workspace.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.evaluation import situation_of
from wrist_stiffness.sessions.refitted import AXES, GAPS

GAP = "gap_um"

UM = 1e6


@dataclass(frozen=True, eq=False)
class Shims:
    """How the axes open the flanges at home."""

    # by axis effect: its parameter, a joint, and how far that one's flanges open for a unit of the
    # parameter [m, m/rad]
    opening: Mapping[str, tuple[tuple[str, str, float], ...]]

    @classmethod
    def of(cls, model: ErrorModel, effects: Sequence[Effect]) -> Shims:
        """Return the shims for those of some effects that are axes, linear as they are."""
        home = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
        at = situation_of(model.with_effects(), home, None)
        component = at.parts.sectors.component
        opening = {}
        for effect in (effect for effect in effects if effect.law.id == AXES):
            slopes = []
            for key in effect.si:
                unit = {other: float(other == key) for other in effect.si}
                added, _ = effect.law.advance(at, effect.component, unit, None)
                gap: Array = at.carried(added)[1][0]
                for k in np.unique(component):
                    slopes.append((key, ELASTIC[k], float(gap[component == k].mean())))
            opening[effect.name] = tuple(slopes)
        return cls(opening)

    def move_with(self, effect: Effect) -> bool:
        """Tell whether a change of an effect changes what `gaps` says."""
        return effect.name in self.opening or effect.law.id == GAPS

    def gaps(self, start: Sequence[Effect], found: Sequence[Effect]) -> dict[int, float]:
        """Return the gaps of found effects when they follow the axes from where these started.

        Returns `gap_um` by the place of the effect that has it.
        """
        opened: dict[str, float] = {}
        for before, after in zip(start, found, strict=True):
            for key, joint, slope in self.opening.get(after.name, ()):
                change = slope * (after.si[key] - before.si[key])
                opened[joint] = opened.get(joint, 0.0) + change
        gaps = {}
        for place, effect in enumerate(found):
            if effect.law.id == GAPS and effect.component in opened:
                (own,) = effect.parameters
                gap = effect.estimates[GAP].value - UM * opened[effect.component]
                gaps[place] = min(max(gap, own.lower), own.upper)
        return gaps
