"""What small changes of constants do: each one is a small screw, and the influence carries it.

The flanges touch where they do, so a row of changes costs little more than one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import is_
from typing import TYPE_CHECKING

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import forces_of
from wrist_stiffness.model.contribution import SEATS, Constants
from wrist_stiffness.model.held import HeldLaw

if TYPE_CHECKING:
    from wrist_stiffness.model.error_model import ErrorModel
    from wrist_stiffness.model.evaluation import Evaluated

FOLLOW_FORCES = ("friction", "reaction")
"""Stages of what follows the forces through the components, which constants change."""


def only_constants_differ(model: ErrorModel, like: Evaluated) -> bool:
    """Tell whether a model differs from an evaluated one in constants, of which no effect knows."""
    changing = [each.effect for each in like.advanced if each is not None]
    own = [each for each in model.effects if not each.law.constant and each.stage != "parts"]
    return (
        model.parts is like.situation.parts
        and len(own) == len(changing)
        and all(map(is_, own, changing))
        and all(each.stage not in FOLLOW_FORCES or isinstance(each.law, HeldLaw) for each in own)
    )


def with_constants(models: Sequence[ErrorModel], like: Evaluated) -> list[Evaluated]:
    """Return what models do that differ from an evaluated one by little, and in constants alone.

    `models`: t of them, of which `only_constants_differ` holds; `like`: n samples with m flange
    sectors.  Gives first order in the changes, with the flanges that touch held closed.
    """
    if not models:
        return []
    at, t = like.situation, len(models)
    n, m = like.active.shape
    every = [model.constants for model in models]
    screws = _more(every, at.constants, "screws", (len(SEATS), 6))
    # Both halves of a screw stand beside each other: (n, 3, 2 t).
    limbs = {limb: np.zeros((n, 3, 2 * t)) for limb, _ in SEATS}
    for row, (limb, body) in enumerate(SEATS):
        limbs[limb] += at.configuration.bodies[:, body] @ screws[:, row].reshape(-1, 3).T
    projectors, operators = at.influence, at.operators
    moved = projectors.limb_1 @ limbs["limb_1"] + projectors.limb_2 @ limbs["limb_2"]
    slid = projectors.slides_limb_1 @ (limbs["limb_1"] - limbs["limb_2"])[:, :, ::2]
    wrench = _more(every, at.constants, "wrench", (6,))
    twist = np.swapaxes(moved, 1, 2).reshape(n, t, 6)
    twist += wrench @ np.swapaxes(operators.compliance, 1, 2)
    gap = np.swapaxes(slid, 1, 2) @ at.parts.sectors.slide.T + wrench @ operators.force_twist
    gap += _more(every, at.constants, "gap", (m,))
    force = forces_of(operators.approach, gap, like.active)
    twist += force @ np.swapaxes(operators.force_twist, 1, 2)
    found = []
    for k, own in enumerate(every):
        situation = replace(at, constants=own)
        whole = at.answer[0] + twist[:, k], at.answer[1] + force[:, k], like.active
        vars(situation)["answer"] = whole
        found.append(replace(like, situations=(situation,)))
    return found


def _more(every: Sequence[Constants], than: Constants, name: str, shape: tuple[int, ...]) -> Array:
    """Return by how much constants are more than others, (t, ...)."""
    zero = np.zeros(shape)
    known, *own = (getattr(each, name) for each in (than, *every))
    return np.array([zero if each is None else each for each in own]) - (
        zero if known is None else known
    )
