"""Extra poses of a case, planned ones and random ones, and how many of them tell twins apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from twins import PARAMETER, Case, Catalogue
from wrist import LOADS, MODEL, NOISE, PACE, TABLE, WORKSPACE, left_by, once_each, performance

from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.planning import plan as planning
from wrist_stiffness.planning import pool
from wrist_stiffness.planning.information import (
    RESOLVED,
    Goal,
    Information,
    Layout,
    carried_over,
    discrimination,
    information,
)
from wrist_stiffness.planning.plan import Conditions, plan
from wrist_stiffness.planning.pool import draw_settings
from wrist_stiffness.planning.question import SESSION, TARE, WRIST, between
from wrist_stiffness.planning.refit import Measured, fitted
from wrist_stiffness.planning.signatures import signatures
from wrist_stiffness.planning.timeline import Visit

EXTRA = 100
"""Extra poses at most: as many settings as a pool has."""

FEW = 40
"""Random poses that are enough for most cases."""

PLANS = 5

ORDERS = 200
"""In which the poses of an arm are counted; its number is the median."""

planning.fixed_visits = lambda *given: pool.fixed_visits(*given)[:1]
planning._Pool.fixed_gram = lambda _, grams: np.zeros(grams.shape[1:])
"""Reference poses and holds are left out of what is measured, so of the plan's reckoning too."""


@dataclass(frozen=True)
class Needed:
    """Poses and measurements from which on a class is resolved; infinite where it never is."""

    poses: float
    measurements: float


NEVER = Needed(np.inf, np.inf)


class Arms:
    """The extra poses of one case."""

    def __init__(self, case: Case, paper: Catalogue) -> None:
        self.case, self.paper = case, paper
        self.first = Measured(paper.timeline, paper.nuisances, case.left)

    def planned(self) -> tuple[Needed, list[int]]:
        """Return what planned poses need, and how many visits each plan had."""
        rounds: list[list[Visit]] = []
        needed, data = NEVER, [self.first]
        for number in range(PLANS):
            rivals = self.still_open(data)
            if len(rivals) < 2:
                break
            added = self.next_plan(rivals, data, number)
            if not added:
                break
            rounds.append(added)
            visits = [visit for each in rounds for visit in each][:EXTRA]
            extra = self.performed(visits)
            sizes = np.diff(np.minimum(np.cumsum([0, *map(len, rounds)]), EXTRA))
            needed = self.needed(extra, list(sizes))
            if np.isfinite(needed.poses) or len(visits) == EXTRA:
                break
            data = [self.first, extra]
        return needed, [len(each) for each in rounds]

    def random(self) -> tuple[Needed, Measured]:
        """Return what random poses need, measured like planned ones, and the measurements."""
        rng = np.random.default_rng([self.case.seed, 1])
        settings = draw_settings(WORKSPACE, LOADS, TABLE.geometry.gravity, rng)
        settings = [replace(setting, hold_s=PACE.dwell_s) for setting in settings]
        visits = [(each, each.from_other_side)[rng.integers(2)] for each in settings]
        for count in (FEW, EXTRA):
            extra = self.performed(visits[:count])
            needed = self.needed(extra, [count])
            if np.isfinite(needed.poses):
                break
        return needed, extra

    def under_load(self, extra: Measured) -> Needed:
        """Return what the same poses need where each is measured under its load only."""
        once = once_each(extra.experiment)
        return self.needed(replace(extra, experiment=once), [int(once.visit.max()) + 1])

    def performed(self, visits: list[Visit]) -> Measured:
        """Return what the virtual cell measures at visits."""
        timeline = performance(visits)
        known = [(effect_named(name),) for name in (*SESSION, *WRIST)]
        nuisances = signatures(MODEL, timeline.block, known)
        return Measured(timeline, nuisances, left_by(timeline, self.case.hidden))

    def next_plan(self, rivals: list[Effect], data: list[Measured], number: int) -> list[Visit]:
        """Return the visits that `plan` chooses, none where nothing can be settled."""
        seed = self.case.seed + 1000 * number
        question = between([rivals], [], np.random.default_rng([self.case.seed, number]))
        conditions = Conditions(LOADS, PACE, NOISE, None, seed)
        return list(plan(MODEL, question, conditions, [each.experiment for each in data]).visits)

    def needed(self, extra: Measured, rounds: Sequence[int]) -> Needed:
        """Return the median over random orders within rounds."""
        rng = np.random.default_rng([self.case.seed, 2])
        measurements = np.bincount(extra.experiment.visit)
        ends = np.cumsum([0, *rounds])
        paper, further = self.told([self.first, extra])
        start = carried_over(paper, (*SESSION, TARE))
        found = []
        for _ in range(ORDERS):
            order = np.concatenate(
                [rng.permutation(np.arange(a, b)) for a, b in zip(ends, ends[1:], strict=False)]
            )
            grams = start + np.cumsum(further.grams[order], axis=0)
            margins = np.delete(self.behind(grams, further.layout), self.true, axis=-1)
            good = margins.min(axis=1) >= RESOLVED**2
            if not good[-1]:
                return NEVER
            last = int(np.flatnonzero(~good)[-1]) + 2 if not good.all() else 1
            found.append((last, np.cumsum(measurements[order])[last - 1]))
        poses, counts = np.median(found, axis=0)
        return Needed(float(poses), float(counts))

    def still_open(self, data: list[Measured]) -> list[Effect]:
        """Return what a diagnosis of all data would leave, best first, with the values found."""
        found = self.told(data)
        gram = found[-1].total + sum(carried_over(e, (*SESSION, TARE)) for e in found[:-1])
        margins = self.behind(gram, found[-1].layout)
        order = np.argsort(margins, kind="stable")
        kept = [self.case.members[i] for i in order if margins[i] - margins[order[0]] < RESOLVED**2]
        return [self.refitted(data, kept[0]), *map(effect_named, kept[1:])]

    @property
    def true(self) -> int:
        """Place of the true effect among the members."""
        return self.case.members.index(self.case.truth)

    def told(self, data: list[Measured]) -> list[Information]:
        """Return of each experiment what every member leaves over, all fitted to all of them."""
        effects = [self.refitted(data, name) for name in self.case.members]
        found = []
        for each in data:
            signs = signatures(MODEL, each.experiment.block, [(effect,) for effect in effects])
            over = [replace(s, truths=each.left[..., None] - s.truths) for s in signs]
            found.append(information(each.experiment, each.nuisances, SESSION, over, TABLE, NOISE))
        return found

    def refitted(self, data: list[Measured], name: str) -> Effect:
        """Return a member with the values that fit all data best."""
        return fitted(MODEL, data, self.paper.sets[name][0], SESSION, NOISE)

    def behind(self, gram: np.ndarray, layout: Layout) -> np.ndarray:
        """Return by how much each member lies behind the truth in the criterion, (..., m)."""
        goals = [Goal(name, name) for name in self.case.members]
        count = np.array([len(layout.columns[name]) for name in self.case.members])
        lost = discrimination(gram, layout, goals) ** 2 + PARAMETER * count
        return lost - lost[..., [self.true]]
