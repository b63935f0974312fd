"""What the refitted base took up of the error, and how far it had to go for it.

A tolerance at two standard deviations of its prior may be an effect that looks like it: an answer
that names nothing must say so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.identification.base_fit import BaseFit
from wrist_stiffness.sessions.gauges import GAUGES, TILTS
from wrist_stiffness.sessions.observing import without_mounting
from wrist_stiffness.sessions.unit_session import QUANTITIES


@dataclass(frozen=True)
class TakenUp:
    """One part of the base."""

    name: str  # effect and place, and the session where it is set up anew in each
    # root mean square by which it moved the prediction of what was measured, by quantity, in the
    # unit of its report
    moved: dict[str, float]
    # of a tolerance: the parameter that went furthest; empty for what has no prior
    parameter: str = ""
    # of that parameter: in the unit of its name, and in standard deviations of its prior
    value: float = 0.0
    deviations: float = 0.0

    @property
    def sentence(self) -> str:
        """One line for a person."""
        units = {q.name: q.unit for q in (*QUANTITIES, GAUGES, TILTS)}
        sizes = ", ".join(
            f"{size:.2f} {units[name]} of {name}" for name, size in self.moved.items()
        )
        if not self.parameter:
            return f"{self.name}: {sizes}"
        return (
            f"{self.name}: {sizes} ({self.parameter} = {self.value:.3g}, "
            f"{self.deviations:.1f} standard deviations of its prior)"
        )


def taken_up(base: BaseFit, sessions: Sequence[str]) -> tuple[TakenUp, ...]:
    """Tell what each part of a base took up: the set-up first, then tolerances, furthest first.

    `base`: fitted; `sessions`: their names.
    """
    groups: dict[str, list[int]] = {}
    for place, unknown in enumerate(base.problem.unknowns):
        if base.of_base[place]:
            name = unknown.effect.name
            where = "" if unknown.session is None else f" in {sessions[unknown.session]}"
            groups.setdefault(name + where, []).append(place)
    found = [_one(base, name, places) for name, places in groups.items()]
    return tuple(sorted(found, key=lambda each: (bool(each.parameter), -each.deviations)))


def _one(base: BaseFit, name: str, places: list[int]) -> TakenUp:
    table = base.problem.table
    change = without_mounting(table, base.columns[:, :, places] @ base.z[places])
    sizes = table.rms(change**2)
    moved = {q.name: sizes[q.key] for q in table.reported}
    known = [place for place in places if np.isfinite(base.prior_std[place])]
    if not known:
        return TakenUp(name, moved)
    far = max(known, key=lambda place: abs(base.z[place] / base.prior_std[place]))
    unknown = base.problem.unknowns[far]
    value = unknown.mean + float(base.z[far]) * unknown.step
    share = abs(float(base.z[far] / base.prior_std[far]))
    return TakenUp(name, moved, unknown.key, value, share)
