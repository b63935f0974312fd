"""Lost motion of a drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.model.columns import Recipe, at_usual_size
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.memory import play
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation


class Backlash(Law):
    """The output follows the motor through a gap.

    After a motion longer than the full width w it lies w/2 behind; while the motor crosses the gap
    after a reversal the output rests.  It starts in the middle.
    """

    id = "backlash"
    stage = "geometry"
    places = MOTORS
    sentence = "{place} has lost motion: its output lies behind on the side it came from"
    check = "approach one angle from both sides; feel the output's free play with the motor held"
    excited_by = "the same poses approached from both sides"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the full width."""
        return (Parameter("width_mdeg", 0.0, 5000.0, 20.0, linear=False),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return the column of a usual width: motions are longer than that."""
        (width,) = self.parameters(place)
        return at_usual_size(width, width.scale)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return output minus motor as a turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        start = angle[0] if state is None else state
        output = play(angle, 0.5 * values["width_mdeg"], start)
        return at.motor_turn(place, output - angle), output[-1]
