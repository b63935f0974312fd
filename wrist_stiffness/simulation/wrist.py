"""The true wrist on the fast path: base elasticity and hidden laws, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.simulation.block import Block
from wrist_stiffness.simulation.equilibrium import Equilibrium, Pose
from wrist_stiffness.simulation.heat import HeatNetwork
from wrist_stiffness.simulation.laws.law import Law, no_screws

MAX_SWEEPS = 80
"""Passes in which histories (creep, friction) and equilibrium find each other."""

FULL_SWEEPS = 15
"""Passes after which the steps are halved."""

SWEEP_TOLERANCE = 1e-11
"""Largest change of the platform's twist in the last pass, up to `TWIST_SCALE` [m, rad]."""

TWIST_SCALE = 1e-3


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
        return self.at(time_s, angles, load, self._heat.run(time_s, angles, room))

    def at(self, time_s: Array, angles: Array, load: Array, kelvin: Array) -> TrueState:
        """Advance through a block whose true angles and temperatures are known.

        Parameters
        ----------
        time_s : (n,) float
            Increasing times [s].
        angles : (n, 2) float
            True angles of the driven links [rad].
        load : (n, 6) float
            Wrench on the platform at O in F [N, N m].
        kelvin : (n, 7) float
            Temperatures of `heat.HEATED` above the reference [K].

        Returns
        -------
        TrueState
            Of the block.
        """
        configuration = self._mechanism.forward(angles)
        pose = Pose(configuration, self.parts, self.gravity)
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
        state = pose.solve(load, screws, bends)
        rubbing = [law for law in self._laws if law.rubs is not None]
        if not rubbing and all(law.flows is None for law in self._laws):
            return state
        moved, acting = screws, np.zeros((len(rubbing), len(block.time_s), 2))
        for sweep in range(MAX_SWEEPS):
            before = state
            new_moved, new_acting = self._histories(block, pose, state, screws, acting, False)
            # Flanges that hold what friction pushes can make full steps jump to and fro.
            share = 1.0 if sweep < FULL_SWEEPS else 0.5
            moved = moved + share * (new_moved - moved)
            acting = acting + share * (new_acting - acting)
            friction = np.zeros((len(block.time_s), len(PASSIVE_JOINTS), 2))
            for law, force in zip(rubbing, acting, strict=True):
                friction[:, PASSIVE_JOINTS.index(law.rubs or "")] += force
            state = pose.solve(load, moved, bends, pose.friction_wrench(friction))
            change = np.max(np.abs(state.twist - before.twist))
            if change <= SWEEP_TOLERANCE * max(1.0, np.max(np.abs(state.twist)) / TWIST_SCALE):
                self._histories(block, pose, state, screws, acting, True)
                return state
        raise InputError(
            f"true wrist: creep or friction found no equilibrium in {MAX_SWEEPS} passes; the "
            f"last changed the platform's twist by {change:.1e}"
        )

    def _histories(
        self,
        block: Block,
        pose: Pose,
        state: Equilibrium,
        screws: Array,
        acting: Array,
        remember: bool,
    ) -> tuple[Array, Array]:
        """Return screws (n, 8, 6) and friction (laws, n, 2) after the history that led to `state`.

        `acting` (laws, n, 2) is the friction under which the state was found.
        """
        moved = screws.copy()
        rubbed: list[Array] = []
        for law in self._laws:
            if law.flows is not None:
                k = ELASTIC.index(law.flows)
                moved[:, k] += law.flow(block, state.through[:, k], remember)
            if law.rubs is not None:
                rubbed.append(law.rub(block, pose, state, acting[len(rubbed)], remember))
        return moved, np.reshape(rubbed, acting.shape)
