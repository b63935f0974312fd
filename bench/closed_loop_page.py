"""The page of the closed loop: which effects the corrector cancels once the model has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).parents[1] / "docs" / "closed-loop.md"
BEGIN, END = "<!-- table -->\n", "<!-- end of table -->\n"

ENOUGH = 1.2
"""Times the floor."""

SEEN = 1.2
"""An effect makes a pointing error when the old model leaves more than that many floors."""

HEADER = (
    "| hidden effect | size | diagnosed as | pointing before → after [mdeg] | floor [mdeg] "
    "| moving, after [mdeg] | turns | shift before → after [µm] | compensable |\n"
    "|---|---|---|---|---|---|---|---|---|\n"
)


def write_page(rows: Sequence[Mapping[str, Any]]) -> None:
    """Put the table between its marks in the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    lines = "".join(line(row) + "\n" for row in rows)
    PAGE.write_text(before + BEGIN + HEADER + lines + END + after, encoding="utf-8")


def line(row: Mapping[str, Any]) -> str:
    """Return one row of the table."""
    old, new, floor = row["old"], row["extended"], row["floor"]
    cells = (
        row["name"].removesuffix(":plain"),
        f"{row['magnitude']:.2g} {row['unit']}".removesuffix(" -"),
        diagnosed(row),
        f"{mdeg(old['resting'])} → {mdeg(new['resting'])}",
        mdeg(floor["resting"]),
        mdeg(new["moving"]),
        f"{new['turns']} / {row['ideal']['turns']}",
        f"{um(old['shift'])} → {um(new['shift'])}",
        answer(row),
    )
    return f"| {' | '.join(cells)} |"


def diagnosed(row: Mapping[str, Any]) -> str:
    """Return what the diagnosis named, best first."""
    if row["told"]:
        return "(told)"
    return "; ".join(" or ".join(names) for names in row["findings"]) or "nothing"


def answer(row: Mapping[str, Any]) -> str:
    """Return whether the corrector cancels it, as measured."""
    floor = row["floor"]["resting"]
    if row["compensable"] == "no":
        harm = row["extended"]["resting"] > SEEN * floor
        return "no: in the instrument" + (", **and the fit does harm**" if harm else "")
    said = "yes" if row["compensable"] == "yes" else "with its signal"
    if row["old"]["resting"] <= SEEN * floor:
        return f"{said}: makes no pointing error above the floor"
    ratio = row["extended"]["resting"] / floor
    return f"{said}: {ratio:.2f} × floor" + ("" if ratio <= ENOUGH else ", **not reached**")


def mdeg(angle: float) -> str:
    """Return an angle [rad] in mdeg."""
    return f"{1e3 * np.degrees(angle):.1f}"


def um(length: float) -> str:
    """Return a length [m] in um."""
    return f"{1e6 * length:.2f}"
