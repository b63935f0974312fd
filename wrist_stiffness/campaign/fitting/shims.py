"""Whoever fits a wrist shims its flanges: axes that miss the centre leave the gaps at home alone.

So gaps follow the axes in a fit, and only what is beyond that is a parameter of its own.  Without
it a fit of the axes would open and close flanges all over the workspace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.evaluation import situation_of

AXES, GAPS, GAP = "axis_misalignment", "flange_contact", "gap_um"

UM = 1e6


@dataclass(frozen=True, eq=False)
class Shims:
    """How the axes open the flanges at home.

    Parameters
    ----------
    opening : dict of (str, str, str) to float
        Opening of a joint's flanges for a parameter of an axis, by axis effect, parameter and joint
        [m, m/rad].
    """

    opening: dict[tuple[str, str, str], float]

    @classmethod
    def of(cls, model: ErrorModel, effects: Sequence[Effect]) -> Shims:
        """Return the shims for those of some effects that are axes, linear as they are."""
        home = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
        at = situation_of(model.with_effects(), home, None)
        component = at.parts.sectors.component
        opening = {}
        for effect in effects:
            for key in effect.si if effect.law.id == AXES else ():
                unit = {other: float(other == key) for other in effect.si}
                added, _ = effect.law.advance(at, effect.component, unit, None)
                gap: Array = at.carried(added)[1][0]
                for k in np.unique(component):
                    opening[effect.name, key, ELASTIC[k]] = float(gap[component == k].mean())
        return cls(opening)

    def fitted(self, start: Sequence[Effect], found: Sequence[Effect]) -> tuple[Effect, ...]:
        """Return the found effects with gaps that follow the axes from where they started."""
        opened: dict[str, float] = {}
        for before, after in zip(start, found, strict=True):
            for (name, key, joint), slope in self.opening.items():
                if name == after.name:
                    change = slope * (after.si[key] - before.si[key])
                    opened[joint] = opened.get(joint, 0.0) + change
        return tuple(_closed(effect, opened) for effect in found)


def _closed(effect: Effect, opened: dict[str, float]) -> Effect:
    if effect.law.id != GAPS or effect.component not in opened:
        return effect
    (parameter,) = effect.parameters
    gap = effect.estimates[GAP].value - UM * opened[effect.component]
    return effect.with_values({GAP: min(max(gap, parameter.lower), parameter.upper)})
