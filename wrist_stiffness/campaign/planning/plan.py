"""Plan an experiment: for commissioning, or between the rivals that a diagnosis left.

What effects would leave is computed with the model on a pool of settings performed as one
experiment; settings are chosen by their Gram matrices; what the chosen experiment will settle is
computed again on its own path, in its own order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.campaign.planning.choice import LOOKED_AT, choose
from wrist_stiffness.campaign.planning.goals import all_goals, nearest, needed
from wrist_stiffness.campaign.planning.information import (
    Goal,
    Information,
    MeasurementNoise,
    by_truth,
    calibrated,
    carried_over,
    discrimination,
    improvement,
    information,
    wrong_bound,
)
from wrist_stiffness.campaign.planning.loads_file import Source
from wrist_stiffness.campaign.planning.pool import (
    Setting,
    arrange,
    draw_settings,
    fixed_visits,
    moved_outward,
    reference_pose,
)
from wrist_stiffness.campaign.planning.question import SESSION, TARE, Question
from wrist_stiffness.campaign.planning.refit import rivals_alike
from wrist_stiffness.campaign.planning.signatures import signatures
from wrist_stiffness.campaign.planning.timeline import (
    Experiment,
    Pace,
    Timeline,
    Visit,
    run_through,
)
from wrist_stiffness.campaign.planning.truths import after_data, as_asked
from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel

LONGER = 10.0
"""What so many times the whole pool cannot separate counts as out of reach."""

LONGEST_S = 3600.0
"""Of a plan between rivals for which no duration is asked [s]."""

LIKELY = 0.5
"""Share of a rival's possible values for which a plan settles it; the next one knows which hold."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Conditions:
    """Under which an experiment is planned.

    Parameters
    ----------
    sources : tuple of Weight or Actuator
        What the user can apply; nothing else is proposed.
    pace : Pace
        Speeds and durations.
    noise : MeasurementNoise
        Of one dwell.
    seconds : float or None
        Duration; None for as long as it takes, but not beyond `LONGEST_S`.
    seed : int
        The same seed gives the same plan.
    """

    sources: tuple[Source, ...]
    pace: Pace
    noise: MeasurementNoise
    seconds: float | None
    seed: int


@dataclass(frozen=True)
class Answer:
    """How well the plan answers one question.

    Parameters
    ----------
    goal : Goal
        The question.
    discrimination : float
        Beyond what was measured before, in standard deviations.
    reachable : bool
        Whether `LONGER` times the pool with these loads could settle it.
    """

    goal: Goal
    discrimination: float
    reachable: bool

    @property
    def settled(self) -> bool:
        """Whether the plan settles it."""
        return self.discrimination >= needed(self.goal)


@dataclass(frozen=True, eq=False)
class Plan:
    """An experiment and what it is good for.

    Parameters
    ----------
    timeline : Timeline or None
        What to do when; None where no such experiment could answer any of the questions.
    visits : tuple of Visit
        Chosen ones, in the order of their worth.
    answers : tuple of Answer
        To every question.
    cannot : dict of str to str
        Effects that no such experiment shows, with the signal that they need.
    calibration : dict of str to float
        By how much the uncertainty of each effect that is always refitted falls.
    """

    timeline: Timeline | None
    visits: tuple[Visit, ...]
    answers: tuple[Answer, ...]
    cannot: Mapping[str, str]
    calibration: Mapping[str, float]


def plan(
    model: ErrorModel,
    question: Question,
    conditions: Conditions,
    earlier: Sequence[Experiment] = (),
    progress: Progress | None = None,
) -> Plan:
    """Plan an experiment.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    question : Question
        What is asked.
    conditions : Conditions
        Loads, durations, noise.
    earlier : sequence of Experiment
        What was measured on this wrist before, each with instruments set up anew.
    progress : callable, optional
        Called with (done, total).

    Returns
    -------
    Plan
        Not longer than asked for.

    Raises
    ------
    InputError
        If not even the fixed part fits into the duration.
    LoadRangeError
        If a load cannot be applied within the table's range.
    """
    workspace, pace = model.table.workspace, conditions.pace
    rng = np.random.default_rng(conditions.seed)
    settings = draw_settings(workspace, conditions.sources, model.table.geometry.gravity, rng)
    fixed = fixed_visits(settings, pace, workspace)
    whole = question.goals is None
    if not whole:
        settings += [moved_outward(setting, workspace) for setting in settings]
    order = rng.permutation(2 * len(settings))
    pool = _Pool(settings, fixed, order, pace, model, both_sides=whole)
    seconds = LONGEST_S if conditions.seconds is None else conditions.seconds
    shortest = pool.arranged([], rng)
    if shortest.duration_s > seconds:
        raise InputError(
            f"plan: {seconds / 60.0:g} minutes are less than the "
            f"{shortest.duration_s / 60.0:.1f} that "
            "warm-up, reference poses and two long holds take"
        )
    agree = bool(earlier and question.alike)
    stage = _Stages(progress, 2 + len(earlier) + agree)
    if agree:
        question = rivals_alike(model, question, earlier, conditions.noise, stage.next())
    known, lacking = evaluated(model, question, pool.timeline, conditions.noise, stage.next())
    question = question.without(lacking)
    before = [evaluated(model, question, e, conditions.noise, stage.next())[0] for e in earlier]
    goals = question.goals
    if goals is None:
        goals = all_goals(known)
    start = np.zeros_like(known.total)
    for each in before:
        start += carried_over(each, (*SESSION, TARE))
    if before:
        truths = after_data(start, known.layout, question.alike, rng)
    else:
        truths = as_asked(known, question.alike)
    grams, start, layout = truths.of(known.grams), truths.of(start), truths.layout
    total = grams.sum(axis=0)
    best = discrimination(start + LONGER * total, layout, goals, start)
    reachable = {goal: bool(d >= needed(goal)) for goal, d in zip(goals, best, strict=True)}
    aimed = [goal for goal in goals if reachable[goal]]
    if not aimed and not whole:
        least = [Answer(goal, float(d), False) for goal, d in zip(goals, best, strict=True)]
        return Plan(None, (), tuple(least), lacking, {})
    if whole:
        aimed = nearest(aimed, discrimination(total, layout, aimed))

    def utility(gram: Array) -> Array:
        right = 1.0 - wrong_bound(discrimination(gram, layout, aimed, start)).mean(axis=-1)
        return right + calibrated(gram, layout) if whole else right

    def enough(gram: Array) -> bool:
        if conditions.seconds is not None:
            return False
        each = zip(aimed, by_truth(gram, layout, aimed, start), strict=True)
        return all(np.mean(d >= needed(goal)) >= LIKELY for goal, d in each)

    chosen = choose(
        pool.by_unit(grams),
        pool.cost_s,
        start + pool.fixed_gram(grams),
        seconds - shortest.duration_s,
        utility,
        enough,
        rng,
        LOOKED_AT if whole else len(pool.cost_s),
        per_second=conditions.seconds is not None,
    )
    visits = pool.visits_of(chosen)
    timeline = pool.arranged(visits, rng)
    while timeline.duration_s > seconds:
        visits = visits[: -pool.in_unit]
        # Arranged anew without visits, it might get a longer warm-up.
        timeline = pool.arranged(visits, rng) if visits else shortest
    final = evaluated(model, question, timeline, conditions.noise, stage.next())[0]
    reached = discrimination(start + truths.of(final.total), layout, goals, start)
    answers = [
        Answer(goal, float(d), reachable[goal]) for goal, d in zip(goals, reached, strict=True)
    ]
    return Plan(
        timeline,
        tuple(visits),
        tuple(answers),
        lacking,
        improvement(start + truths.of(final.total), layout),
    )


class _Stages:
    """One progress for several evaluations of about the same length."""

    def __init__(self, progress: Progress | None, count: int) -> None:
        self._progress, self._count, self._begun = progress, count, 0

    def next(self) -> Progress:
        """Return the progress of the next evaluation."""
        behind = self._begun
        self._begun += 1

        def told(done: int, total: int) -> None:
            if self._progress is not None:
                self._progress(behind * total + done, self._count * total)

        return told


class _Pool:
    """All settings, performed as one experiment, to be chosen as pairs of visits or singly."""

    def __init__(
        self,
        settings: Sequence[Setting],
        fixed: Sequence[Visit],
        order: NDArray[np.intp],
        pace: Pace,
        model: ErrorModel,
        both_sides: bool,
    ) -> None:
        self._fixed, self._pace = fixed, pace
        self._workspace = model.table.workspace
        self._visits = [visit for setting in settings for visit in setting.visits(pace.dwell_s)]
        self.in_unit = 2 if both_sides else 1
        ordered = [*(self._visits[i] for i in order), *fixed]
        reference = reference_pose(self._workspace)
        self.timeline = run_through(ordered, self._workspace, pace, reference)
        self._place = np.argsort(order)
        visit_s = np.diff(self.timeline.ends, prepend=0.0)
        self.cost_s = self.by_unit(visit_s)

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

    def arranged(self, visits: Sequence[Visit], rng: np.random.Generator) -> Timeline:
        """Return the experiment of some visits."""
        return arrange(visits, self._fixed, self._workspace, self._pace, rng)


def evaluated(
    model: ErrorModel,
    question: Question,
    experiment: Experiment,
    noise: MeasurementNoise,
    progress: Progress | None = None,
) -> tuple[Information, dict[str, str]]:
    """Return what an experiment tells of the effects in question.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    question : Question
        What is asked.
    experiment : Experiment
        Its path.
    noise : MeasurementNoise
        Of one dwell.
    progress : callable, optional
        Called with (done, total).

    Returns
    -------
    Information
        Without the effects that lack a signal.
    dict of str to str
        Those, and the signal.
    """
    sets = [*((effect,) for effect in question.nuisances), *question.effects]
    found = signatures(model, experiment.block, sets, progress)
    count = len(question.nuisances)
    lacking = {each.name: each.lacks for each in found[count:] if each.lacks}
    shown = [each for each in found[count:] if not each.lacks]
    known = information(experiment, found[:count], question.free, shown, model.table, noise)
    return known, lacking
