"""Plan an experiment: for commissioning, or between the rivals that a diagnosis left.

What effects would leave is computed with the model on a pool of settings performed as one
experiment; settings are chosen by their Gram matrices; what the chosen experiment will settle is
computed again on its own path, in its own order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.planning.aims import Answer, aims
from wrist_stiffness.planning.choice import LOOKED_AT, choose
from wrist_stiffness.planning.information import (
    Information,
    MeasurementNoise,
    improvement,
    information,
)
from wrist_stiffness.planning.loads_file import Source
from wrist_stiffness.planning.pool import arrange, draw_settings, fixed_visits, moved_outward
from wrist_stiffness.planning.question import Question
from wrist_stiffness.planning.refit import rivals_alike
from wrist_stiffness.planning.signatures import signatures
from wrist_stiffness.planning.timeline import Experiment, Pace, Timeline, Visit, run_through
from wrist_stiffness.progress import Progress, silent

LONGEST_S = 3600.0
"""Of a plan between rivals for which no duration is asked [s]."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Under which an experiment is planned."""

    sources: tuple[Source, ...]  # what the user can apply; nothing else is proposed
    pace: Pace  # speeds and durations
    noise: MeasurementNoise  # of one dwell
    seconds: float | None  # duration; None for as long as it takes, but not beyond `LONGEST_S`
    seed: int  # the same seed gives the same plan


@dataclass(frozen=True, eq=False)
class Plan:
    """An experiment and what it is good for."""

    # what to do when; None where no such experiment could answer any of the questions
    timeline: Timeline | None
    visits: tuple[Visit, ...]  # chosen ones, in the order of their worth
    answers: tuple[Answer, ...]  # to every question
    # effects that no such experiment shows, with the signal that they need
    cannot: Mapping[str, str]
    # by how much the uncertainty of each effect that is always refitted falls
    calibration: Mapping[str, float]


def plan(
    model: ErrorModel,
    question: Question,
    conditions: Conditions,
    earlier: Sequence[Experiment] = (),
    progress: Progress = silent,
) -> Plan:
    """Plan an experiment that is not longer than asked for.

    `earlier`: what was measured on this wrist before, each with instruments set up anew.  Raises
    `InputError` if not even the fixed part fits into the duration; `LoadRangeError` if a load
    cannot be applied within the table's range.
    """
    rng = np.random.default_rng(conditions.seed)
    whole = question.goals is None
    pool = _Pool(model, conditions, whole, rng)
    seconds = LONGEST_S if conditions.seconds is None else conditions.seconds
    shortest = pool.arranged([], rng)
    if shortest.duration_s > seconds:
        raise InputError(
            f"plan: {seconds / 60.0:g} minutes are less than the "
            f"{np.ceil(shortest.duration_s / 6.0) / 10.0:.1f} that "
            "warm-up, reference poses and two long holds take"
        )
    agree = bool(earlier and question.alike)
    stages = _stages(progress, 2 + len(earlier) + agree)
    if agree:
        question = rivals_alike(model, question, earlier, conditions.noise, next(stages))
    known, lacking = evaluated(model, question, pool.timeline, conditions.noise, next(stages))
    question = question.without(lacking)
    before = [evaluated(model, question, e, conditions.noise, next(stages))[0] for e in earlier]
    own = aims(known, before, question, rng)
    if not own.reachable and not whole:
        return Plan(None, (), own.answers(own.at_most), lacking, {})
    chosen = choose(
        pool.by_unit(own.pool.grams),
        pool.cost_s,
        own.start + pool.fixed_gram(own.pool.grams),
        seconds - shortest.duration_s,
        own.worth,
        # All the time that is asked for is used.
        own.settled if conditions.seconds is None else lambda gram: False,
        rng,
        LOOKED_AT if whole else len(pool.cost_s),
        per_second=conditions.seconds is not None,
    )
    visits, timeline = pool.within(seconds, chosen, shortest, rng)
    final = evaluated(model, question, timeline, conditions.noise, next(stages))[0]
    gram = own.start + own.truths.of(final.total)
    return Plan(
        timeline,
        tuple(visits),
        own.answers(gram),
        lacking,
        improvement(gram, own.pool.layout),
    )


def _stages(progress: Progress, count: int) -> Iterator[Progress]:
    """Yield the progress of each of several evaluations of about the same length."""
    for behind in range(count):

        def told(done: int, total: int, behind: int = behind) -> None:
            progress(behind * total + done, count * total)

        yield told


class _Pool:
    """All settings, performed as one experiment.

    For a whole wrist they are chosen as pairs of visits from both sides; between rivals singly, and
    moved outward as well.
    """

    def __init__(
        self, model: ErrorModel, conditions: Conditions, whole: bool, rng: np.random.Generator
    ) -> None:
        workspace, pace = model.table.workspace, conditions.pace
        self._workspace, self._pace = workspace, pace
        settings = draw_settings(workspace, conditions.sources, model.table.geometry.gravity, rng)
        self._fixed = fixed_visits(settings, pace)
        if not whole:
            settings += [moved_outward(setting, workspace) for setting in settings]
        settings = [replace(setting, hold_s=pace.dwell_s) for setting in settings]
        self._visits = [visit for each in settings for visit in (each, each.from_other_side)]
        self.in_unit = 2 if whole else 1
        order = rng.permutation(len(self._visits))
        ordered = [*(self._visits[i] for i in order), *self._fixed]
        self.timeline = run_through(ordered, workspace, pace)
        self._place = np.argsort(order)
        self.cost_s = self.by_unit(np.diff(self.timeline.ends, prepend=0.0))

    def by_unit(self, of_visits: Array) -> Array:
        """Return the sums (m, ...) over the visits of each unit of values (v, ...)."""
        units = of_visits[self._place].reshape(-1, self.in_unit, *of_visits.shape[1:])
        total: Array = units.sum(axis=1)
        return total

    def fixed_gram(self, grams: Array) -> Array:
        """Return the sum over the visits that every plan has."""
        total: Array = grams[len(self._place) :].sum(axis=0)
        return total

    def visits_of(self, chosen: Sequence[int]) -> list[Visit]:
        """Return the visits of some units; a unit chosen twice is visited twice."""
        places = (self.in_unit * unit + side for unit in chosen for side in range(self.in_unit))
        return [replace(self._visits[place]) for place in places]

    def within(
        self,
        seconds: float,
        chosen: Sequence[int],
        shortest: Timeline,
        rng: np.random.Generator,
    ) -> tuple[list[Visit], Timeline]:
        """Return the visits of the first of some units that fit into a duration, arranged."""
        visits = self.visits_of(chosen)
        timeline = self.arranged(visits, rng)
        while timeline.duration_s > seconds:
            visits = visits[: -self.in_unit]
            # Arranged anew without visits, it might get a longer warm-up.
            timeline = self.arranged(visits, rng) if visits else shortest
        return visits, timeline

    def arranged(self, visits: Sequence[Visit], rng: np.random.Generator) -> Timeline:
        """Return the experiment of some visits."""
        return arrange(visits, self._fixed, self._workspace, self._pace, rng)


def evaluated(
    model: ErrorModel,
    question: Question,
    experiment: Experiment,
    noise: MeasurementNoise,
    progress: Progress = silent,
) -> tuple[Information, dict[str, str]]:
    """Return what an experiment tells of the effects in question.

    Gives its information without the effects that lack a signal, and these with the signal.
    """
    sets = [*((effect,) for effect in question.nuisances), *question.effects]
    found = signatures(model, experiment.block, sets, progress)
    count = len(question.nuisances)
    lacking = {each.name: each.lacks for each in found[count:] if each.lacks}
    shown = [each for each in found[count:] if not each.lacks]
    known = information(experiment, found[:count], question.free, shown, model.table, noise)
    return known, lacking
