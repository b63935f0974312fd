"""Many wrists on a terminal: a line for each recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from wrist_stiffness.comparing.wiring import LOOK_FIRST
from wrist_stiffness.inference.noise import at_most
from wrist_stiffness.numerals import number
from wrist_stiffness.report.page import Table, title

if TYPE_CHECKING:
    from wrist_stiffness.commands.fleet import Row

Values = dict[str, Any]
Rows: TypeAlias = "Sequence[Row]"

POSE = ("s_um", "phi_mdeg")
"""Quantities that have columns where nothing was measured."""

OPEN = {"unknown": "something unknown", "undecided": "not decided"}
"""What is said of verdicts beside what is named."""


def compared_lines(rows: Rows) -> list[str]:
    """Return each model against each recording, from what `compare` gives for a program."""
    keys = _keys(rows, "instrument_noise")

    def cells(values: Values, place: int) -> list[str]:
        model, noise = values["models"][place], values["instrument_noise"]
        found = []
        for key in keys:
            size = model["after_registration"].get(key)
            own = ["-", "-"] if size is None else [number(size["rms"]), _noise(values, noise[key])]
            found += own
        depends = model["depends_on"]
        return [*found, depends[0]["condition"] if depends else "nothing beyond chance"]

    def mistakes(values: Values) -> list[str]:
        return [sentence for sentence in values["verdict"] if sentence.startswith(LOOK_FIRST)]

    compared = [row.result["models"] for row in rows if row.result is not None]
    tables = []
    for place, model in enumerate(compared[0] if compared else [None]):
        if model is not None:
            tables.append(f"{model['model']}, RMS with registrations, zeros, tare refitted")
        own = partial(cells, place=place)
        tables += _table(rows, keys, "strongest dependence", own, "compared")
        tables.append("")
    return [*tables[:-1], *_below(rows, mistakes)]


def diagnosed_lines(rows: Rows) -> list[str]:
    """Return what is missing in each recording, from what `diagnose` gives for a program."""
    keys = _keys(rows, "noise")

    def cells(values: Values) -> list[str]:
        found = []
        for key in keys:
            before, after = (values[when].get(f"rms_{key}") for when in ("before", "after"))
            fall = "-" if before is None else f"{number(before)} -> {number(after)}"
            found += [fall, "-" if before is None else _noise(values, values["noise"][key])]
        return [*found, _missing(values)]

    def mistakes(values: Values) -> list[str]:
        return [each for each in [values["set_up_mistake"]] if each]

    title = "held-out RMS, before and after what is missing is added, and instrument noise"
    return [title, *_table(rows, keys, "missing", cells, "diagnosed"), *_below(rows, mistakes)]


def _noise(values: Values, size: float) -> str:
    return f"{at_most(values['noise_known'])} {number(size)}".strip()


def _keys(rows: Rows, noise: str) -> Sequence[str]:
    """Return the quantities that were measured, each in one recording at least."""
    found = [row.result[noise] for row in rows if row.result is not None]
    return list(dict.fromkeys(key for keys in found for key in keys)) or POSE


def _table(
    rows: Rows, keys: Sequence[str], last: str, cells: Callable[[Values], list[str]], done: str
) -> list[str]:
    """Return a line for each recording."""
    lines = []
    for row in rows:
        if row.result is None:
            # The path stands before it already.
            why = row.error.removeprefix(f"{row.item}: ").removeprefix(f"{row.item} ")
            lines.append([str(row.item), *[""] * 2 * len(keys), f"not {done}: {why}"])
        else:
            lines.append([str(row.item), *cells(row.result)])
    sizes = [text for key in keys for text in (title(key), "noise")]
    table = Table("", ["recording", *sizes, last], lines)
    return table.lines()


def _below(rows: Rows, mistakes: Callable[[Values], list[str]]) -> list[str]:
    """Return the mistakes of the set-up that recordings show, and what is said of them alone."""
    below = []
    for row in rows:
        if row.result is not None:
            # Other notes are of a model, the same for all.
            own = tuple(f"{name}: " for name in row.result["provenance"]["recordings"])
            notes = [note.split(": ", 1)[1] for note in row.result["notes"] if note.startswith(own)]
            below += [f"{row.item}: {sentence}" for sentence in (*mistakes(row.result), *notes)]
    return ["", *below] if below else []


def _missing(values: Values) -> str:
    """Return what is missing: a class by its best member, and whether more is open."""
    named = []
    for finding in values["findings"]:
        best, *others = (f"{each['effect']}@{each['component']}" for each in finding["class"])
        named.append(f"{best} (or {len(others)} more)" if others else best)
    if values["verdict"] in OPEN:
        named.append(OPEN[values["verdict"]])
    ended = "" if values["complete"] else f" ({values['ended']})"
    return f"{', '.join(named) or 'nothing'}{ended}"
