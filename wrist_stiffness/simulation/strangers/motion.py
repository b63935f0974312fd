"""Strangers of motion and time.

A tool rings or spins, a pin floats on its oil or sinks in it; something bows or works loose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot
from wrist_stiffness.simulation.block import Block, Past, rates
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import (
    JOINED,
    Bending,
    Flowing,
    Law,
    at_component,
    no_screws,
)
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
        self._past: Past | None = None

    def screws(self, block: Block) -> Array:
        """Lift by the speed of the joint's turn."""
        inner, outer = JOINED[self._joint]
        bodies = block.configuration.rotations
        relative = np.swapaxes(bodies[inner], -1, -2) @ bodies[outer]
        trace = np.einsum("nii->n", relative)
        turn = np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))
        rate, self._past = rates(block.time_s, turn, self._past)
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
        self._past: Past | None = None

    def wrench(self, block: Block) -> Array:
        """Return what the rotor does to the platform while its axis turns."""
        now = block.configuration.platform @ self._momentum
        rate, self._past = rates(block.time_s, now, self._past)
        return np.concatenate([np.zeros_like(rate), -rate], axis=-1)


@dataclass(frozen=True)
class ThermalBow(Law):
    """The frame bows by the square of the difference in temperature between its two motors."""

    twist_per_kelvin: Array  # (6,), of the platform at a difference of 1 K [m, rad]

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Move the platform with the frame."""
        kelvin = block.temperature_of("motor_1") - block.temperature_of("motor_2")
        return (kelvin * np.abs(kelvin))[:, None] * self.twist_per_kelvin


class LooseningScrew(Bending):
    """A link's clamp screw works loose: its end gets softer with all that the motors have moved.

    The gears shake it, and it never tightens again.

    `flexibility` (6, 6): of the open clamp, at O with the wrist at home [m/N, rad/N, rad/(N m)];
    `path`: sum of both motors' motion after which 63 % of it are there [rad].
    """

    def __init__(self, link: str, flexibility: Array, path: float) -> None:
        self.component, self._flexibility, self._path = link, flexibility, path
        self._past: tuple[float, Array] | None = None
        self._loose = np.zeros(0), np.zeros(0)

    def screws(self, block: Block) -> Array:
        """Count what the motors move."""
        theta = block.configuration.theta
        so_far, past = self._past or (0.0, theta[0])
        moved = so_far + np.cumsum(np.abs(np.diff(theta, axis=0, prepend=past[None])).sum(axis=1))
        self._past = float(moved[-1]), theta[-1]
        self._loose = block.time_s, -np.expm1(-moved / self._path)
        return no_screws(block)

    def bend(self, block: Block, wrench: Array) -> tuple[Array, Array]:
        """Give way to the wrench, as loose as the screw is by now."""
        turn = block_diagonal(block.rotation(self.component))
        loose = np.interp(block.time_s, *self._loose)[:, None, None]
        soft = loose * (turn @ self._flexibility @ np.swapaxes(turn, -1, -2))
        return (soft @ wrench[..., None])[..., 0], soft


class SqueezeFilm(Flowing):
    """A passive joint's pin sinks along its radial force while at rest; turning centres it again.

    The force squeezes the lubricant out of the gap, the faster the larger it is.

    `joint`: passive joint; `gap`: radial gap, the farthest that the pin sinks [m]; `time_s`: time
    constant of sinking under 1 N [s]; `turn`: turn of the joint that draws 63 % of the lubricant in
    again [rad].
    """

    def __init__(self, joint: str, seat: Seat, gap: float, time_s: float, turn: float) -> None:
        self.component, self._seat, self._gap = joint, seat, gap
        self._time_s, self._turn = time_s, turn
        self._past: tuple[float, float, Array] | None = None

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Sink by time and force, rise by turn."""
        to_origin = self._seat.to_origin(block.rotation(self.component))
        across = np.eye(3) - np.outer(self._seat.axis, self._seat.axis)
        force = np.einsum("nji,nj->ni", to_origin, wrench)[:, :3] @ across
        size = np.sqrt(np.sum(force * force, axis=-1))
        wall = self._gap * force / np.maximum(size, 1e-12)[:, None]
        turn = joint_turn(block, self.component, self._seat.axis)
        # It was turned before the start.
        before, angle, sunk = self._past or (block.time_s[0], turn[0], np.zeros(3))
        out = np.zeros_like(wrench)
        for i, now in enumerate(block.time_s):
            sunk = sunk * np.exp(-abs(turn[i] - angle) / self._turn)
            sunk = wall[i] + (sunk - wall[i]) * np.exp(-size[i] * (now - before) / self._time_s)
            before, angle = now, turn[i]
            out[i, :3] = sunk
        if remember:
            self._past = float(before), float(angle), sunk
        return np.einsum("nij,nj->ni", to_origin, out)
