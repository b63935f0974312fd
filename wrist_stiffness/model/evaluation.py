"""Evaluate a model over a block: stage after stage, then contact once with everything in it.

0 <= lambda  perpendicular to  g0 + B' W + sum_k N_k delta_k + A lambda >= 0
xi = C W + sum_k G_k delta_k + B lambda

Models at one block often share effects.  What an effect did is taken over where the other one saw
the same thing: the same object, with the same state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import is_
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contacts
from wrist_stiffness.mechanism.vectors import both_halves
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.contribution import (
    NOTHING,
    Constants,
    Contribution,
    MissingSignalError,
    left_out,
)
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import STAGES
from wrist_stiffness.model.memory import slope
from wrist_stiffness.model.prediction import seen
from wrist_stiffness.model.situation import BlockStatics, Situation, lengths
from wrist_stiffness.model.slopes import only_constants_differ, with_constants
from wrist_stiffness.model.users_law import advanced_by

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel

FIRST_ORDER_LIMIT = 2e-3
"""A screw that turns by more than this has left first order [rad]."""

SAMPLE_STAGES, RUBS = STAGES[1:], STAGES[3]

PASSES = 4
"""In which joints that rub and the flanges find each other.  Of three joints with soft bristles
they leave 1 % (`pytest test/model/test_held_pin.py -k friction_alone`), of one with the stiffest
9 %, where a single pass leaves 28 %.  Each has a history of its own, so any blocks give the same.
"""

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
    lacks: str = ""  # the signal without which it was left out

    @property
    def left(self) -> Any:
        """What the next block gets of the state."""
        guesses = self.effect.law.state_is_a_guess and self.after is not None
        return self.after.last if guesses else self.after


@dataclass(frozen=True, eq=False)
class Evaluated:
    """What a model's effects did at a block of n samples, and to the platform."""

    situations: tuple[Situation, ...]  # before the first stage, and after each one
    # of each effect; None for constant ones, which were put together before
    advanced: tuple[Advanced | None, ...]
    warnings: tuple[str, ...]  # effects without their signals, and effects past first order

    @property
    def situation(self) -> Situation:
        """With all that the effects added."""
        return self.situations[-1]

    @property
    def twist(self) -> Array:
        """Pose error of the platform, first order in every screw, (n, 6) [m, rad]."""
        return self.situation.answer[0]

    @property
    def active(self) -> NDArray[np.bool_]:
        """Contact state, (n, m)."""
        return self.situation.answer[2]

    @cached_property
    def measured(self) -> Array:
        """What the pose sensor says of the twist, composed exactly, (n, 6) [m, rad]."""
        return seen(self.twist, *self.situation.sensor)

    @property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each effect added; nothing for constant ones."""
        return tuple(NOTHING if each is None else each.added for each in self.advanced)

    @property
    def memory(self) -> Memory:
        """What is left for the next block."""
        block = self.situation.block
        states = tuple(None if each is None else each.left for each in self.advanced)
        return Memory(states, float(block.time[-1]), block.theta[-1], self.active[-1])

    @cached_property
    def known(self) -> dict[int, Advanced]:
        """What the effects did, by their identities."""
        return {id(each.effect): each for each in self.advanced if each is not None}

    @cached_property
    def guesses(self) -> Guesses:
        """Where the effects whose states are guesses ended, by their names."""
        every = self.known.values()
        return {e.effect.name: e.after for e in every if e.effect.law.state_is_a_guess}

    @property
    def lacking(self) -> dict[str, str]:
        """The signals without which effects were left out, by the effects' names."""
        return {each.effect.name: each.lacks for each in self.known.values() if each.lacks}

    def added(self, stage: str) -> list[Contribution]:
        """Return what the effects of a stage added."""
        return [each.added for each in self.known.values() if each.effect.stage == stage]


def evaluate(
    model: ErrorModel,
    block: Block,
    memory: Memory | None,
    pose: Configuration | None = None,
    near: Guesses = NO_GUESSES,
    statics: BlockStatics | None = None,
    guess: NDArray[np.bool_] | None = None,
) -> Evaluated:
    """Evaluate a model over a block.

    `block`: n > 0 samples inside the table's domain and load range; `memory`: what the block before
    left, None at the start; `pose`: the configuration of a block of one sample, where it is known;
    `near`: where effects whose states are guesses ended at this block before, by their names;
    `statics`, `guess`: of this block and of the contact state at its moments, (n, m), where another
    model of the same table was evaluated.
    """
    if guess is None and memory is not None:
        guess = memory.active
    if statics is not None:
        start = _begun(model, statics.with_parts(model.parts), guess)
        return _staged(model, start, memory, None, near)
    if block.theta_dot is None:
        before = None if memory is None else (memory.time, memory.theta)
        block = replace(block, theta_dot=slope(block.time, block.theta, before)[0])
    return _staged(model, situation_of(model, block, guess, pose), memory, None, near)


def evaluate_beside(
    models: Sequence[ErrorModel],
    memories: Sequence[Memory | None],
    like: Evaluated,
    slopes: bool = False,
) -> list[Evaluated]:
    """Evaluate further models over the block of one that was evaluated.

    What they have in common with it is not computed again; where the compiled formulas do not
    serve, flange contact is solved for all models with the same elastic parts together.

    `models`: with the same table; `memories`: what the block before left of each; `like`: the first
    model; `slopes`: whether they differ from it by little, so that their constants may be taken as
    `slopes.with_constants` does.
    """
    alike = [slopes and only_constants_differ(model, like) for model in models]
    known = iter(with_constants([m for m, same in zip(models, alike, strict=True) if same], like))
    every = [
        next(known) if same else _staged(model, _start(model, like), memory, like, like.guesses)
        for model, memory, same in zip(models, memories, alike, strict=True)
    ]
    at = like.situation
    open_ones = [each.situation for each in every if "answer" not in vars(each.situation)]
    together = [each for each in open_ones if each.statics is at.statics and each.wrist is None]
    if together:
        gaps = np.stack([other.free[1] for other in together], axis=1)
        force, active = solve_contacts(at.operators.approach, gaps, like.active[:, None])
        pushed = force @ np.swapaxes(at.operators.force_twist, -1, -2)
        for t, other in enumerate(together):
            vars(other)["answer"] = other.free[0] + pushed[:, t], force[:, t], active[:, t]
    return every


def _start(model: ErrorModel, like: Evaluated) -> Situation:
    """Return the situation in which a model begins beside another one."""
    start = like.situations[0]
    if start.parts is model.parts and start.constants is model.constants:
        return start
    statics = start.statics
    if start.parts is not model.parts:
        statics = statics.with_parts(model.parts)
    return _begun(model, statics, like.active)


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
    return _begun(model, statics, guess)


def _begun(model: ErrorModel, statics: BlockStatics, guess: NDArray[np.bool_] | None) -> Situation:
    return Situation(statics, model.constants, guess=guess, wrist=model.compiled)


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


def _staged(
    model: ErrorModel,
    start: Situation,
    memory: Memory | None,
    like: Evaluated | None,
    near: Guesses,
) -> Evaluated:
    """Carry a model's effects through the stages.

    `start`: the block with what the constant effects add; `memory`: what the block before left,
    None at the start; `like`: another model at the same block; `near`: where effects whose states
    are guesses ended at this block before, by their names.
    """
    states = memory.states if memory else (None,) * len(model.effects)
    advanced: list[Advanced | None] = [None] * len(model.effects)
    situations, warnings = [start], list(model.constants.warnings)
    for number, stage in enumerate(SAMPLE_STAGES):
        at, places = situations[-1], model.changing.get(stage, ())
        effects, before = [model.effects[n] for n in places], [states[n] for n in places]
        if stage == RUBS and effects:
            found = _settled(effects, at, before, like)
        else:
            found = _beside(effects, at, before, like, near)
        for n, each in zip(places, found, strict=True):
            advanced[n] = each
            warnings += each.warnings
        situations.append(_after(at, [each.added for each in found], like, number))
    return Evaluated(tuple(situations), tuple(advanced), tuple(warnings))


def _beside(
    effects: Sequence[Effect],
    at: Situation,
    states: Sequence[Any],
    like: Evaluated | None,
    near: Guesses,
) -> list[Advanced]:
    """Return what effects do that see the same; those that rest together do it together."""
    one = [n for n, each in enumerate(effects) if _rests_together(each)]
    rest = iter(_together([effects[n] for n in one], at, [states[n] for n in one], like, near))
    return [
        next(rest) if n in one else _advanced(effect, at, state, like, near)
        for n, (effect, state) in enumerate(zip(effects, states, strict=True))
    ]


def _rests_together(effect: Effect) -> bool:
    return effect.law.rests_together and not effect.law.foreign


def _together(
    effects: Sequence[Effect],
    at: Situation,
    states: Sequence[Any],
    like: Evaluated | None,
    near: Guesses,
) -> list[Advanced]:
    if not effects:
        return []
    known = _all_known(effects, at, states, like, _rests_together)
    if known:
        return known
    before = [_near(*each, near) for each in zip(effects, states, strict=True)]
    places, values = [each.component for each in effects], [each.si for each in effects]
    found = effects[0].law.together(at, places, values, before)
    return [
        Advanced(effect, at, state, added, after, _first_order(effect, added))
        for effect, state, (added, after) in zip(effects, states, found, strict=True)
    ]


def _advanced(
    effect: Effect, at: Situation, state: Any, like: Evaluated | None, near: Guesses
) -> Advanced:
    known = _known(effect, at, state, like)
    if known is not None:
        return known
    try:
        added, after = advanced_by(effect, at, _near(effect, state, near))
    except MissingSignalError as missing:
        signal = str(missing)
        said = left_out(effect.name, signal)
        return Advanced(effect, at, state, NOTHING, state, (said,), signal)
    return Advanced(effect, at, state, added, after, _first_order(effect, added))


def _near(effect: Effect, state: Any, near: Guesses) -> Any:
    """Return the state with which to begin, where another model ended if its law guesses."""
    guess = near.get(effect.name)
    return state if guess is None else guess.after(state)


def _known(effect: Effect, at: Situation, state: Any, like: Evaluated | None) -> Advanced | None:
    """Return what the same effect did in another evaluation, if it saw the same."""
    # A user's own law may write into its state.
    known = None if like is None or effect.law.foreign else like.known.get(id(effect))
    return known if known is not None and known.at is at and known.before is state else None


def _all_known(
    effects: Sequence[Effect],
    at: Situation,
    states: Sequence[Any],
    like: Evaluated | None,
    acts: Callable[[Effect], bool],
) -> list[Advanced]:
    """Return what effects that act on each other did in another evaluation; empty if it is new.

    `acts`: tells which effects do: there may be no further one.
    """
    found = [_known(e, at, s, like) for e, s in zip(effects, states, strict=True)]
    same = [each for each in found if each is not None]
    theirs = [] if like is None else [each for each in like.known.values() if acts(each.effect)]
    return same if len(same) == len(effects) == len(theirs) else []


def _settled(
    effects: Sequence[Effect], at: Situation, states: Sequence[Any], like: Evaluated | None
) -> list[Advanced]:
    """Return what rubs, with each other and with what gives way to it.

    `states`: one for each pass, or None.  A law that tells what rubs gets a situation in which its
    own force acts, any other law one without it.
    """
    known = _all_known(effects, at, states, like, lambda effect: effect.stage == RUBS)
    if known:
        return known
    found: dict[int, Advanced] = {}
    pushes: dict[int, Contribution] = {}
    ends: list[tuple[Any, ...]] = [() for _ in effects]
    for number in range(PASSES):
        for n, (effect, state) in enumerate(zip(effects, states, strict=True)):
            acting = (each for m, each in pushes.items() if m != n or each.rubbing)
            here = at.with_more(sum(acting, NOTHING))
            before = None if state is None else state[number]
            found[n] = _advanced(effect, here, before, None, NO_GUESSES)
            pushes[n] = found[n].added
            ends[n] += (found[n].left,)
    return [
        replace(each, at=at, before=state, after=end)
        for each, state, end in zip(found.values(), states, ends, strict=True)
    ]


def _after(
    at: Situation, added: Sequence[Contribution], like: Evaluated | None, number: int
) -> Situation:
    """Return the situation after a stage."""
    if not added:
        return at
    if like is not None and like.situations[number] is at:
        other = like.added(SAMPLE_STAGES[number])
        if len(other) == len(added) and all(map(is_, other, added)):
            return like.situations[number + 1]
    return at.with_more(sum(added, NOTHING))


def home_of(table: Table, parts: ElasticComponents) -> Situation:
    """Return the wrist at home, unloaded and at rest."""
    block = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
    at = table.mechanism.forward(block.theta)
    return Situation(BlockStatics(block, block.load, at, "closed_form", table, parts))


def constant_of(effect: Effect, home: Situation) -> Constants:
    """Return what a constant effect adds at home (InputError where no constant can be that)."""
    added, _ = advanced_by(effect, home, None)
    if added.both is not None or added.through is not None:
        raise InputError(
            f"{effect.name}: a law with constant = True cannot move both limbs, at the frame or "
            "the platform, or push through parts; let it be without"
        )
    return Constants.of_home(effect.component, added, _first_order(effect, added))


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
