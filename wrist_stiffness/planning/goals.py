"""Which questions a plan asks, and what settles one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.planning.information import (
    RESOLVED,
    Goal,
    Information,
)

NEAREST = 2
"""Rivals that a commissioning keeps apart from each effect: those that come nearest."""

SEEN = 3.0
"""Discrimination from nothing at which an effect counts as excited."""


def needed(goal: Goal) -> float:
    """Return the discrimination that settles a question."""
    return RESOLVED if goal.rival else SEEN


def all_goals(known: Information) -> tuple[Goal, ...]:
    """Return whether each effect is seen, and every ordered pair."""
    names = list(known.layout.truths)
    return (
        *(Goal(name, "") for name in names),
        *(Goal(one, other) for one in names for other in names if one != other),
    )


def nearest(goals: Sequence[Goal], discriminations: Array) -> list[Goal]:
    """Return of each truth its own visibility and its nearest rivals."""
    kept: list[Goal] = []
    order = np.argsort(discriminations, kind="stable")
    counts: dict[str, int] = {}
    for i in order:
        goal = goals[i]
        if goal.rival:
            counts[goal.truth] = counts.get(goal.truth, 0) + 1
        if not goal.rival or counts[goal.truth] <= NEAREST:
            kept.append(goal)
    return kept
