"""Strangers with a history of their own, and a prism that is met at an angle.

A tool rings or spins, a clamp works loose, a pin sinks into its grease, a part yields.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot
from wrist_stiffness.simulation.block import Block, Rate
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.joint_friction import joint_turn
from wrist_stiffness.simulation.laws.law import Bending, Flowing, Law, no_screws
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


class SpinningTool(Law):
    """The platform feels a gyroscopic moment: by the speed of its tilting, and across it.

    A spindle in the tool runs steadily; turning its angular momentum takes a moment.

    `momentum` (3,): angular momentum of the rotor, in U [kg m^2/s].
    """

    def __init__(self, momentum: Array) -> None:
        self._momentum, self._rate = momentum, Rate()

    def wrench(self, block: Block) -> Array:
        """Return what the rotor does to the platform while its axis turns."""
        rate = self._rate(block.time_s, block.configuration.platform @ self._momentum)
        return np.concatenate([np.zeros_like(rate), -rate], axis=-1)


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


class Switch:
    """Two states; it changes where a signal leaves a band, and remembers."""

    def __init__(self, band: float) -> None:
        self._band, self._on = band, False

    def __call__(self, signal: Array) -> Array:
        """Return the state (n,) as 0 or 1 for a signal (n,)."""
        out = np.empty(len(signal))
        for i, value in enumerate(signal):
            if abs(value) > self._band:
                self._on = bool(value > 0.0)
            out[i] = self._on
        return out


class PlasticSet(Flowing):
    """A part yields a little whenever a load is larger than all before, and stays bent.

    `direction` (6,): of screw and wrench at O with the wrist at home; unit in force.  `per_newton`:
    set per force beyond the yield point [m/N].  `yielding`: yield point [N].
    """

    def __init__(
        self, component: str, direction: Array, per_newton: float, yielding: float
    ) -> None:
        self.component = component
        self._direction, self._per_newton = direction, per_newton
        self._worst = np.full(2, yielding)
        self._yielding = yielding

    def flow(self, block: Block, wrench: Array, remember: bool) -> Array:
        """Set grows with the largest load so far, to each side on its own."""
        turn = block_diagonal(block.rotation(self.component))
        load = np.einsum("nji,nj->ni", turn, wrench) @ self._direction
        both = np.stack([load, -load], axis=-1)
        worst = np.maximum(np.maximum.accumulate(both, axis=0), self._worst)
        bent = self._per_newton * ((worst - self._yielding) @ np.array([1.0, -1.0]))
        if remember:
            self._worst = worst[-1]
        return bent[:, None] * (turn @ self._direction)


@dataclass(frozen=True)
class PrismIncidence(Law):
    """The tracker's position is off along its beam, by the angle at which that meets the prism.

    Light that enters the glass at an angle takes another way than its distance constant says:
    depth * (n - sqrt(n^2 - sin^2 angle)) too short, as the prism turns with the platform.
    """

    depth: float  # of the glass that the sensor's settings leave out [m]
    beam: Array  # (3,), direction in F from target to sensor, unit vector
    face: Array  # (3,), normal of the prism's face in U, unit vector

    GLASS = 1.52
    """Refractive index of the prism, n."""

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move the target towards the sensor."""
        sine_2 = 1.0 - ((rotation @ self.face) @ self.beam) ** 2
        short = self.depth * (self.GLASS - np.sqrt(self.GLASS**2 - sine_2))
        return rotation, shift + short[:, None] * self.beam
