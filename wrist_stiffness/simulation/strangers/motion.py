"""Strangers that come with motion: a tool that rings or spins, a pin that floats on its oil."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross, dot
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import JOINED, Law, at_component
from wrist_stiffness.simulation.seat import Seat


class Resonance(Law):
    """The tool lags behind fast moves and rings after them, as a weakly damped oscillator does.

    `share`: how much of the oscillator's motion reaches the target [-]; `place` (3,): centre of
    gravity of what swings, in U [m]; `frequency_hz`, `damping`: natural frequency and damping
    ratio.
    """

    def __init__(self, share: float, place: Array, frequency_hz: float, damping: float) -> None:
        self._share, self._place = share, place
        w = 2.0 * np.pi * frequency_hz
        # State: lag and its rate; driven by where the body is, with a linear input in each step.
        self._system = np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]])
        self._force = np.array([0.0, w * w])
        self._state: tuple[float, Array, Array] | None = None
        self._steps: dict[float, tuple[Array, Array, Array]] = {}

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Shift and tilt the platform by the lag of its centre of gravity."""
        at = block.configuration.platform @ self._place
        before, past, z = (block.time_s[0], at[0], np.stack([at[0], np.zeros(3)]))
        if self._state is not None:
            before, past, z = self._state
        lag = np.empty_like(at)
        for i, now in enumerate(block.time_s):
            if now > before:
                free, old, new = self._step(round(float(now - before), 9))
                z = free @ z + np.outer(old, past) + np.outer(new, at[i])
            lag[i] = z[0] - at[i]
            before, past = now, at[i]
        self._state = before, past, z
        shift = self._share * lag
        lever = cross(at, shift) / dot(at, at)[:, None]
        return np.concatenate([shift, lever], axis=-1)

    def _step(self, dt: float) -> tuple[Array, Array, Array]:
        if dt not in self._steps:
            # The augmented exponential gives the integrals of constant and linear inputs.
            system = np.zeros((4, 4))
            system[:2, :2], system[:2, 2], system[2, 3] = self._system, self._force, 1.0
            grown = expm(system * dt)
            constant, linear = grown[:2, 2], grown[:2, 3] / dt
            self._steps = {dt: (grown[:2, :2], constant - linear, linear)}
        return self._steps[dt]


class OilFilm(Law):
    """A turning pin floats up on its lubricant, away from the groove that feeds it.

    `joint`: passive joint; `lift` (3,): greatest lift, across the axis with the wrist at home [m];
    `speed`: turning speed at which three quarters of it are there [rad/s].
    """

    def __init__(self, joint: str, seat: Seat, lift: Array, speed: float) -> None:
        self._joint, self._seat, self._lift, self._speed = joint, seat, lift, speed
        self._past: tuple[float, float] | None = None

    def screws(self, block: Block) -> Array:
        """Lift by the speed of the joint's turn."""
        inner, outer = JOINED[self._joint]
        bodies = block.configuration.rotations
        relative = np.swapaxes(bodies[inner], -1, -2) @ bodies[outer]
        trace = np.einsum("nii->n", relative)
        turn = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
        before, past = (block.time_s[0], turn[0]) if self._past is None else self._past
        steps = np.diff(block.time_s, prepend=before)
        moved = np.diff(turn, prepend=past)
        rate = np.divide(moved, steps, out=np.zeros_like(moved), where=steps > 0.0)
        self._past = float(block.time_s[-1]), float(turn[-1])
        home = np.concatenate([self._lift, np.zeros(3)])
        screw = self._seat.to_origin(block.rotation(self._joint)) @ home
        return at_component(
            block, self._joint, np.tanh(np.abs(rate) / self._speed)[:, None] * screw
        )


class SpinningTool(Law):
    """The platform feels a gyroscopic moment: by the speed of its tilting, and across it.

    A spindle in the tool runs steadily; turning its angular momentum takes a moment.

    `momentum` (3,): angular momentum of the rotor, in U [kg m^2/s].
    """

    def __init__(self, momentum: Array) -> None:
        self._momentum = momentum
        self._past: tuple[float, Array] | None = None

    def wrench(self, block: Block) -> Array:
        """Return what the rotor does to the platform while its axis turns."""
        now = block.configuration.platform @ self._momentum
        before, past = (block.time_s[0], now[0]) if self._past is None else self._past
        steps = np.diff(block.time_s, prepend=before)[:, None]
        change = np.diff(now, axis=0, prepend=past[None])
        self._past = float(block.time_s[-1]), now[-1]
        rate = np.divide(change, steps, out=np.zeros_like(change), where=steps > 0.0)
        return np.concatenate([np.zeros_like(rate), -rate], axis=-1)
