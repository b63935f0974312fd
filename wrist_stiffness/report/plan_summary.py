"""What a plan will settle and what it cannot, in words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from wrist_stiffness.planning.aims import LONGER, Answer
from wrist_stiffness.planning.information import chance_right
from wrist_stiffness.planning.plan import Plan

if TYPE_CHECKING:
    from wrist_stiffness.commands.plan import Planned

MOST_LINES = 15
"""Of each list; the rest is counted."""


def plan_summary(planned: Planned) -> str:
    """Return what a technician wants to know of a plan, as lines."""
    plan, question = planned.plan, planned.question
    lines = [_what(plan)]
    seen = [a for a in plan.answers if not a.goal.rival]
    blind = {a.goal.truth for a in seen if not a.settled}
    pairs = [
        a
        for a in plan.answers
        if a.goal.rival and a.goal.truth not in blind and a.goal.rival not in blind
    ]
    if question.goals is None:
        lines += ["", f"sees {len(seen) - len(blind)} of {len(seen)} effects of plausible size"]
        lines += [f"keeps apart {sum(a.settled for a in pairs)} of {len(pairs)} ordered pairs"]
    settled = [a for a in plan.answers if a.settled]
    if question.goals is not None:
        lines += _listed("will settle:", map(_line, settled))
    longer = [a for a in (*seen, *pairs) if not a.settled and a.reachable]
    lines += _listed(
        "may stay open; diagnose the new recordings too and plan again, or give it more time:",
        map(_line, _weakest(longer)),
    )
    never = [a for a in (*seen, *pairs) if not a.reachable]
    lines += _listed(
        f"no experiment of this kind with these loads settles, even {LONGER:g} times as long as "
        "all settings that were considered:",
        map(_line, _weakest(never)),
    )
    lines += _listed(
        "not for poses and loads to show:",
        (f"{name}: needs {signal}" for name, signal in plan.cannot.items()),
    )
    if question.goals is None:
        lines += _listed(
            "calibration: uncertainty falls by the factor",
            (f"{name}  {factor:.1f}" for name, factor in plan.calibration.items()),
            len(plan.calibration),
        )
    return "\n".join(lines)


def _what(plan: Plan) -> str:
    if plan.timeline is None:
        return "no plan: nothing that these loads allow would settle any of the questions"
    loads = sorted({visit.load.name for visit in plan.visits if visit.load.name})
    poses = len({tuple(visit.theta) for visit in plan.visits})
    return (
        f"{plan.timeline.duration_s / 60.0:.1f} minutes: {len(plan.visits)} approaches to {poses} "
        f"poses; {len(plan.timeline.dwells)} measurements at rest; "
        f"loads: {', '.join(loads) or 'none'}"
    )


def _weakest(answers: list[Answer]) -> list[Answer]:
    return sorted(answers, key=lambda answer: answer.discrimination)


def _line(answer: Answer) -> str:
    goal, d = answer.goal, answer.discrimination
    if not goal.rival:
        return f"{goal.truth} against nothing: {d:.1f} standard deviations"
    right = 100.0 * float(chance_right(d))
    return (
        f"{goal.truth} if true, against {goal.rival}: {d:.1f} standard deviations, right in "
        f"{min(right, 99.9):.1f} %"
    )


def _listed(title: str, lines: Iterable[str], most: int = MOST_LINES) -> list[str]:
    found = list(lines)
    if not found:
        return []
    more = [f"  and {len(found) - most} more (--json has all)"] if len(found) > most else []
    return ["", title, *(f"  {line}" for line in found[:most]), *more]
