"""Many wrists on a terminal: a line for each recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from wrist_stiffness.comparing.wiring import LOOK_FIRST
from wrist_stiffness.report.parts import TITLES

if TYPE_CHECKING:
    from wrist_stiffness.commands.fleet import Row

Values = dict[str, Any]
Rows: TypeAlias = "Sequence[Row]"


POSE = ("s_um", "phi_mdeg")
"""Quantities of poses, which have columns."""


def compared_lines(rows: Rows) -> list[str]:
    """Return the last model against each recording, from what `compare` gives for a program."""
    models = {row.result["models"][-1]["model"] for row in rows if row.result is not None}
    titles = f"{'s [um]':>10}{'noise':>8}{'phi [mdeg]':>12}{'noise':>8}  strongest dependence"
    return [
        *(f"{name}, RMS with registrations, zeros, tare refitted" for name in models),
        *_table(rows, titles, _comparison, "compared", _wired_wrong),
    ]


def diagnosed_lines(rows: Rows) -> list[str]:
    """Return what is missing in each recording, from what `diagnose` gives for a program."""
    titles = "".join(f"{TITLES[key]:>22}{'noise':>8}" for key in POSE) + "  missing"
    return [
        "held-out RMS, before and after what is missing is added, and instrument noise",
        *_table(
            rows,
            titles,
            _diagnosis,
            "diagnosed",
            lambda values: [each for each in [values["set_up_mistake"]] if each],
        ),
    ]


def _table(
    rows: Rows,
    titles: str,
    cells: Callable[[Values], str],
    undone: str,
    mistakes: Callable[[Values], Sequence[str]],
) -> list[str]:
    """Return a line for each recording, and below the mistakes of the set-up."""
    wide = max([len("recording"), *(len(str(row.item)) for row in rows)])
    out, below = [f"{'recording':{wide}}{titles}"], []
    for row in rows:
        if row.result is None:
            # The path stands before it already.
            why = row.error.removeprefix(f"{row.item}: ").removeprefix(f"{row.item} ")
            out.append(f"{row.item!s:{wide}}  not {undone}: {why}")
            continue
        out.append(f"{row.item!s:{wide}}{cells(row.result)}")
        below += [f"{row.item}: {sentence}" for sentence in mistakes(row.result)]
    return [*out, *(["", *below] if below else [])]


def _wired_wrong(values: Values) -> list[str]:
    return [sentence for sentence in values["verdict"] if sentence.startswith(LOOK_FIRST)]


def _comparison(values: Values) -> str:
    model = values["models"][-1]
    out = ""
    for key, width in (("s_um", 10), ("phi_mdeg", 12)):
        size = model["after_registration"].get(key)
        # A recording may lack a quantity.
        rms = "-" if size is None else f"{size['rms']:.3g}"
        noise = "-" if size is None else f"{values['instrument_noise'][key]:.3g}"
        out += f"{rms:>{width}}{noise:>8}"
    depends = model["depends_on"]
    return f"{out}  {depends[0]['condition'] if depends else 'nothing beyond chance'}"


def _diagnosis(values: Values) -> str:
    out = ""
    for key in POSE:
        before, after = (values[when].get(f"rms_{key}") for when in ("before", "after"))
        noise = values["noise"].get(key)
        fall = "-" if before is None else f"{before:.3g} -> {after:.3g}"
        out += f"{fall:>22}{'-' if noise is None else f'{noise:.3g}':>8}"
    return f"{out}  {_missing(values)}"


def _missing(values: Values) -> str:
    """Return what is missing: a class by its best member, and whether more is unknown."""
    named = []
    for finding in values["findings"]:
        best, *others = (f"{each['effect']}@{each['component']}" for each in finding["class"])
        named.append(f"{best} (or {len(others)} more)" if others else best)
    if values["verdict"] == "unknown":
        named.append("something unknown")
    return ", ".join(named) or "nothing"
