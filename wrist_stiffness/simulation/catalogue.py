"""The laws by their catalogue names: places, forms, sizes, and how to make one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.simulation import makers, strangers
from wrist_stiffness.simulation.effect_entry import Draw, Entry
from wrist_stiffness.simulation.laws.law import Law


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden effect: everything that is needed to make its law again."""

    effect: str
    component: str
    form: str
    magnitude: float  # in the unit of the catalogue's entry (SI)
    shape_seed: int  # draws directions, phases and time constants


CATALOGUE = {name: each for name, each in vars(makers).items() if isinstance(each, Entry)}
"""Effects that a diagnosis knows by name, in the order in which seeds draw them."""

STRANGERS = {name: each for name, each in vars(strangers).items() if isinstance(each, Entry)}
"""Effects that nobody has thought of."""

ALL = CATALOGUE | STRANGERS


def places(entries: dict[str, Entry]) -> list[tuple[str, str, str]]:
    """Return every (effect, component, form) that makes a law."""
    return [
        (effect, component, form)
        for effect, entry in entries.items()
        for component in entry.components
        for form in entry.forms
        if not (effect == "gravity" and form == "tilt" and component != "platform")
    ]


def is_plausible(hidden: HiddenEffect) -> bool:
    """Return whether a wrist with this effect still works."""
    return abs(hidden.magnitude) <= ALL[hidden.effect].largest


def build(hidden: HiddenEffect, table: Table) -> Law:
    """Make the law of a hidden effect.

    Gives `Law`: with a history of its own: one law for one run.  Raises `InputError` if effect,
    place or form is not in the catalogue, or the magnitude beyond its limit.
    """
    entry = ALL.get(hidden.effect)
    if entry is None:
        raise InputError(f"effect {hidden.effect!r} is not one of {', '.join(ALL)}")
    for what, value, allowed in (
        ("component", hidden.component, entry.components),
        ("form", hidden.form, entry.forms),
    ):
        if value not in allowed:
            raise InputError(
                f"{hidden.effect}: {what} {value!r} is not one of {', '.join(allowed)}"
            )
    if not abs(hidden.magnitude) <= entry.limit:
        raise InputError(
            f"{hidden.effect}: magnitude {hidden.magnitude:g} {entry.unit} is beyond the limit of "
            f"{entry.limit:g} {entry.unit}"
        )
    rng = np.random.default_rng(hidden.shape_seed)
    return entry.make(Draw(table, hidden.component, hidden.form, hidden.magnitude, rng))
