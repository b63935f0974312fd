"""Tell how often a search was right on the fresh riddles, and whether its probabilities hold.

python bench/hidden_effects/told.py RESULTS.jsonl [--picture reliability.png]

A probability holds if what is called 80 % sure is right four times in five.  The calibration error
is the mean distance between the two over bins of probability, weighted by their counts (Naeini,
Cooper and Hauskrecht 2015).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rates import wilson

from wrist_stiffness.report.pictures.figure import new_figure, save_figure

Line = dict[str, Any]
Array = NDArray[np.float64]

BINS = np.array([0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])


def right(line: Line, names: Sequence[str]) -> bool:
    """Return whether a class of names holds a true one."""
    return bool(set(names) & set(line["truth"]))


def spurious(line: Line) -> int:
    """Return how many of the named classes hold no true name."""
    return sum(not right(line, names) for names in line["named"])


def claims(lines: Sequence[Line]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the probability of every class that was found or suspected, and whether it is true."""
    told = [
        (probability, right(line, names))
        for line in lines
        for names, probability in [
            *zip(line["named"], line["probabilities"], strict=True),
            *[each[:2] for each in line["suspects"]],
        ]
    ]
    return np.array([p for p, _ in told]), np.array([ok for _, ok in told], dtype=bool)


def verdicts(lines: Sequence[Line]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the probability of every verdict, and whether it is right."""
    told = [(line["probability"], said(line) == expected(line)) for line in lines]
    return np.array([p for p, _ in told]), np.array([ok for _, ok in told], dtype=bool)


def said(line: Line) -> str:
    """Return the verdict whose probability is told: where nothing is decided, that of `none`."""
    return "none" if line["verdict"] == "undecided" else line["verdict"]


def expected(line: Line) -> str:
    """Return the right verdict."""
    if not line["truth"]:
        return "none"
    return "unknown" if line["kind"] == "stranger" else "effect"


def binned(probability: Array, true: NDArray[np.bool_]) -> list[tuple[float, int, int]]:
    """Return mean probability, count and true ones of each bin that is not empty."""
    place = np.clip(np.digitize(probability, BINS) - 1, 0, len(BINS) - 2)
    return [
        (float(probability[on].mean()), int(on.sum()), int(true[on].sum()))
        for on in (place == number for number in range(len(BINS) - 1))
        if on.any()
    ]


def calibration_error(probability: Array, true: NDArray[np.bool_]) -> float:
    """Return the mean distance between what is said and what is so."""
    bins = binned(probability, true)
    return sum(count * abs(mean - hits / count) for mean, count, hits in bins) / len(true)


def rows(
    likely: Sequence[Line], large: Sequence[Line]
) -> list[tuple[str, Sequence[Line], Callable[[Line], bool]]]:
    """Return what is counted, of which riddles, and when it counts."""

    def group(name: str) -> list[Line]:
        return [line for line in likely if line["group"] == name]

    single = [x for x in group("single") if x["kind"] == "single"]
    double = [x for x in group("double") if x["kind"] == "double"]
    outside = [x for x in group("outside") if x["kind"] == "stranger"]
    days = [x for x in group("two_days") if x["kind"] == "single"]
    named = [x for x in large if x["kind"] in ("single", "double")]

    def in_class(line: Line) -> bool:
        return bool(line["inside"])

    return [
        ("nothing hides: something is named", group("nothing"), lambda x: bool(x["named"])),
        ("nothing hides: *unknown*", group("nothing"), lambda x: x["verdict"] == "unknown"),
        (
            "the same, dense tracker of unstated noise: not *none*",
            group("nothing_dense"),
            lambda x: said(x) != "none",
        ),
        ("one effect: right in the class", single, in_class),
        ("one effect: a false class", single, lambda x: spurious(x) > 0),
        ("two effects: both found", double, lambda x: x["found"] == 1.0),
        ("outside the catalogue: nothing is named", outside, lambda x: not x["named"]),
        ("two days, one effect: right in the class", days, in_class),
        ("all: a false class", likely, lambda x: spurious(x) > 0),
        ("larger than on a wrist that still works: right in the class", named, in_class),
        (
            "larger than on a wrist that still works: a false class",
            large,
            lambda x: spurious(x) > 0,
        ),
    ]


def draw(lines: Sequence[Line], path: Path) -> None:
    """Draw the reliability of classes and verdicts."""
    figure = new_figure(4.6, 4.2)
    axes = figure.subplots()
    axes.plot([0, 100], [0, 100], color="0.6", lw=1)
    for (name, told), mark in zip(
        {"effects": claims(lines), "verdicts": verdicts(lines)}.items(), "os", strict=True
    ):
        bins = binned(*told)
        mean = [100.0 * each[0] for each in bins]
        rate = np.array([100.0 * hits / count for _, count, hits in bins])
        ends = np.array([[100.0 * e for e in wilson(hits, count)] for _, count, hits in bins]).T
        axes.errorbar(mean, rate, np.abs(ends - rate), fmt=mark, capsize=3, label=name)
    axes.set(xlabel="probability that is told [%]", ylabel="how often it is so [%]")
    axes.legend(loc="upper left")
    save_figure(figure, path)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    found = [json.loads(line) for line in given.results.read_text().splitlines()]
    lines = [line for line in found if "verdict" in line]
    likely = [line for line in lines if line["plausible"]]
    large = [line for line in lines if not line["plausible"]]
    print(
        f"{len(found)} riddles, {len(lines)} answered, {len(large)} of them larger than on a wrist"
    )
    print("that still works: these count in the last two rows alone\n")
    print("| | cases | rate | 95 % interval |\n|---|---|---|---|")
    for name, own, counts in rows(likely, large):
        hits = sum(counts(line) for line in own)
        low, high = wilson(hits, len(own))
        rate = f"{100 * hits / len(own):.0f} %" if own else "-"
        print(f"| {name} | {hits} of {len(own)} | {rate} | {100 * low:.0f} to {100 * high:.0f} |")
    for name, told in {"effects": claims(likely), "verdicts": verdicts(likely)}.items():
        print(f"\ncalibration error of {name}: {calibration_error(*told):.3f} of {len(told[1])}")
        for mean, count, hits in binned(*told):
            print(f"  told {100 * mean:3.0f} %: {hits} of {count}")
    spent = np.array([line["cpu_s"] for line in lines])
    print(f"\nCPU: median {np.median(spent):.0f} s, 90 % {np.quantile(spent, 0.9):.0f} s")
    print(f"longest {spent.max():.0f} s")
    if given.picture:
        draw(likely, given.picture)


if __name__ == "__main__":
    main()
