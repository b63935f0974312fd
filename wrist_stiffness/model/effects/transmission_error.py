"""A gear that does not run evenly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.columns import Carried, Recipe, Shape, tangents
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter, symmetric
from wrist_stiffness.model.situation import Situation

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
    check = "count the teeth: does the order fit a tooth mesh or a strain-wave generator?"
    excited_by = "slow sweeps of the motor, several samples within a wave"
    many_waves = True

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the amplitudes, the order, and how far they vary once per turn."""
        waves = (symmetric(key, 5000.0, 10.0) for n in HARMONICS for key in amplitudes(n))
        return (
            *waves,
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
        return replace(tangents(self.parameters(place), held=RUN_OUT), carried=carried)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the turn."""
        angle = at.block.theta[:, MOTORS.index(place)]
        turn = np.zeros_like(angle)
        for harmonic in HARMONICS:
            cosine, sine = amplitudes(harmonic)
            phase = harmonic * values["order"] * angle
            turn += values[cosine] * np.cos(phase) + values[sine] * np.sin(phase)
        run_out = values[RUN_OUT[0]] * np.cos(angle) + values[RUN_OUT[1]] * np.sin(angle)
        return at.motor_turn(place, (1.0 + run_out) * turn), None
