"""The true wrist on the fast path: base elasticity and hidden laws, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium, Pose
from wrist_stiffness.simulation.heat import HeatNetwork
from wrist_stiffness.simulation.laws.law import Law, no_screws

SWEEPS = 4
"""Passes in which histories (creep, friction) and equilibrium find each other."""


@dataclass(frozen=True)
class TrueState:
    """What truly happened in a block of n samples.

    Parameters
    ----------
    block : Block
        Angles, load, temperatures.
    equilibrium : Equilibrium
        Forces and slides inside the wrist.
    rotation : (n, 3, 3) float
        U -> F of the platform.
    shift : (n, 3) float
        Position of the platform's point O in F [m].
    """

    block: Block
    equilibrium: Equilibrium
    rotation: Array
    shift: Array


class TrueWrist:
    """A wrist with hidden laws.

    Parameters
    ----------
    table : Table
        The elastic base.
    laws : sequence of Law
        What departs from it.
    """

    def __init__(self, table: Table, laws: Sequence[Law]) -> None:
        self._mechanism = table.mechanism
        self._laws = laws
        self._heat = HeatNetwork()
        self.parts, self.gravity = table.components, table.geometry.gravity
        for law in laws:
            self.parts, self.gravity = law.parts(self.parts), law.gravity(self.gravity)

    def run(self, time_s: Array, shaft: Array, load: Array, room: Array) -> TrueState:
        """Advance through a block.

        Parameters
        ----------
        time_s : (n,) float
            Increasing times [s].
        shaft : (n, 2) float
            Motor angles that error-free encoders would show [rad].
        load : (n, 6) float
            Wrench on the platform at O in F [N, N m].
        room : (n,) float
            Temperature of the room above the reference [K].

        Returns
        -------
        TrueState
            Of the block.
        """
        angles = shaft + sum((law.turn(time_s, shaft) for law in self._laws), np.zeros_like(shaft))
        configuration = self._mechanism.forward(angles)
        pose = Pose(configuration, self.parts, self.gravity)
        kelvin = self._heat.run(time_s, angles, room)
        block = Block(time_s, configuration, load, pose.flexibility, kelvin)
        state = self._equilibrium(block, pose)
        twist = state.twist + sum((law.twist(block, state) for law in self._laws), np.zeros(6))
        bent, shift = exp_twist(twist)
        return TrueState(block, state, bent @ configuration.platform, shift)

    def _equilibrium(self, block: Block, pose: Pose) -> Equilibrium:
        load = block.load + sum((law.wrench(block) for law in self._laws), np.zeros(6))
        screws = no_screws(block) + sum(law.screws(block) for law in self._laws)
        bends = [
            (ELASTIC.index(law.bends), partial(law.bend, block))
            for law in self._laws
            if law.bends is not None
        ]
        flowing = [law for law in self._laws if law.flows is not None]
        rubbing = [law for law in self._laws if law.rubs is not None]
        state = pose.solve(load, screws, bends)
        if not flowing and not rubbing:
            return state
        acting = np.zeros((len(rubbing), len(block.time_s), 2))
        for sweep in range(SWEEPS):
            last = sweep == SWEEPS - 1
            moved = screws.copy()
            for law in flowing:
                k = ELASTIC.index(law.flows or "")
                moved[:, k] += law.flow(block, state.through[:, k], last)
            friction = np.zeros((len(block.time_s), len(PASSIVE_JOINTS), 2))
            for i, law in enumerate(rubbing):
                acting[i] = law.rub(block, pose, state, acting[i], last)
                friction[:, PASSIVE_JOINTS.index(law.rubs or "")] += acting[i]
            state = pose.solve(load, moved, bends, pose.friction_wrench(friction))
        return state
