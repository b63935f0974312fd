"""Motors that stand elsewhere than their encoders say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.columns import Carried, Recipe, Shape, at_usual_size, tangents
from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.memory import play
from wrist_stiffness.model.parameters import Parameter, symmetric


class EncoderOffset(Law):
    """The motor stands at the encoder's angle plus a constant."""

    id = "encoder_offset"
    stage = "geometry"
    places = MOTORS
    sentence = "the zero of {place}'s encoder is off"
    check = "drive to the reference mark or a gauge block and compare"
    excited_by = "poses all over the workspace"
    constant = True
    inexactness = 0.0
    own = (symmetric("offset_mdeg", 5000.0, 100.0),)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the turn."""
        return at.motor_turn(place, np.full(len(at.block), values["offset_mdeg"]))


class EncoderEccentricity(Law):
    """True angle minus the encoder's: waves once and twice per turn."""

    id = "encoder_eccentricity"
    stage = "geometry"
    places = MOTORS
    sentence = "the encoder disc of {place} runs out of true: an error once (twice) per turn"
    check = "compare the encoder over a full turn with a polygon or an autocollimator"
    excited_by = "the whole travel of the motor"
    inexactness = 0.03
    own = tuple(
        symmetric(f"{wave}_{order}_mdeg", 5000.0, 50.0)
        for order in (1, 2)
        for wave in ("cos", "sin")
    )

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        waves = [
            _wave(values, f"cos_{order}_mdeg", f"sin_{order}_mdeg", order * angle)
            for order in (1, 2)
        ]
        return at.motor_turn(place, sum(waves, np.zeros_like(angle)))


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
    own = (Parameter("width_mdeg", 0.0, 5000.0, 20.0, linear=False),)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return the column of a usual width: motions are longer than that."""
        (width,) = self.own
        return at_usual_size(width, width.scale)

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return output minus motor as a turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        output = play(angle, 0.5 * values["width_mdeg"], state)
        return at.motor_turn(place, output - angle), output[-1]


HARMONICS = (1, 2, 3)

RUN_OUT = ("run_out_cos_percent", "run_out_sin_percent")

ORDERS = tuple(3.0 + 1.2 * i for i in range(40))
"""Waves a turn that are tried first (assumed): a search goes on between two of them."""


def amplitudes(harmonic: int) -> tuple[str, str]:
    """Return the names of the cosine and sine amplitudes of a harmonic."""
    which = "" if harmonic == 1 else f"_{harmonic}"
    return f"cos{which}_mdeg", f"sin{which}_mdeg"


class TransmissionError(Law):
    """Output minus motor: a wave of an order found from the data, with two harmonics.

    A mesh that is not sinusoidal has harmonics; a wheel that runs out of true meshes deeper on one
    side, which raises and lowers all of them once per turn (sidebands).
    """

    id = "transmission_error"
    stage = "geometry"
    places = MOTORS
    sentence = "the gear of {place} runs unevenly: a wave many times per turn"
    check = "count the teeth; see whether the order fits a tooth mesh or a strain-wave generator"
    excited_by = "slow sweeps of the motor, several samples within a wave"
    many_waves = True
    own = (
        *(symmetric(key, 5000.0, 10.0) for n in HARMONICS for key in amplitudes(n)),
        Parameter("order", 3.0, 500.0, 50.0, mean=10.0, linear=False, grid=ORDERS),
        *(Parameter(key, -100.0, 100.0, 10.0, linear=False) for key in RUN_OUT),
    )

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return columns of the waves on a grid of orders; the run-out is found by a fit."""

        def turns(at: Shape, block: Block) -> Array:
            angle = block.theta[:, MOTORS.index(place)]
            phases = [harmonic * at[0] * angle for harmonic in HARMONICS]
            return np.stack([wave(p) for p in phases for wave in (np.cos, np.sin)], axis=-1)

        carried = Carried("encoder_offset", {"offset_mdeg": 1.0}, turns)
        return replace(tangents(self.own, held=RUN_OUT), carried=carried)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        waves = [
            _wave(values, *amplitudes(harmonic), harmonic * values["order"] * angle)
            for harmonic in HARMONICS
        ]
        run_out = _wave(values, *RUN_OUT, angle)
        return at.motor_turn(place, (1.0 + run_out) * sum(waves, np.zeros_like(angle)))


def _wave(values: SIValues, cosine: str, sine: str, phase: Array) -> Array:
    return values[cosine] * np.cos(phase) + values[sine] * np.sin(phase)
