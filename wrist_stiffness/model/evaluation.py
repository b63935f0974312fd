"""Evaluate a model over a block: stage after stage, then contact once with everything in it.

0 <= lambda  perpendicular to  g0 + B' W + sum_k N_k delta_k + A lambda >= 0
xi = C W + sum_k G_k delta_k + B lambda
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.compiled import CompiledWrist
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contacts
from wrist_stiffness.mechanism.vectors import both_halves
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.block_statics import BlockStatics
from wrist_stiffness.model.contribution import NOTHING, Contribution
from wrist_stiffness.model.prediction import seen
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.stages import (
    NO_GUESSES,
    Guesses,
    Memory,
    Staged,
    staged,
    with_speeds,
)

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel


@dataclass(frozen=True, eq=False)
class Evaluated:
    """Result of an evaluation of n samples."""

    staged: Staged  # what the effects did
    twist: Array  # (n, 6), pose error of the platform, first order in every screw [m, rad]
    force: Array  # (n, m), contact forces [N]
    active: NDArray[np.bool_]  # (n, m), contact state

    @property
    def situation(self) -> Situation:
        """With all that the effects added."""
        return self.staged.last

    @property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each effect added; nothing for constant ones."""
        return tuple(NOTHING if each is None else each.added for each in self.staged.advanced)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Effects without their signals, and effects past first order."""
        return self.staged.warnings

    @property
    def memory(self) -> Memory:
        """What is left for the next block."""
        return self.staged.memory(self.active)

    @cached_property
    def measured(self) -> Array:
        """What the pose sensor says of the twist, composed exactly, (n, 6) [m, rad]."""
        return seen(self.twist, *self.situation.sensor)


def evaluate(
    model: ErrorModel,
    block: Block,
    memory: Memory | None,
    pose: Configuration | None = None,
    near: Guesses = NO_GUESSES,
) -> Evaluated:
    """Evaluate a model over a block.

    `block`: n > 0 samples inside the table's domain and load range; `memory`: what the block before
    left, None at the start; `pose`: the configuration of a block of one sample, where it is known;
    `near`: where effects whose states are guesses ended at this block before, by their names.
    Gives `Evaluated`: for n samples.
    """
    guess = None if memory is None else memory.active
    start = situation_of(model, with_speeds(block, memory), guess, pose)
    found = staged(model, start, memory, near=near)
    return Evaluated(found, *found.last.answer)


def evaluate_beside(
    models: Sequence[ErrorModel], memories: Sequence[Memory | None], like: Evaluated
) -> list[Evaluated]:
    """Evaluate further models over the block of one that was evaluated.

    What they have in common with it is not computed again, and flange contact is solved for all
    models with the same elastic parts together.

    `models`: with the same table; `memories`: what the block before left of each; `like`: the first
    model.
    """
    every = [
        staged(model, _start(model, like), memory, like.staged)
        for model, memory in zip(models, memories, strict=True)
    ]
    statics = like.situation.statics
    if like.situation.wrist is not None:
        return [Evaluated(each, *each.last.answer) for each in every]
    alike = [each for each in every if each.last.statics is statics]
    together = iter(_settled_alike([each.last for each in alike], like) if alike else ())
    return [
        Evaluated(each, *(next(together) if each.last.statics is statics else each.last.answer))
        for each in every
    ]


def _start(model: ErrorModel, like: Evaluated) -> Situation:
    """Return the situation in which a model begins beside another one."""
    start = like.staged.situations[0]
    wrist = None if start.wrist is None else _wrist(model, start.wrist[1])
    if start.parts is not model.parts:
        statics = start.statics.with_parts(model.parts)
        return Situation(statics, model.constants, guess=like.active, wrist=wrist)
    if start.constants is not model.constants:
        return replace(start, constants=model.constants, guess=like.active, wrist=wrist)
    return start


def situation_of(
    model: ErrorModel,
    block: Block,
    guess: NDArray[np.bool_] | None,
    pose: Configuration | None = None,
) -> Situation:
    """Return a block at its configurations, before any effect that is not constant."""
    configuration = model.table.mechanism.forward(block.theta) if pose is None else pose.as_block
    load = block.load
    if block.load_on_platform:
        load = both_halves(configuration.platform, load)
    statics = BlockStatics(block, load, configuration, model.evaluation, model.table, model.parts)
    wrist = None if pose is None else _wrist(model, pose)
    return Situation(statics, model.constants, guess=guess, wrist=wrist)


def _wrist(model: ErrorModel, pose: Configuration) -> tuple[CompiledWrist, Configuration] | None:
    return None if model.compiled is None else (model.compiled, pose)


def _settled_alike(
    every: Sequence[Situation], like: Evaluated
) -> list[tuple[Array, Array, NDArray[np.bool_]]]:
    """Return the same of situations with the same statics as another one."""
    operators = like.situation.operators
    free = [at.free for at in every]
    gaps = np.stack([gap for _, gap in free], axis=1)
    force, active = solve_contacts(operators.approach, gaps, like.active[:, None])
    pushed = force @ np.swapaxes(operators.force_twist, -1, -2)
    return [(twist + pushed[:, t], force[:, t], active[:, t]) for t, (twist, _) in enumerate(free)]


def seen_by(results: Sequence[Evaluated]) -> Array:
    """Return what the pose sensor says of t results at the same n samples, (t, n, 6) [m, rad]."""
    twist = np.stack([each.twist for each in results])
    left, right = zip(*(each.situation.sensor for each in results), strict=True)
    return seen(twist, _stacked(left), _stacked(right))


def _stacked(sides: Sequence[Array | None]) -> Array | None:
    """Stack (n, 6), (6,) or nothing of each result to (t, n or 1, 6)."""
    if all(side is None for side in sides):
        return None
    rows = [np.zeros((1, 6)) if side is None else np.atleast_2d(side) for side in sides]
    return np.stack(np.broadcast_arrays(*rows))
