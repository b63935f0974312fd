"""Tables of the results, in Markdown: every rate with its Wilson interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
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
        values = np.array([line[name] for line in lines if line[name] is not None], dtype=float)
        if len(values) == 0:
            return "-"
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


def paired(lines: Sequence[Line], solver: str, other: str) -> str:
    """Return a table of how often two solvers are right on the same cases, by size.

    The interval of a difference is that of Newcombe (1998, method 10) for paired rates.
    """
    by_key = {
        name: {line["key"]: line for line in lines if line["solver"] == name}
        for name in (solver, other)
    }
    keys = sorted(by_key[solver].keys() & by_key[other].keys())
    if not keys:
        return f"`{other}` and `{solver}` share no case yet."
    rows = [
        f"| size | cases | asked | {solver} | {other} | difference |",
        "|---|---|---|---|---|---|",
    ]
    sizes = sorted({by_key[other][key]["size"] for key in keys})
    for size in [*sizes, None]:
        mine = [key for key in keys if size in (None, by_key[other][key]["size"])]
        for name, test in (("inside first class", "inside"), ("right top answer", "top")):
            one = np.array([by_key[solver][key][test] for key in mine], dtype=bool)
            two = np.array([by_key[other][key][test] for key in mine], dtype=bool)
            low, high = newcombe(one, two)
            gap = 100 * (one.mean() - two.mean())
            rows.append(
                f"| {'all' if size is None else f'{size:g}'} | {len(mine)} | {name} | "
                f"{100 * one.mean():.0f} % | {100 * two.mean():.0f} % | "
                f"{gap:+.0f} ({100 * low:+.0f} to {100 * high:+.0f}) |"
            )
    return "\n".join(rows)


def newcombe(one: NDArray[np.bool_], two: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two rates on the same n cases."""
    n = len(one)
    p, q = float(one.mean()), float(two.mean())
    (p_low, p_high), (q_low, q_high) = wilson(int(one.sum()), n), wilson(int(two.sum()), n)
    both, neither = float(np.mean(one & two)), float(np.mean(~one & ~two))
    product = p * (1 - p) * q * (1 - q)
    phi = (both * neither - (p - both) * (q - both)) / np.sqrt(product) if product > 0.0 else 0.0
    low = (p - p_low) ** 2 - 2 * phi * (p - p_low) * (q_high - q) + (q_high - q) ** 2
    high = (p_high - p) ** 2 - 2 * phi * (p_high - p) * (q - q_low) + (q - q_low) ** 2
    return p - q - float(np.sqrt(max(low, 0.0))), p - q + float(np.sqrt(max(high, 0.0)))


SHOWING = (0.0, 6.0, 12.0, 25.0, 50.0)
"""Steps of the length of what is left of a signature, in standard deviations."""

COUNT: Column = ("cases", lambda lines: str(len(lines)))
TOP: Column = ("right top answer", rate_of(lambda line: line["top"]))
INSIDE: Column = ("inside first class", rate_of(lambda line: line["inside"]))
SIZE: Column = ("class size", class_size)
SPURIOUS: Column = ("spurious", mean_of("spurious"))
BEFORE: Column = ("error before", median_of("before"))
AFTER: Column = ("after", median_of("after"))
SUSPECTS: Column = ("with suspects", median_of("after_with_suspects"))


def says(verdict: str) -> Column:
    """Return the column of a verdict."""
    return f"says {verdict}", rate_of(lambda line: line["verdict"] == verdict)


NAMES: Column = ("names an effect", rate_of(lambda line: bool(line["named"])))
SINGLE = [
    COUNT,
    TOP,
    INSIDE,
    SIZE,
    says("none"),
    says("unknown"),
    SPURIOUS,
    BEFORE,
    AFTER,
    SUSPECTS,
]
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
    "absorbed": (
        "One effect that the tolerances of the base take up",
        [COUNT, says("none"), says("unknown"), SPURIOUS, TOP, AFTER],
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
            SUSPECTS,
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
    """Return a table of all solvers for each kind of case in the main design."""
    parts = []
    for kind, (title, columns) in KINDS.items():
        mine = [line for line in lines if line["kind"] == kind and line["main"]]
        for plausible, note in ((True, ""), (False, ", larger than on any wrist that still works")):
            some = [line for line in mine if line["plausible"] == plausible]
            if some:
                parts.append(f"**{title}{note}**\n\n{table(some, 'solver', columns)}")
    return "\n\n".join(parts)


def of_one_solver(lines: Sequence[Line], solver: str) -> str:
    """Return tables of one solver: by effect, size, base, experiment, instrument and truth."""
    own = [line for line in lines if line["solver"] == solver]
    single = [line for line in own if line["kind"] == "single"]
    main = [line for line in single if line["main"]]
    if not main:
        return f"No single effect was put to `{solver}` yet."
    likely = [line for line in main if line["plausible"]]
    elsewhere = [line for line in single if line["path"] == "fast"]
    posed = [line for line in own if line["main"] and _alone(line)]
    parts = [
        ("one effect that a wrist may have, main design: which", likely, "effect"),
        ("how much is left of them beyond the base", [_seen(each) for each in likely], "from"),
        ("how large, plausible ones", likely, "size"),
        ("how large, all that can be seen", main, "size"),
        ("how large, seen or not", posed, "size"),
        ("on which base", elsewhere, "base"),
        ("in which experiment", elsewhere, "experiment"),
        ("measured by what", elsewhere, "measured"),
        ("true by which path (effects at rest, CMM)", _both_paths(single), "path"),
    ]
    return "\n\n".join(
        f"**`{solver}`, {title}**\n\n{table(mine, group, SINGLE)}"
        for title, mine, group in parts
        if mine
    )


def _seen(line: Line) -> Line:
    """Return a line with the standard deviations from which on its effect shows."""
    return line | {"from": max(step for step in SHOWING if line["detectability"] >= step)}


def _alone(line: Line) -> bool:
    return line["kind"] in ("single", "absorbed", "unexcitable") and "+" not in line["effect"]


def _both_paths(lines: Sequence[Line]) -> list[Line]:
    """Return the exact cases, and those of the fast path with the same effects and instrument."""
    exact = {line["effect"] for line in lines if line["path"] == "exact"}
    return [
        line for line in lines if line["effect"] in exact and line["measured"].startswith("cmm")
    ]
