"""Strangers that are somewhere, or jump there.

A seat has two places, a part yields; an overload ring touches, a prism is met at an angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal, cross, dot
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import Flowing, Law


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


class LooseSeat(Law):
    """The tool's seat has two places; a moment beyond a threshold throws it into the other.

    `jump` (6,): twist between the two, in U [m, rad]; `lever` (3,): direction of the moment in U
    that throws it; `threshold` [N m].
    """

    def __init__(self, jump: Array, lever: Array, threshold: float) -> None:
        self._jump, self._lever = jump, lever
        self._switch = Switch(threshold)

    def twist(self, block: Block, state: Equilibrium) -> Array:
        """Move the platform to the place of the moment's history."""
        platform = block.configuration.platform
        moment = np.einsum("nji,nj->ni", platform, block.load[:, 3:]) @ self._lever
        thrown = self._switch(moment)
        return thrown[:, None] * (block_diagonal(platform) @ self._jump)


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
class OverloadRing(Law):
    """The load sensor reads too little of a side force beyond a limit: its overload ring touches.

    Chips fill most of the gap; what then goes through the ring goes past the strain gauges.
    """

    share: float  # of the side force beyond the limit that goes through the ring [-]
    normal: Array  # (3,), platform's normal in U; side forces are across it
    centre: Array  # (3,), of the ring, in U [m]
    limit: float  # side force at which it touches [N]

    def read_load(self, block: Block, wrench: Array) -> Array:
        """Take away what goes through the ring."""
        platform = block.configuration.platform
        normal, at = platform @ self.normal, platform @ self.centre
        force = wrench[:, :3]
        side = force - dot(force, normal)[:, None] * normal
        size = np.maximum(np.sqrt(dot(side, side)), self.limit)
        past = (self.share * (1.0 - self.limit / size))[:, None] * side
        return wrench - np.concatenate([past, cross(at, past)], axis=-1)


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
