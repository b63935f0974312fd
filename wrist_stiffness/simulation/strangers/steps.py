"""Strangers that jump: a seat with two places, a part that yields, a sensor with two heads."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium
from wrist_stiffness.simulation.laws.law import Flowing, Law


class _Switch:
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
        self._switch = _Switch(threshold)

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


class HeadChange(Law):
    """The tracker sees the target with one of two heads, which do not quite agree.

    `twist` (6,): of the second head against the first [m, rad]; `side` (3,): direction in F to
    which the platform's normal leans when the second takes over; `normal` (3,): platform's normal
    in U.
    """

    def __init__(self, twist: Array, side: Array, normal: Array) -> None:
        self._twist, self._side, self._normal = twist, side, normal
        self._switch = _Switch(0.05)

    def read_pose(self, block: Block, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Move the pose where the second head looks."""
        second = self._switch((rotation @ self._normal) @ self._side)
        turn, move = exp_twist(second[:, None] * self._twist)
        return turn @ rotation, (turn @ shift[..., None])[..., 0] + move
