"""The page of the closed loop: which effects the corrector cancels once the model has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop_picture import draw

from wrist_stiffness.atomic_file import replacing

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "bench-results" / "closed-loop.md"
PICTURE = ROOT / "docs" / "pictures" / "closed-loop.png"

ENOUGH = 1.2
"""Times what a corrector leaves that knows the true laws."""

SEEN = 1.2
"""An effect makes a pointing error when the old model leaves more than that many floors."""

HARM = 1.1
"""The extended model does harm when it leaves so many times what the old one left."""

HOW = ("told", "diagnosed")

Row = Mapping[str, Any]
Rows = Mapping[tuple[str, ...], Row]

RESULTS = (
    "| hidden effect | fault | before | told | diagnosed as | after | perfect | floor | answer |\n"
    "|---|---|---|---|---|---|---|---|---|\n"
)
CALM = (
    "| hidden effect | makes: pointing [mdeg] | shift [µm] | motors can cancel "
    "| shift left, before → after [µm] | moving, after (perfect) [mdeg] "
    "| most turns at a reversal (perfect) | fastest change |\n"
    "|---|---|---|---|---|---|---|---|\n"
)
WRONG = (
    "| hidden effect | before | told | diagnosed as | after | floor |\n|---|---|---|---|---|---|\n"
)


def write_page(exact: Sequence[str], wrong: Sequence[str], rows: Rows) -> None:
    """Write the tables to `bench-results/`, and draw the picture of `docs/closed-loop.md`."""
    told = [name for name in exact if (name, "exact", "told") in rows]
    other = [name for name in wrong if (name, "wrong", "told") in rows]
    text = "".join(
        f"## {title}\n\n{header}" + "".join(f"| {line} |\n" for line in lines) + "\n"
        for title, header, lines in (
            ("Pointing error at rest [mdeg]", RESULTS, [result(name, rows) for name in told]),
            ("What motors can cancel", CALM, [calm(name, rows) for name in told]),
            ("The table deviates [mdeg]", WRONG, [on_wrong_base(name, rows) for name in other]),
        )
    )
    PAGE.parent.mkdir(exist_ok=True)
    with replacing(PAGE) as written:
        written.write_text(text, encoding="utf-8")
    shown = [name for name in told if shows(name, rows)]
    draw(shown, other, rows, PICTURE)


def shows(name: str, rows: Rows) -> bool:
    """Tell whether a model leaves more than the floor: the rest would be one heap of points."""
    known = [rows[name, "exact", how] for how in HOW if (name, "exact", how) in rows]
    left = [row[key]["resting"] for row in known for key in ("old", "extended") if key in row]
    return bool(max(left) > SEEN * known[0]["floor"]["resting"])


def result(name: str, rows: Rows) -> str:
    """Return the row of the pointing errors at rest."""
    told, found = rows[name, "exact", "told"], rows.get((name, "exact", "diagnosed"))
    magnitude = f"{told['magnitude']:.2g} {told['unit']}".removesuffix(" -")
    cells = (
        short(name),
        magnitude + (f", {told['size']:.2g} ×" if told["size"] else ""),
        mdeg(told["old"]["resting"]),
        mdeg(told["extended"]["resting"]),
        diagnosed(found),
        "-" if found is None else mdeg(found["extended"]["resting"]),
        mdeg(told["perfect"]["resting"]),
        mdeg(told["floor"]["resting"]),
        answer(told, found),
    )
    return " | ".join(cells)


def calm(name: str, rows: Rows) -> str:
    """Return the row of what motors can cancel, and of how calm they stay."""
    told = rows[name, "exact", "told"]
    made, after, perfect = told["made"], told["extended"], told["perfect"]
    share = "-" if np.isnan(made["share"]) else f"{100.0 * made['share']:.0f} %"
    cells = (
        short(name),
        mdeg(made["pointing"]),
        um(made["shift"]),
        share,
        f"{um(told['old']['shift'])} → {um(after['shift'])}",
        f"{mdeg(after['moving'])} ({mdeg(perfect['moving'])})",
        f"{after['most']} ({perfect['most']})",
        f"{100.0 * after['rate_share']:.1f} %",
    )
    return " | ".join(cells)


def on_wrong_base(name: str, rows: Rows) -> str:
    """Return the row of a wrist of which the table is wrong."""
    told, found = rows[name, "wrong", "told"], rows.get((name, "wrong", "diagnosed"))
    cells = (
        short(name),
        mdeg(told["old"]["resting"]),
        mdeg(told["extended"]["resting"]),
        diagnosed(found),
        "-" if found is None else mdeg(found["extended"]["resting"]),
        mdeg(told["floor"]["resting"]),
    )
    return " | ".join(cells)


def short(name: str) -> str:
    """Return a name without a form that says nothing."""
    return name.replace(":plain", "").replace("*", " × ")


def diagnosed(row: Row | None) -> str:
    """Return what the diagnosis named, best first."""
    if row is None:
        return "-"
    named = "; ".join(" or ".join(names[:3]) for names in row["findings"]) or "nothing"
    return named + (" (unknown)" if row["verdict"] == "unknown" else "")


def answer(told: Row, found: Row | None) -> str:
    """Return whether the corrector cancels it, as measured."""
    after = (found or told)["extended"]["resting"]
    old, floor, perfect = (told[key]["resting"] for key in ("old", "floor", "perfect"))
    harm = ", **but the fit does harm**" if after > HARM * max(old, SEEN * floor) else ""
    if told["made"]["pointing"] == 0.0 and told["made"]["shift"] == 0.0:
        return "no: the wrist stands where it stood" + harm
    said = "with its signal" if told["compensable"] == "needs_signal" else "yes"
    if old <= SEEN * floor:
        return "no need: its pointing error is below the floor" + harm
    if after <= ENOUGH * perfect:
        return f"{said}: {after / perfect:.2f} × perfect, {after / floor:.2f} × floor"
    if found is not None and told["extended"]["resting"] <= ENOUGH * perfect:
        return f"not as diagnosed: {after / perfect:.2f} × perfect" + harm
    return f"**not reached**: {after / perfect:.2f} × perfect, {after / floor:.2f} × floor" + harm


def mdeg(angle: float) -> str:
    """Return an angle [rad] in mdeg."""
    return f"{1e3 * np.degrees(angle):.1f}"


def um(length: float) -> str:
    """Return a length [m] in um."""
    return f"{1e6 * length:.2f}"
