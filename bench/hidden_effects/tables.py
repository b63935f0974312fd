"""Tables of the results, in Markdown: every rate with its Wilson interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from score import wilson

Line = dict[str, Any]
Column = tuple[str, Callable[[Sequence[Line]], str]]


def rate_of(test: Callable[[Line], bool]) -> Callable[[Sequence[Line]], str]:
    """Return the column of a rate."""

    def column(lines: Sequence[Line]) -> str:
        hits, n = sum(test(line) for line in lines), len(lines)
        low, high = wilson(hits, n)
        return f"{100 * hits / n:.0f} % ({100 * low:.0f}–{100 * high:.0f})"

    return column


def mean_of(name: str) -> Callable[[Sequence[Line]], str]:
    """Return the column of a mean with its standard error."""

    def column(lines: Sequence[Line]) -> str:
        values = np.array([line[name] for line in lines], dtype=float)
        error = values.std() / np.sqrt(max(len(values) - 1, 1))
        return f"{values.mean():.2f} ± {error:.2f}"

    return column


def median_of(name: str) -> Callable[[Sequence[Line]], str]:
    """Return the column of a median."""
    return lambda lines: f"{np.median([line[name] for line in lines]):.2f}"


def class_size(lines: Sequence[Line]) -> str:
    """Return the mean size of the first class where there is one."""
    sizes = [line["class_size"] for line in lines if line["class_size"]]
    return f"{np.mean(sizes):.1f}" if sizes else "-"


COUNT: Column = ("cases", lambda lines: str(len(lines)))
TOP: Column = ("right top answer", rate_of(lambda line: line["top"]))
INSIDE: Column = ("inside first class", rate_of(lambda line: line["inside"]))
SIZE: Column = ("class size", class_size)
SPURIOUS: Column = ("spurious", mean_of("spurious"))
BEFORE: Column = ("error before", median_of("before"))
AFTER: Column = ("after", median_of("after"))


def says(verdict: str) -> Column:
    """Return the column of a verdict."""
    return f"says {verdict}", rate_of(lambda line: line["verdict"] == verdict)


NAMES: Column = ("names an effect", rate_of(lambda line: bool(line["named"])))
SINGLE = [COUNT, TOP, INSIDE, SIZE, says("none"), says("unknown"), SPURIOUS, BEFORE, AFTER]
KINDS: dict[str, tuple[str, list[Column]]] = {
    "none": ("Nothing hides", [COUNT, NAMES, says("unknown"), SPURIOUS, AFTER]),
    "single": ("One effect, large enough to be seen", SINGLE),
    "double": (
        "Two effects",
        [COUNT, ("share found", mean_of("found")), INSIDE, SIZE, SPURIOUS, BEFORE, AFTER],
    ),
    "unexcitable": (
        "One effect that this experiment cannot show",
        [
            COUNT,
            says("none"),
            says("unknown"),
            SPURIOUS,
            ("listed as not excited", rate_of(lambda line: line["not_excited"])),
            AFTER,
        ],
    ),
    "stranger": (
        "An effect outside the catalogue",
        [COUNT, says("unknown"), says("effect"), says("none"), SPURIOUS, BEFORE, AFTER],
    ),
    "ordinary": (
        "An ordinary wrist, everything at once",
        [
            COUNT,
            ("share found", mean_of("found")),
            ("rank correlation", mean_of("rank_correlation")),
            SPURIOUS,
            BEFORE,
            AFTER,
        ],
    ),
}


def table(lines: Sequence[Line], group: str, columns: Sequence[Column]) -> str:
    """Return a table with a row for each value of `group`."""
    rows = [
        f"| {group} | " + " | ".join(name for name, _ in columns) + " |",
        "|---" * (len(columns) + 1) + "|",
    ]
    values = {line[group] for line in lines}
    for value in sorted(values, key=lambda v: (isinstance(v, str), v)):
        mine = [line for line in lines if line[group] == value]
        shown = f"{value:g}" if isinstance(value, float) else str(value)
        rows.append(f"| {shown} | " + " | ".join(column(mine) for _, column in columns) + " |")
    return "\n".join(rows)


def by_solver(lines: Sequence[Line]) -> str:
    """Return a table of all solvers for each kind of case."""
    parts = []
    for kind, (title, columns) in KINDS.items():
        mine = [line for line in lines if line["kind"] == kind]
        if mine:
            parts.append(f"**{title}**\n\n{table(mine, 'solver', columns)}")
    return "\n\n".join(parts)


def of_one_solver(lines: Sequence[Line], solver: str) -> str:
    """Return tables of one solver: by effect, size, experiment, instrument and truth."""
    own = [line for line in lines if line["solver"] == solver]
    single = [line for line in own if line["kind"] == "single"]
    if not single:
        return f"No single effect was put to `{solver}` yet."
    usual = [line for line in single if line["path"] == "fast"]
    parts = [
        f"**`{solver}`, one effect: which**\n\n{table(usual, 'effect', SINGLE)}",
        f"**How large** (all, seen or not)\n\n{table(_posed_alone(own), 'size', SINGLE)}",
        f"**On which base**\n\n{table(usual, 'base', SINGLE)}",
        f"**In which experiment**\n\n{table(usual, 'experiment', SINGLE)}",
        f"**Measured by what**\n\n{table(usual, 'measured', SINGLE)}",
        f"**True by which path** (effects at rest)\n\n{table(_both_paths(single), 'path', SINGLE)}",
    ]
    return "\n\n".join(parts)


def _posed_alone(lines: Sequence[Line]) -> list[Line]:
    """Return cases of one effect in the rich experiment, whether it can be seen or not."""
    return [
        line
        for line in lines
        if line["kind"] in ("single", "unexcitable")
        and "+" not in line["effect"]
        and line["experiment"] == "rich"
        and line["measured"] == "interferometer pose"
    ]


def _both_paths(lines: Sequence[Line]) -> list[Line]:
    """Return the exact cases, and those of the fast path with the same effects and instrument."""
    exact = {line["effect"] for line in lines if line["path"] == "exact"}
    return [
        line for line in lines if line["effect"] in exact and line["measured"].startswith("cmm")
    ]
