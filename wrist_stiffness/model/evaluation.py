"""Evaluate a model over a block: stage after stage, then contact once with everything in it.

0 <= lambda  perpendicular to  g0 + B' W + sum_k N_k delta_k + A lambda >= 0
xi = C W + sum_k G_k delta_k + B lambda
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.lookup.table import Evaluation, Table
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion
from wrist_stiffness.mechanism.single_pose import SinglePoseStatics
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.constants import Constants
from wrist_stiffness.model.contacts import Held, solve_contacts
from wrist_stiffness.model.contribution import NOTHING, Contribution, MissingSignalError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import STAGES
from wrist_stiffness.model.situation import Situation, lengths

FIRST_ORDER_LIMIT = 2e-3
"""A screw that turns by more than this has left first order [rad]."""

SAMPLE_STAGES = STAGES[1:]

_SHARED = (
    "operators",
    "influence",
    "_turned_flexibility",
    "speed",
    "own_weight",
    "jacobian",
    "told",
)
"""What of a situation does not depend on what effects add."""


class Evaluable(Protocol):
    """What an evaluation must know of a model."""

    @property
    def table(self) -> Table:
        """Elastic lookup of the wrist."""

    @property
    def evaluation(self) -> Evaluation:
        """`closed_form` or `spline`."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """In the order in which they entered."""

    @property
    def parts(self) -> ElasticComponents:
        """Elastic parts with the effects that change them."""

    @property
    def constants(self) -> Constants:
        """What the constant effects add together."""

    @property
    def single_pose(self) -> SinglePoseStatics:
        """The closed form for one pose at a time, with the constants' screws and gaps."""


@dataclass(frozen=True)
class Memory:
    """What an evaluation leaves for the next block.

    Parameters
    ----------
    states : tuple
        State of each effect.
    time : float
        Of the last sample [s].
    theta : (2,) float
        Its motor angles [rad].
    active : (m,) bool
        Its contact state.
    """

    states: tuple[Any, ...]
    time: float
    theta: Array
    active: NDArray[np.bool_]


@dataclass(frozen=True)
class Evaluated:
    """Result of an evaluation of n samples.

    Parameters
    ----------
    situation : Situation
        As the reaction stage saw it.
    twist : (n, 6) float
        Pose error of the platform, first order in every screw [m, rad].
    force : (n, m) float
        Contact forces [N].
    active : (n, m) bool
        Contact state.
    contributions : tuple of Contribution
        What each effect added; nothing for constant ones, which were put together before.
    warnings : tuple of str
        Effects without their signals, and effects past first order.
    """

    situation: Situation
    twist: Array
    force: Array
    active: NDArray[np.bool_]
    contributions: tuple[Contribution, ...]
    warnings: tuple[str, ...]

    @cached_property
    def measured(self) -> Array:
        """What the pose sensor says of the twist, composed exactly, (n, 6) [m, rad]."""
        return seen(self.situation, self.twist)

    @cached_property
    def held(self) -> Held:
        """The contact state, for other models at the same block."""
        return Held.of(self.situation.operators.approach, self.active)


def evaluate(
    model: Evaluable,
    block: Block,
    memory: Memory | None,
    like: Evaluated | None = None,
    pose: Configuration | None = None,
) -> tuple[Evaluated, Memory]:
    """Evaluate a model over a block.

    Parameters
    ----------
    model : Evaluable
        Table and effects.
    block : Block
        n > 0 samples inside the table's domain and load range.
    memory : Memory or None
        What the block before left, None at the start.
    like : Evaluated, optional
        Of another model at the same block: what they have in common is not computed again.
    pose : Configuration, optional
        The configuration of a block of one sample, where it is known.

    Returns
    -------
    Evaluated
        For n samples.
    Memory
        For the next block.
    """
    if like is not None and like.situation.parts is model.parts:
        base = replace(like.situation, guess=like.held, constants=model.constants)
        at = advanced(base, NOTHING, like.situation)
    else:
        block = with_speeds(block, memory)
        at = situation_of(model, block, None if memory is None else memory.active, pose)
    states = list(memory.states) if memory else [None] * len(model.effects)
    added = [NOTHING] * len(model.effects)
    warnings = list(model.constants.warnings)
    for stage in SAMPLE_STAGES:
        total = at.given
        for number, effect in enumerate(model.effects):
            if effect.law.constant or effect.stage != stage:
                continue
            try:
                added[number], states[number] = _advanced_by(effect, at, states[number])
            except MissingSignalError as missing:
                warnings.append(f"{effect.name}: {missing.signal} is missing, left out")
            total = total + added[number]
            warnings += _first_order(effect, added[number])
        if total is not at.given:
            at = advanced(at, total)
    if pose is not None and at.given.through is None and "operators" not in at.__dict__:
        twist, force, active = _settled_one(model.single_pose, pose, at)
    else:
        twist, gap = at.free
        force, active = solve_contacts(at.operators.approach, gap, at.guess)
        twist = twist + (at.operators.force_twist @ force[..., None])[..., 0]
    result = Evaluated(at, twist, force, active, tuple(added), tuple(warnings))
    return result, Memory(tuple(states), float(block.time[-1]), block.theta[-1], active[-1])


def situation_of(
    model: Evaluable,
    block: Block,
    guess: NDArray[np.bool_] | None,
    pose: Configuration | None = None,
) -> Situation:
    """Return a block at its configurations, before any effect that is not constant."""
    if pose is None:
        configuration = model.table.mechanism.forward(block.theta)
    else:
        configuration = Configuration(*(value[None] for value in vars(pose).values()))
    load = block.load
    if block.load_on_platform:
        halves = load.reshape(-1, 2, 3) @ np.swapaxes(configuration.platform, -1, -2)
        load = halves.reshape(-1, 6)
    return Situation(
        block,
        load,
        configuration,
        model.evaluation,
        model.table,
        model.parts,
        model.constants,
        guess=guess,
    )


def constants_of(effects: Sequence[Effect], table: Table, parts: ElasticComponents) -> Constants:
    """Put the constant ones of some effects together, as they are at home."""
    constants = Constants()
    chosen = [effect for effect in effects if effect.law.constant]
    if chosen:
        block = Block(np.zeros(1), np.zeros((1, 2)), np.zeros((1, 6)), np.zeros((1, 2)))
        home = table.mechanism.forward(block.theta)
        at = Situation(block, block.load, home, "closed_form", table, parts)
        for effect in chosen:
            added, _ = _advanced_by(effect, at, None)
            warnings = _first_order(effect, added)
            constants = constants.with_home(effect.component, added, warnings)
    return constants


def _settled_one(
    statics: SinglePoseStatics, pose: Configuration, at: Situation
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return twist (1, 6), force (1, m) and contact state (1, m) of one sample."""
    given = at.given
    guess = None if at.guess is None else np.asarray(at.guess)
    limb_1, limb_2, gap = (
        None if value is None else value[0] for value in (given.limb_1, given.limb_2, given.gap)
    )
    twist, force, active = statics.respond(pose, at.wrench[0], guess, limb_1, limb_2, gap)
    if given.both is not None:
        twist = twist + given.both[0]
    return twist[None], force[None], active[None]


def advanced(at: Situation, given: Contribution, known: Situation | None = None) -> Situation:
    """Return the situation with what another stage added; its projectors need no new work."""
    later = replace(at, given=given)
    for name in _SHARED:
        if name in (known or at).__dict__:
            later.__dict__[name] = (known or at).__dict__[name]
    return later


def seen(at: Situation, twist: Array) -> Array:
    """Return the twist that the pose sensor reports, log(exp(X) exp(xi) exp(Y)), (n, 6)."""
    left, right = at.sensor
    if left is None and right is None:
        return twist
    rotation, shift = exp_twist(twist)
    if right is not None:
        turned, moved = exp_twist(right)
        shift = shift + (rotation @ moved[..., None])[..., 0]
        rotation = rotation @ turned
    if left is not None:
        turned, moved = exp_twist(left)
        shift = moved + (turned @ shift[..., None])[..., 0]
        rotation = turned @ rotation
    return log_motion(rotation, shift)


def with_speeds(block: Block, memory: Memory | None) -> Block:
    """Return the block with motor speeds, by backward differences where it has none."""
    if block.theta_dot is not None:
        return block
    first = (block.time[0], block.theta[0]) if memory is None else (memory.time, memory.theta)
    interval = np.diff(block.time, prepend=first[0])[:, None]
    step = np.diff(block.theta, axis=0, prepend=first[1][None])
    speed = np.divide(step, interval, out=np.zeros_like(step), where=interval > 0.0)
    return replace(block, theta_dot=speed)


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
    except Exception as error:
        raise InputError(f"{effect.name}: {type(error).__name__}: {error}") from error
    return added, state


def _first_order(effect: Effect, added: Contribution) -> list[str]:
    turned = [
        float(np.max(lengths(screw[:, 3:])))
        for screw in (added.limb_1, added.limb_2, added.both)
        if screw is not None
    ]
    if turned and max(turned) > FIRST_ORDER_LIMIT:
        return [
            f"{effect.name}: turns by {1e3 * max(turned):.2f} mrad, past the first order "
            f"({1e3 * FIRST_ORDER_LIMIT:g} mrad) in which it is carried"
        ]
    return []
