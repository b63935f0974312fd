"""Carry a model's effects through the stages at a block: what each one sees, adds and remembers.

Models at one block often share effects.  What an effect did is taken over where the other one saw
the same thing: the same object, with the same state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import is_
from pathlib import Path
from traceback import extract_tb
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.block_statics import BlockStatics
from wrist_stiffness.model.contribution import (
    LEFT_OUT,
    NOTHING,
    Constants,
    Contribution,
    MissingSignalError,
)
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import STAGES
from wrist_stiffness.model.memory import slope
from wrist_stiffness.model.situation import Situation, lengths

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel

FIRST_ORDER_LIMIT = 2e-3
"""A screw that turns by more than this has left first order [rad]."""

SAMPLE_STAGES = STAGES[1:]

Guesses = Mapping[str, Any]
NO_GUESSES: Guesses = MappingProxyType({})


@dataclass(frozen=True)
class Memory:
    """What an evaluation leaves for the next block."""

    states: tuple[Any, ...]  # state of each effect
    time: float  # of the last sample [s]
    theta: Array  # (2,), its motor angles [rad]
    active: NDArray[np.bool_]  # (m,), its contact state


@dataclass(frozen=True, eq=False)
class Advanced:
    """What one effect did at a block."""

    effect: Effect  # which one
    at: Situation  # what it saw
    # `before`, `after`: its state
    before: Any
    added: Contribution  # what it added
    after: Any
    warnings: tuple[str, ...]  # that it lacks a signal, or that it is past first order

    @property
    def left(self) -> Any:
        """What the next block gets of the state."""
        guesses = self.effect.law.state_is_a_guess and self.after is not None
        return self.after.last if guesses else self.after


@dataclass(frozen=True, eq=False)
class Staged:
    """A model's effects at a block after all stages; what they do to the platform is still open."""

    situations: tuple[Situation, ...]  # before the first stage, and after each one
    # of each effect; None for constant ones, which were put together before
    advanced: tuple[Advanced | None, ...]
    warnings: tuple[str, ...]  # of all effects

    @property
    def last(self) -> Situation:
        """With all that the effects added."""
        return self.situations[-1]

    @cached_property
    def known(self) -> dict[int, Advanced]:
        """What the effects did, by their identities."""
        return {id(each.effect): each for each in self.advanced if each is not None}

    @cached_property
    def guesses(self) -> Guesses:
        """Where the effects whose states are guesses ended, by their names."""
        guessing = [e for e in self.advanced if e is not None and e.effect.law.state_is_a_guess]
        return {each.effect.name: each.after for each in guessing}

    def added(self, stage: str) -> list[Contribution]:
        """Return what the effects of a stage added."""
        return [e.added for e in self.advanced if e is not None and e.effect.stage == stage]

    def memory(self, active: NDArray[np.bool_]) -> Memory:
        """Return what is left for the next block, with the contact state (n, m)."""
        block = self.last.block
        states = tuple(None if each is None else each.left for each in self.advanced)
        return Memory(states, float(block.time[-1]), block.theta[-1], active[-1])


def staged(
    model: ErrorModel,
    start: Situation,
    memory: Memory | None,
    like: Staged | None = None,
    near: Guesses = NO_GUESSES,
) -> Staged:
    """Carry a model's effects through the stages.

    `model`: effects, and what the constant ones add together; `start`: the block with what the
    constant effects add; `memory`: what the block before left, None at the start; `like`: another
    model at the same block; `near`: where effects whose states are guesses ended at this block
    before, by their names.
    """
    near = near if like is None else like.guesses
    states = memory.states if memory else (None,) * len(model.effects)
    by_stage: dict[str, list[int]] = {}
    for n, effect in enumerate(model.effects):
        if not effect.law.constant:
            by_stage.setdefault(effect.stage, []).append(n)
    advanced: list[Advanced | None] = [None] * len(model.effects)
    situations, warnings = [start], list(model.constants.warnings)
    for number, stage in enumerate(SAMPLE_STAGES):
        at, added = situations[-1], []
        for n in by_stage.get(stage, ()):
            found = _advanced(model.effects[n], at, states[n], like, near)
            advanced[n] = found
            added.append(found.added)
            warnings += found.warnings
        situations.append(_after(at, added, like, number))
    return Staged(tuple(situations), tuple(advanced), tuple(warnings))


def _advanced(
    effect: Effect, at: Situation, state: Any, like: Staged | None, near: Guesses
) -> Advanced:
    # A user's own law may write into its state.
    known = None if like is None or effect.law.foreign else like.known.get(id(effect))
    if known is not None and known.at is at and known.before is state:
        return known
    guess = near.get(effect.name)
    try:
        before = state if guess is None else guess.after(state)
        added, after = _advanced_by(effect, at, before)
    except MissingSignalError as missing:
        lacking = f"{effect.name}: {missing.signal}{LEFT_OUT}"
        return Advanced(effect, at, state, NOTHING, state, (lacking,))
    return Advanced(effect, at, state, added, after, _first_order(effect, added))


def _after(
    at: Situation, added: Sequence[Contribution], like: Staged | None, number: int
) -> Situation:
    """Return the situation after a stage."""
    if not added:
        return at
    if like is not None and like.situations[number] is at:
        other = like.added(SAMPLE_STAGES[number])
        if len(other) == len(added) and all(map(is_, other, added)):
            return like.situations[number + 1]
    return at.with_more(sum(added, at.given))


class AtHome:
    """What constant effects add at home; models of one table share it."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self._known: dict[int, tuple[Effect, Constants]] = {}

    @cached_property
    def _situation(self) -> Situation:
        return _home(self.table, self.table.components)

    def of(self, effect: Effect, parts: ElasticComponents) -> Constants:
        """Return what an effect adds in a model with these elastic parts."""
        if effect.law.foreign:
            # Only a user's own law may look at the parts.
            return self._added(effect, _home(self.table, parts))
        if id(effect) not in self._known:
            # With the effect itself, so that no other one can get its identity.
            self._known[id(effect)] = effect, self._added(effect, self._situation)
        return self._known[id(effect)][1]

    @staticmethod
    def _added(effect: Effect, home: Situation) -> Constants:
        added, _ = _advanced_by(effect, home, None)
        return Constants.of_home(effect.component, added, _first_order(effect, added))


def constants_of(effects: Sequence[Effect], parts: ElasticComponents, at_home: AtHome) -> Constants:
    """Put the constant ones of some effects together, as they are at home.

    `parts`: elastic parts as they are with the model's effects.
    """
    found = (at_home.of(effect, parts) for effect in effects if effect.law.constant)
    return sum(found, Constants())


def share(models: Sequence[ErrorModel]) -> None:
    """Let models of one table share what follows from effects that they share with the first."""
    at_home = AtHome(models[0].table)
    wanted = {"parts": _of_parts(models[0]), "constants": _of_constants(models[0])}
    for model in models:
        for name, chosen in (("parts", _of_parts), ("constants", _of_constants)):
            if chosen(model) == wanted[name]:
                model.__dict__[name] = getattr(models[0], name)
        if "constants" not in model.__dict__:
            model.__dict__["constants"] = constants_of(model.effects, model.parts, at_home)


def _of_parts(model: ErrorModel) -> list[Effect]:
    return [effect for effect in model.effects if effect.stage == "parts"]


def _of_constants(model: ErrorModel) -> list[Effect]:
    """Return the effects that decide what the constant ones add together."""
    constant = [effect for effect in model.effects if effect.law.constant]
    return constant + _of_parts(model) if any(e.law.foreign for e in constant) else constant


def _home(table: Table, parts: ElasticComponents) -> Situation:
    block = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
    home = table.mechanism.forward(block.theta)
    return Situation(BlockStatics(block, block.load, home, "closed_form", table, parts))


def with_speeds(block: Block, memory: Memory | None) -> Block:
    """Return the block with motor speeds, by backward differences where it has none."""
    if block.theta_dot is not None:
        return block
    before = None if memory is None else (memory.time, memory.theta)
    return replace(block, theta_dot=slope(block.time, block.theta, before)[0])


def _advanced_by(effect: Effect, at: Situation, state: Any) -> tuple[Contribution, Any]:
    """Call a law; whatever goes wrong in a user's own becomes an error that names it."""
    if not effect.law.foreign:
        return effect.law.advance(at, effect.component, effect.si, state)
    try:
        added, state = effect.law.advance(at, effect.component, effect.si, state)
        added.check(len(at.block), len(at.parts.sectors.gap))
    except MissingSignalError:
        raise
    except WristError as error:
        raise InputError(f"{effect.name}: {error}") from error
    except (Exception, SystemExit) as error:
        told = f"{effect.name}: {type(error).__name__}: {error}"
        raise InputError(told + _line_in(effect.law.file, error)) from error
    return added, state


def _line_in(file: Path | None, error: BaseException) -> str:
    """Return which line of a user's own file an error came through last, empty for none."""
    lines = [at.lineno for at in extract_tb(error.__traceback__) if Path(at.filename) == file]
    return f" ({file.name}, line {lines[-1]})" if file is not None and lines else ""


def _first_order(effect: Effect, added: Contribution) -> tuple[str, ...]:
    turned = [
        float(np.max(lengths(screw[:, 3:])))
        for screw in (added.limb_1, added.limb_2, added.both)
        if screw is not None
    ]
    if turned and max(turned) > FIRST_ORDER_LIMIT:
        return (
            f"{effect.name}: turns by {1e3 * max(turned):.2f} mrad, past the first order "
            f"({1e3 * FIRST_ORDER_LIMIT:g} mrad) in which it is carried",
        )
    return ()
