"""What set-up and tolerances took up of the error, as a table or in lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from wrist_stiffness.identification.taken_up import TakenUp
from wrist_stiffness.numerals import number
from wrist_stiffness.report.page import Table, title

USUAL = 1.0
"""Standard deviations of its prior within which a tolerance needs no line of its own."""


def absorbed_table(absorbed: Sequence[TakenUp], keys: Iterable[str]) -> Table:
    """Return what set-up and tolerances took up, the same for every report.

    `keys`: of the quantities that were measured.
    """
    titles = {key.rpartition("_")[0]: title(key) for key in keys}
    rows = [
        (
            each.name,
            *(number(each.moved[name]) for name in titles),
            f"{each.parameter} = {number(each.value)}" if each.parameter else "",
            f"{each.deviations:.1f}" if each.parameter else "-",
        )
        for each in absorbed
    ]
    caption = (
        "By how much set-up and tolerances moved the prediction (RMS), and the parameter that went "
        "furthest from its drawing, in standard deviations of its prior."
    )
    return Table(caption, ("", *titles.values(), "furthest", "deviations"), rows)


def absorbed_lines(absorbed: Sequence[TakenUp]) -> list[str]:
    """Return set-up and what left its usual range a line each, all the rest in one."""
    within = [each for each in absorbed if each.parameter and each.deviations <= USUAL]
    out = [each.sentence for each in absorbed if each not in within]
    if within:
        names = ", ".join(each.name for each in within)
        out.append(f"within {USUAL:g} standard deviation of their tolerances: {names}")
    return out
