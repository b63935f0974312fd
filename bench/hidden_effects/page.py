"""Write the results of the benchmark as a page with pictures.

python bench/hidden_effects/page.py [--results FILE] [--output FOLDER] [--all-code]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from aims import CEILING, OWN, aims
from cases import SIZES, TINY
from run import SOLVERS, current, read
from score import wilson
from tables import Line, by_solver, of_one_solver, paired

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.report.pictures.figure import new_figure, save_figure

SHOWN = {CEILING: "D", OWN: "o", "elastic_net": "^", "stepwise_bic": "v"}
SHOWN_SIZES = (TINY, *SIZES)


def text_of(lines: Sequence[Line]) -> str:
    """Return the part of the page that the results write."""
    scored = [line for line in lines if "verdict" in line]
    if not scored:
        return "No results yet."
    unreached = len({line["key"] for line in lines if "out_of_reach" in line})
    failed = Counter(line["solver"] for line in lines if "error" in line)
    failures = ", ".join(f"{name}: {count}" for name, count in sorted(failed.items())) or "none"
    main = [line for line in scored if line["main"]]
    versions = Counter(line["version"] for line in scored if line["solver"] == OWN)
    code = ", ".join(f"`{version}` ({count})" for version, count in versions.most_common())
    return "\n\n".join(
        [
            f"{_posed(scored)}. {unreached} more cannot even be half as large as wanted. "
            f"Answers that failed with an error: {failures}. Code of `{OWN}`: {code or '-'}.",
            f"**Aims** (main design: wrong base, rich experiment, interferometer or tracker; "
            f"effects that a wrist may have)\n\n{aims([x for x in main if x['plausible']])}",
            f"**The same with magnitudes that no working wrist has**\n\n{aims(main)}",
            by_solver(scored),
            f"**Against the ceiling**, effects that a wrist may have and that can be seen\n\n"
            f"{paired([x for x in scored if _fair(x)], OWN, CEILING)}",
            "![Right answers by size](hidden_effects_by_size.png)",
            "![Right answers by effect](hidden_effects_by_effect.png)",
            of_one_solver(scored, OWN),
        ]
    )


def _fair(line: Line) -> bool:
    return bool(line["kind"] == "single" and line["main"] and line["plausible"])


def _posed(scored: Sequence[Line]) -> str:
    """Return how many riddles there were of each kind."""
    kinds = Counter({line["key"]: line["kind"] for line in scored}.values())
    counts = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items()))
    main = len({line["key"] for line in scored if line["main"]})
    own = [line for line in scored if line["solver"] == OWN]
    seconds = np.median([line["seconds"] for line in own]) if own else np.nan
    posing = np.median([line["posed_s"] for line in scored])
    return (
        f"{sum(kinds.values())} riddles posed, {main} of them in the main design ({counts}); "
        f"median {posing:.1f} s to pose one and {seconds:.1f} s for a diagnosis"
    )


def _rates(lines: Sequence[Line]) -> tuple[float, float, float]:
    hits = sum(line["inside"] for line in lines)
    return hits / len(lines), *wilson(hits, len(lines))


def draw_sizes(lines: Sequence[Line], path: Path) -> None:
    """Draw how often the first class is right against the size of the effect."""
    figure = new_figure(6.4, 3.6)
    axes = figure.subplots()
    for place, (solver, marker) in enumerate(SHOWN.items()):
        mine = [line for line in lines if line["solver"] == solver and _fair(line)]
        sizes = sorted({line["size"] for line in mine})
        if not sizes:
            continue
        rates = np.array([_rates([x for x in mine if x["size"] == size]) for size in sizes]).T
        # Beside each other, for equal rates hide each other.
        axes.errorbar(
            np.array(sizes) * 1.06**place,
            100 * rates[0],
            100 * np.abs(rates[1:] - rates[0]),
            marker=marker,
            capsize=3,
            label=solver,
        )
    axes.set_xscale("log")
    axes.set_xticks(SHOWN_SIZES, [f"{size:g}" for size in SHOWN_SIZES])
    axes.minorticks_off()
    axes.set_ylim(0, 102)
    axes.set_xlabel("size of the hidden effect, in noise of one sample")
    axes.set_ylabel("true effect inside the first class [%]")
    figure.legend(fontsize=8, loc="outside upper center", ncols=len(SHOWN))
    axes.grid(alpha=0.3)
    save_figure(figure, path)


def draw_effects(lines: Sequence[Line], path: Path) -> None:
    """Draw how often the project's diagnosis has the true effect inside its first class."""
    mine = [line for line in lines if line["solver"] == OWN and _fair(line)]
    effects = sorted({line["effect"] for line in mine}, reverse=True)
    if not effects:
        return
    figure = new_figure(6.4, 0.24 * len(effects) + 1.0)
    axes = figure.subplots()
    rates = np.array([_rates([x for x in mine if x["effect"] == effect]) for effect in effects]).T
    place = np.arange(len(effects))
    axes.barh(place, 100 * rates[0], color="0.75")
    spread = 100 * np.abs(rates[1:] - rates[0])
    axes.errorbar(100 * rates[0], place, xerr=spread, fmt="none", ecolor="0.2", capsize=2)
    counts = Counter(line["effect"] for line in mine)
    axes.set_yticks(place, [f"{effect} ({counts[effect]})" for effect in effects], fontsize=7)
    axes.set_ylim(-0.7, len(effects) - 0.3)
    axes.set_xlim(0, 102)
    axes.set_xlabel("true effect inside the first class of own_diagnosis [%], 95 % interval")
    save_figure(figure, path)


def main() -> None:
    """Write tables and pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    here = Path(__file__).parent
    parser.add_argument("--results", type=Path, default=here / "results" / "full.jsonl")
    parser.add_argument("--output", type=Path, default=here.parents[1] / "bench-results")
    parser.add_argument(
        "--all-code", action="store_true", help="also answers that other code than today's gave"
    )
    arguments = parser.parse_args()
    all_code, path = arguments.all_code, arguments.results
    lines = list(read(path)) if all_code else current(path, list(SOLVERS))
    arguments.output.mkdir(exist_ok=True)
    page = arguments.output / "hidden-effects.md"
    with replacing(page) as written:
        written.write_text(f"# Hidden effects\n\n{text_of(lines)}\n", encoding="utf-8")
    scored = [line for line in lines if "verdict" in line]
    draw_sizes(scored, arguments.output / "hidden_effects_by_size.png")
    draw_effects(scored, arguments.output / "hidden_effects_by_effect.png")
    print(f"{page}: {len(lines)} answers")


if __name__ == "__main__":
    main()
