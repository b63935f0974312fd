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
from wrist_stiffness.simulation.block import Block, joined
from wrist_stiffness.simulation.equilibrium import Equilibrium, Pose
from wrist_stiffness.simulation.heat import HeatNetwork
from wrist_stiffness.simulation.laws.law import Bending, Flowing, Law, Rubbing, no_screws

MAX_SWEEPS = 20
"""Passes in which histories (creep, friction) and equilibrium find each other."""

MAX_SWEEPS_OF_ONE = 400
"""The same for a sample on its own."""

RUBBING_BLOCK = 64
"""Samples in a row that find their friction together."""

LEAST_SHARE, LARGEST_SHARE = 0.02, 5.0
"""Of a step of friction or creep."""

LONGEST_BELIEVED = 8
"""Halvings in a row towards the same bound."""

SWEEP_TOLERANCE = 1e-10
"""Largest change of the platform's twist in the last pass, up to `TWIST_SCALE` [m, rad]."""

TWIST_SCALE = 1e-3


@dataclass(frozen=True)
class TrueState:
    """What truly happened in a block of n samples."""

    block: Block  # angles, load, temperatures
    equilibrium: Equilibrium  # forces and slides inside the wrist
    rotation: Array  # (n, 3, 3), U -> F of the platform
    shift: Array  # (n, 3), position of the platform's point O in F [m]


class TrueWrist:
    """A wrist with hidden laws."""

    def __init__(self, table: Table, laws: Sequence[Law]) -> None:
        self._mechanism = table.mechanism
        self._laws = laws
        self._heat = HeatNetwork()
        self.parts, self.gravity = table.components, table.geometry.gravity
        for law in laws:
            self.parts, self.gravity = law.parts(self.parts), law.gravity(self.gravity)

    def run(self, time_s: Array, shaft: Array, load: Array, room: Array) -> TrueState:
        """Advance through a block.

        `time_s` (n,): increasing times [s]; `shaft` (n, 2): motor angles that error-free encoders
        would show [rad]; `load` (n, 6): wrench on the platform at O in F [N, N m]; `room` (n,):
        temperature of the room above the reference [K].
        """
        angles = shaft + sum((law.turn(time_s, shaft) for law in self._laws), np.zeros_like(shaft))
        return self.at(time_s, angles, load, self._heat.run(time_s, angles, room))

    def at(self, time_s: Array, angles: Array, load: Array, kelvin: Array) -> TrueState:
        """Advance through a block whose true angles and temperatures are known.

        `time_s` (n,): increasing times [s]; `angles` (n, 2): True angles of the driven links [rad];
        `load` (n, 6): wrench on the platform at O in F [N, N m]; `kelvin` (n, 7): temperatures of
        `heat.HEATED` above the reference [K].
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
        rubbing = any(isinstance(law, Rubbing) for law in self._laws)
        size = RUBBING_BLOCK if rubbing else len(block.time_s)
        parts: list[Equilibrium] = []
        for first in range(0, len(block.time_s), size):
            parts += self._settled(block, pose, load, screws, slice(first, first + size))
        return joined(parts)

    def _settled(
        self, block: Block, pose: Pose, load: Array, screws: Array, rows: slice
    ) -> list[Equilibrium]:
        """Return the equilibria of some of the samples, one after another."""
        few, n = block[rows], len(block.time_s[rows])
        # The operators of a part are made again: that is cheap beside one pass.
        own = pose if n == len(block.time_s) else Pose(few.configuration, self.parts, self.gravity)
        state = self._passes(few, own, load[rows], screws[rows])
        if state is not None:
            return [state]
        if n == 1:
            raise InputError(
                f"true wrist: creep or friction found no equilibrium in {MAX_SWEEPS_OF_ONE} passes "
                f"at {few.time_s[0]:.3f} s"
            )
        # A sample can settle only after the one before it: shorter rows take fewer passes.
        middle = rows.start + n // 2
        halves = slice(rows.start, middle), slice(middle, rows.start + n)
        return [each for half in halves for each in self._settled(block, pose, load, screws, half)]

    def _passes(self, block: Block, pose: Pose, load: Array, screws: Array) -> Equilibrium | None:
        """Return the equilibrium with the histories of creep and friction, None if not found."""
        bends = [
            (ELASTIC.index(law.component), partial(law.bend, block))
            for law in self._laws
            if isinstance(law, Bending)
        ]
        state = pose.solve(load, screws, bends)
        rubbing = [law for law in self._laws if isinstance(law, Rubbing)]
        if not rubbing and not any(isinstance(law, Flowing) for law in self._laws):
            return state
        moved, acting = screws, np.zeros((len(rubbing), len(block.time_s), 2))
        along, across = _Steps(moved), _Steps(acting)
        for _ in range(MAX_SWEEPS if len(block.time_s) > 1 else MAX_SWEEPS_OF_ONE):
            before = state
            give = pose.give(state, bends) if rubbing else np.zeros(0)
            new_moved, new_acting = self._histories(block, give, state, screws, acting, False)
            moved, acting = along.towards(moved, new_moved), across.towards(acting, new_acting)
            friction = np.zeros((len(block.time_s), len(PASSIVE_JOINTS), 2))
            for law, force in zip(rubbing, acting, strict=True):
                friction[:, PASSIVE_JOINTS.index(law.component)] += force
            state = pose.solve(load, moved, bends, pose.friction_wrench(friction), state)
            # What whole steps would have changed.
            share = np.minimum(
                along.share.min(axis=(1, 2)), across.share.min(axis=(0, 2), initial=1.0)
            )
            change = np.max(np.abs(state.twist - before.twist) / share[:, None])
            if change <= SWEEP_TOLERANCE * max(1.0, np.max(np.abs(state.twist)) / TWIST_SCALE):
                self._histories(block, give, state, screws, acting, True)
                return state
        return None

    def _histories(
        self,
        block: Block,
        give: Array,
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
            if isinstance(law, Flowing):
                k = ELASTIC.index(law.component)
                moved[:, k] += law.flow(block, state.through[:, k], remember)
            if isinstance(law, Rubbing):
                rubbed.append(law.rub(block, give, state, acting[len(rubbed)], remember))
        return moved, np.reshape(rubbed, acting.shape)


class _Steps:
    """Steps of numbers that look for themselves, each by its own secant and inside its own bounds.

    Pins with play and flanges that hold what friction pushes make whole steps jump to and fro, or
    crawl.
    """

    def __init__(self, like: Array) -> None:
        self.share = np.ones_like(like)
        self._step, self._moved = np.zeros_like(like), np.zeros_like(like)
        self._low, self._high = np.full_like(like, -np.inf), np.full_like(like, np.inf)
        self._halved = np.zeros(like.shape, dtype=int)

    def towards(self, now: Array, wanted: Array) -> Array:
        """Return numbers nearer to those that are wanted."""
        step = wanted - now
        with np.errstate(invalid="ignore", divide="ignore"):
            secant = self._moved / (self._step - step)
        known = np.isfinite(secant) & (secant > 0.0)
        share = np.where(known, np.clip(secant, LEAST_SHARE, LARGEST_SHARE), 1.0)
        out = now + share * step
        self._low = np.where(step > 0.0, now, self._low)
        self._high = np.where(step < 0.0, now, self._high)
        # Neighbours move what was too much before: a bound is not believed for long.
        old = (self._low >= self._high) | (self._halved >= LONGEST_BELIEVED)
        self._low = np.where(old & (step < 0.0), -np.inf, self._low)
        self._high = np.where(old & (step > 0.0), np.inf, self._high)
        beyond = ((out >= self._high) & (step > 0.0)) | ((out <= self._low) & (step < 0.0))
        self._halved = np.where(beyond, self._halved + 1, 0)
        with np.errstate(invalid="ignore"):
            out = np.where(beyond, 0.5 * (self._low + self._high), out)
            share = np.abs(out - now) / np.abs(step)
        self.share = np.where(step == 0.0, 1.0, np.clip(share, LEAST_SHARE, LARGEST_SHARE))
        self._step, self._moved = step, out - now
        return np.asarray(out)
