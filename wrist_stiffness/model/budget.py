"""Split a predicted pose error by component and by effect, so that the parts add up to it.

Contact is held as the whole solution left it: sectors that touch stay closed, and each part's share
is the tangent of that state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.contact import forces_of
from wrist_stiffness.mechanism.energy import component_wrenches
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.model.block import Sample
from wrist_stiffness.model.effect import spread_of
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.evaluation import evaluate, evaluate_beside
from wrist_stiffness.model.law import Contribution
from wrist_stiffness.model.situation import Situation


@dataclass(frozen=True)
class Share:
    """What one component or one effect adds to the pose error."""

    name: str  # component, or effect@component
    twist: Array  # (6,), at O in F [m, rad]
    # (v, 6), what its uncertain parameters move the whole, as `spread_of` weighs it [m, rad]
    spread: Array


@dataclass(frozen=True)
class Budget:
    """A pose error and its shares."""

    # of the elastic components as the table has them, in the order of `ELASTIC`
    elastic: tuple[Share, ...]
    effects: tuple[Share, ...]  # of the model's effects, in their order
    # (6,), what the exact composition with the pose sensor's effects adds to the sum [m, rad]
    second_order: Array
    twist: Array  # (6,), pose error of the platform [m, rad]
    # (6,), what the pose sensor would say of it: the sum of all shares and `second_order` [m, rad]
    measured: Array
    # (6, 6), of the twist: the table's stated error, the encoder step and the effects' parameters
    covariance: Array
    platform: Array  # (3, 3), rotation U -> F of the rigid platform
    warnings: tuple[str, ...]  # effects that were left out or have left first order
    # effects that hang on what was before, of which one sample says nothing
    remembering: tuple[str, ...]


def budget(model: ErrorModel, sample: Sample) -> Budget:
    """Split the pose error of one sample, at rest and with nothing before it.

    `model`: its table is evaluated in closed form, which alone knows the components.  Raises
    `UnreachablePoseError` or `SingularPoseError` or `LoadRangeError` if pose or load are out of
    range.
    """
    model = model.with_evaluation("closed_form")
    configuration = model.table.workspace.configuration(sample.theta)
    model.table.check_load(sample.load.wrench)
    block = sample.block
    result = evaluate(model, block, None)
    at = result.situation
    force = forces_of(at.operators.approach, at.statics.told[1], result.active)
    through = at.statics.own_weight + component_wrenches(at.influence, at.parts, at.load, force)
    screws = at.screws_under(through, force)
    carried = block_diagonal(at.influence.of_components()) @ screws[..., None]
    twists = carried[0, :, :, 0]
    effects = []
    for number, (effect, added) in enumerate(zip(model.effects, result.contributions, strict=True)):
        before, after = model.effects[:number], model.effects[number + 1 :]
        if effect.stage == "parts":
            k = ELASTIC.index(effect.component)
            # The law scales all of its part alike.
            softer = at.parts.flexibility[k, 0, 0] / model.table.components.flexibility[k, 0, 0]
            nominal = twists[k] / softer
            twist, twists[k] = twists[k] - nominal, nominal
        else:
            if effect.law.constant:
                added, _ = effect.law.advance(at, effect.component, effect.si, None)
            twist = _felt(at, added, result.active)
        moved = [model.with_effects(*before, other, *after) for other in effect.varied]
        varied = evaluate_beside(moved, [None] * len(moved), result)
        spread = spread_of(result.measured[0], [other.measured[0] for other in varied])
        effects.append(Share(effect.name, twist, spread))
    elastic = [Share(name, twists[k], np.empty((0, 6))) for k, name in enumerate(ELASTIC)]
    total = twists.sum(axis=0) + sum((share.twist for share in effects), np.zeros(6))
    covariance = model.table_covariance(configuration, result.twist[0])
    together: tuple[str, ...] = ()
    if model.joint is not None:
        known = model.joint.as_measured
        together, covariance = known.effects, covariance + known.covariance
    for share in effects:
        if share.name not in together:
            covariance = covariance + share.spread.T @ share.spread
    return Budget(
        tuple(elastic),
        tuple(effects),
        result.measured[0] - total,
        result.twist[0],
        result.measured[0],
        covariance,
        configuration.platform,
        result.warnings,
        # Those that leave a state which would change their answer to the next sample.
        tuple(
            each.effect.name
            for each in result.known.values()
            if each.after is not None and not each.effect.law.state_is_a_guess
        ),
    )


def _felt(at: Situation, added: Contribution, closed: NDArray[np.bool_]) -> Array:
    """Twist (6,) of a contribution at the pose sensor, to first order."""
    twist: Array = at.with_contact(*at.carried(added), closed)[0]
    for sensor in (added.sensor_left, added.sensor_right):
        twist = twist if sensor is None else twist + sensor[0]
    return twist
