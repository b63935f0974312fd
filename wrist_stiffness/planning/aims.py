"""What a plan is chosen by: the questions in reach, beyond what was measured before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.planning.information import (
    RESOLVED,
    Goal,
    Information,
    Layout,
    beyond_nuisances,
    by_truth,
    calibrated,
    carried_over,
    discrimination,
    wrong_bound,
)
from wrist_stiffness.planning.question import SESSION, TARE, Question

NEAREST = 2
"""Rivals that a commissioning keeps apart from each effect: those that come nearest."""

SEEN = 3.0
"""Discrimination from nothing at which an effect counts as excited."""

LONGER = 10.0
"""What so many times the whole pool cannot separate counts as out of reach."""

LIKELY = 0.5
"""Share of a rival's possible values for which a plan settles it; the next one knows which hold."""

DRAWS = 3
"""Values of each rival, besides the best ones, that fit the data at hand about as well."""


@dataclass(frozen=True)
class Answer:
    """How well the plan answers one question."""

    goal: Goal  # the question
    discrimination: float  # beyond what was measured before, in standard deviations
    reachable: bool  # whether `LONGER` times the pool with these loads could settle it

    @property
    def settled(self) -> bool:
        """Whether the plan settles it."""
        return self.discrimination >= needed(self.goal)


@dataclass(frozen=True, eq=False)
class Aims:
    """What experiments are worth to a question."""

    truths: Truths  # columns of all Gram matrices here, from those that were evaluated
    pool: Information  # all settings as one experiment, in these columns
    start: Array  # (q, q), what was measured before
    goals: tuple[Goal, ...]  # all that is asked
    # whether a new wrist is asked for: its calibration counts as well, and of each effect only the
    # nearest rivals
    everything: bool

    @cached_property
    def at_most(self) -> Array:
        """Gram matrix (q, q) of `LONGER` times the pool."""
        return self.start + LONGER * self.pool.total

    @cached_property
    def reachable(self) -> tuple[Goal, ...]:
        """What the choice is for."""
        found = [each.goal for each in self.answers(self.at_most) if each.settled]
        if self.everything:
            found = nearest(found, discrimination(self.pool.total, self.pool.layout, found))
        return tuple(found)

    def worth(self, gram: Array) -> Array:
        """Return the worth (...) of experiments with Gram matrices (..., q, q), `start` in them."""
        found = discrimination(gram, self.pool.layout, self.reachable, self.start)
        right: Array = 1.0 - wrong_bound(found).mean(axis=-1)
        return right + calibrated(gram, self.pool.layout) if self.everything else right

    def settled(self, gram: Array) -> bool:
        """Tell whether nothing more is needed than a Gram matrix (q, q), `start` in it.

        What was not excited before is worth a setting, but no hour of them beside rivals that are
        told apart.
        """
        asked = [each for each in self.reachable if each.rival] or self.reachable
        found = by_truth(gram, self.pool.layout, asked, self.start)
        return all(
            np.mean(d >= needed(goal)) >= LIKELY for goal, d in zip(asked, found, strict=True)
        )

    def answers(self, gram: Array) -> tuple[Answer, ...]:
        """Return the answers of an experiment with a Gram matrix (q, q), `start` in it."""
        found, best = (
            discrimination(each, self.pool.layout, self.goals, self.start)
            for each in (gram, self.at_most)
        )
        return tuple(
            Answer(goal, float(d), bool(most >= needed(goal)))
            for goal, d, most in zip(self.goals, found, best, strict=True)
        )


def aims(
    known: Information,
    before: Sequence[Information],
    question: Question,
    rng: np.random.Generator,
) -> Aims:
    """Return what settings are chosen by.

    `known`: of the pool; `before`: of earlier experiments on this wrist, each with instruments set
    up anew; `question`: without what no experiment shows; `rng`: draws rivals that agree with what
    was measured before.
    """
    start = np.zeros_like(known.total)
    for each in before:
        start += carried_over(each, (*SESSION, TARE))
    if before:
        truths = after_data(start, known.layout, question.alike, rng)
    else:
        truths = as_asked(known, question.alike)
    pool = Information(truths.of(known.grams), truths.layout)
    goals = all_goals(known) if question.goals is None else question.goals
    return Aims(truths, pool, truths.of(start), goals, question.goals is None)


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


@dataclass(frozen=True, eq=False)
class Truths:
    """Truths as combinations of the columns that were evaluated."""

    combined: Array  # (q, r), new columns by the old ones: nuisances, effects' columns, truths
    layout: Layout  # of the new columns

    def of(self, gram: Array) -> Array:
        """Return Gram matrices (..., r, r) of the new columns from those (..., q, q) of the old."""
        found: Array = self.combined.T @ gram @ self.combined
        return found


def as_asked(known: Information, alike: Sequence[Sequence[str]]) -> Truths:
    """Take truths as they are, the members of each class made as large as its first one.

    `known`: of an experiment that shows how large they are.
    """
    layout = known.layout
    size = np.ones(len(known.total))
    for members in alike:
        shown = [name for name in members if name in layout.truths]
        sizes = discrimination(known.total, layout, [Goal(name, "") for name in shown])
        for name, own in zip(shown, sizes, strict=True):
            if own > 0.0 and sizes[0] > 0.0:
                size[len(layout.prior) + layout.truths[name]] = sizes[0] / own
    return Truths(np.diag(size), layout)


def after_data(
    gram: Array, layout: Layout, alike: Sequence[Sequence[str]], rng: np.random.Generator
) -> Truths:
    """Take for each member of a class what fits the data that its first member explains.

    What the best member of a class leaves in the data at hand is known.  Another member, were it
    true, has left the same: its parameters are those that fit it, as well as the data determine
    them.  An experiment is worth what it tells between effects that agree on what was measured
    before and differ elsewhere; random values would already disagree on the old data and ask for
    less than it takes.

    `gram` (q, q): of the data at hand.  `layout`: of its columns.  `alike`: classes; the first
    truth of the first member says what was measured.  `rng`: draws values within the uncertainty
    that these data leave, from a prior of plausible sizes.  Gives `Truths`: `DRAWS` + 1 for each
    member, the most probable one first.
    """
    p, q = len(layout.prior), len(gram)
    left = beyond_nuisances(gram, layout)
    blocks, truths = [np.eye(q)], dict(layout.truths)
    at = q - p
    for members in alike:
        shown = [name for name in members if name in layout.truths]
        for name in shown:
            measured, own = layout.truths[shown[0]][0], layout.columns[name]
            inner = left[np.ix_(own, own)] + np.eye(len(own))
            spread = np.linalg.inv(np.linalg.cholesky(inner)).T
            new = np.zeros((q, DRAWS + 1))
            whole = layout.truths[name][0]
            new[p + whole] = 1.0
            missing = left[own, measured] - left[own, whole]
            new[p + own] = np.linalg.solve(inner, missing)[:, None]
            new[p + own, 1:] += spread @ rng.standard_normal((len(own), DRAWS))
            blocks.append(new)
            truths[name] = np.arange(at, at + DRAWS + 1)
            at += DRAWS + 1
    return Truths(np.concatenate(blocks, axis=1), replace(layout, truths=truths))
