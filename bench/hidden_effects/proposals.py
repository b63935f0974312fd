"""Judge the laws that are proposed for effects outside the catalogue and for sound wrists.

    python bench/hidden_effects/proposals.py [--sound 20] [--sizes 3 10] [--output lines.jsonl]

Four of twelve stretches of a session are held out.  The law that is proposed in the others predicts
them, and so does the discrepancy, a Gaussian process over the conditions of either side.  What each
removes there of the error beyond set-up and tolerances is compared.  Two minutes, ten samples a
second, wrong wrists, an interferometer of stated noise; wrists and noise of seeds that nothing else
uses.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import blind_strangers
import fourth_strangers
import newer_strangers
from bench_wrist import Array, wrist
from cases import Case, one_each
from observe import hidden_effects, observe
from rates import wilson
from right_sentences import is_right, right_components
from told import binned, calibration_error

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.proposal import Proposal
from wrist_stiffness.identification.proposing import propose
from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.held_out import time_blocks
from wrist_stiffness.inference.point import Background
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.unit_session import UnitSession, as_units
from wrist_stiffness.simulation.catalogue import STRANGERS

FIRST_SEED = 7001
"""Seeds of wrists and noise from here on are used by nothing else."""

STRETCHES = 12

BLIND = {
    "by another author": blind_strangers.BLIND,
    "by a third author": newer_strangers.NEWER,
    "by a fourth author": fourth_strangers.FOURTH,
}
"""Strangers whose authors had not seen how laws are proposed; each list was asked once first."""


def cases(sizes: Sequence[float], sound: int) -> list[Case]:
    """Return strangers at one place each, sound wrists, and strangers by other authors."""
    found = [Case((place,), size) for place in one_each(STRANGERS) for size in sizes]
    found += [Case((), 0.0)] * sound
    for others in (blind_strangers, newer_strangers, fourth_strangers):
        others.register()
    found += [
        Case((place,), size) for own in BLIND.values() for place in one_each(own) for size in sizes
    ]
    return [replace(case, seed=FIRST_SEED + n) for n, case in enumerate(found)]


def without(session: UnitSession, held: Array) -> UnitSession:
    """Return a session of which some units were not measured; their path stays."""
    return session.without(np.flatnonzero(held))


def answer(case: Case) -> dict[str, Any]:
    """Return the line of one case."""
    model = ErrorModel("benchmark", wrist(), "closed_form")
    line: dict[str, Any] = {"seed": case.seed, "size": case.size}
    line["truth"] = list(case.effects[0][:2]) if case.effects else []
    try:
        session = observe(case, hidden_effects(case), 0)
    except InputError as error:
        return line | {"out_of_reach": str(error)}
    whole = as_units(model, session)
    held = np.isin(time_blocks(np.zeros(len(whole), dtype=np.int64), STRETCHES) % 3, (1,))
    problem = WristProblem(model, (without(whole, held),))
    fit = problem.begin()
    fit.evidence  # noqa: B018  known from the diagnosis, so its time does not count
    begun = time.process_time()
    found = propose(problem, fit)
    line |= {"cpu_s": time.process_time() - begun, "probability": found.probability}
    line["laws"] = [each.sentence for each in found.terms]
    line["probabilities"] = [each.probability for each in found.terms]
    line["forms"] = [each.form.name for each in found.terms]
    line["components"] = [each.component for each in found.terms]
    if case.effects:
        effect, place, _ = case.effects[0]
        right = right_components(effect, place)
        line["right_component"] = any(each.component in right for each in found.terms)
        line["right_sentence"] = is_right(effect, place, found.terms)
        line["among_laws"] = is_right(effect, place, [*found.terms, *found.rivals])
        # Of the second law the probability is that both are right.
        right_ones = [is_right(effect, place, [each]) for each in found.terms]
        line["right_laws"] = np.logical_and.accumulate(right_ones).tolist()
        line["among_components"] = any(name in right for name in found.places)
        both = WristProblem(model, (whole,))
        line |= judged(both, held, added(problem, found.terms))
    return line


def added(problem: WristProblem, laws: Sequence[Proposal]) -> list[Effect]:
    """Return laws fitted together with set-up and tolerances, as `extend` does."""
    fit = problem.begin()
    for number, each in enumerate(laws):
        fit = problem.extended(fit, each.effect(f"law_{number}"))
    return list(fit.base.beyond().values())


def judged(problem: WristProblem, held: Array, effects: Sequence[Effect]) -> dict[str, Any]:
    """Return the squares left in the held-out units (u,) of nothing, the process and the law.

    Beside them, what a picture shows of these units.
    """
    fit = problem.begin()
    table, point = problem.table, fit.point
    # Outliers are no units of the table.
    held = held[fit.base.problem.sessions[0].measured]
    rows = held[table.unit]
    trials = [(e.law, e.component, {k: v.value for k, v in e.estimates.items()}) for e in effects]
    none = np.zeros_like(fit.base.residual)
    changes = {
        "nothing": none,
        "process": process(fit, problem.background, rows),
        "law": problem.about(fit).changes(trials).sum(axis=0) if trials else none,
    }
    # Set-up and tolerances may follow on the held-out units, whatever was taken away.
    prior = np.diag(point.weight)
    columns = np.vstack([point.columns[rows], prior])
    found, left = {}, {}
    for name, change in changes.items():
        own = (point.left - table.whiten(change))[rows]
        target = np.concatenate([own, np.zeros(len(prior))])
        step = np.linalg.lstsq(columns, target, rcond=None)[0]
        found[name] = float(np.sum((target - columns @ step) ** 2))
        left[name] = (fit.base.residual - change - fit.base.columns @ (fit.ratio * step))[held]
    shown = telling(left, np.median(table.variance, axis=0), table.observations.times[held])
    return found | {"numbers": float(rows.sum()), "shown": shown}


def telling(left: Mapping[str, Array], variance: Array, time_s: Array) -> dict[str, Any]:
    """Return the most telling part of what is left (u, 6): along its longest axis.

    Of shift and turn the one that is the larger beside its noise, as a variance (6,).
    """
    ways = []
    for unit, at, per_si in (("um", slice(0, 3), 1e6), ("mdeg", slice(3, 6), 180e3 / np.pi)):
        own = left["nothing"][:, at] - left["nothing"][:, at].mean(axis=0)
        size, axis = np.linalg.svd(own, full_matrices=False)[1:]
        ways.append((size[0] ** 2 / variance[at].mean(), unit, at, per_si * axis[0]))
    _, unit, at, axis = max(ways, key=lambda way: way[0])
    noise = float(np.sqrt(variance[at] @ axis**2))
    parts = {name: np.round(own[:, at] @ axis, 3).tolist() for name, own in left.items()}
    return {"unit": unit, "noise": noise, "time_s": np.round(time_s, 2).tolist(), **parts}


def process(fit: WristFit, ground: Background, rows: Array) -> Array:
    """Return what the discrepancy, fitted to the other rows, takes away of each unit, (u, 6)."""
    seen = ~rows
    groups = tuple(replace(each, columns=each.columns[seen]) for each in ground.groups)
    point = replace(
        fit.point,
        left=fit.point.left[seen],
        columns=fit.point.columns[seen],
        inexact=fit.point.inexact[seen],
    )
    found = evidence(point, Background(groups, ground.noise_width))
    there = ground.part(found.background.numbers or range(len(groups)))
    parts = np.split(found.unnamed, np.cumsum(there.sizes)[:-1])
    laws = zip(there.groups, parts, there.optional, strict=True)
    # The evidence adds its columns to what is left.
    return -sum((g.change(z) for g, z, law in laws if law), np.zeros_like(fit.base.residual))


RIGHT = ("right_component", "right_sentence", "among_laws")
"""What is counted of each line; the last one with the rivals that are told beside the laws."""

WHERE = {
    "right_sentence": "right, and so is the sentence",
    "right_component": "right",
    "among_components": "among",
}
"""How a line of the table tells the component, the first that is so."""


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return the table of the figures."""
    strange = [each for each in lines if each["truth"] and "nothing" in each]
    sound = [each for each in lines if not each["truth"]]
    rows = ["| effect, size | removed of what the process removes | component | law |", "|-|-|-|-|"]
    lists = ("", *BLIND)
    seen: dict[str, list[dict[str, bool]]] = {name: [] for name in lists}
    predicted: dict[str, list[dict[str, bool]]] = {name: [] for name in lists}
    for each in strange:
        own = ["", *(name for name, entries in BLIND.items() if each["truth"][0] in entries)]
        beyond = 3.0 * np.sqrt(2.0 * each["numbers"])
        gains = {name: each["nothing"] - each[name] for name in ("law", "process")}
        right = {key: each[key] for key in RIGHT}
        right["a law"] = bool(each["laws"])
        above = each["nothing"] - each["numbers"]
        if above > beyond:
            halved = {"half of the error above noise removed": gains["law"] >= above / 2}
            for name in own:
                seen[name].append(right | halved)
        told = "the process removes nothing"
        if gains["process"] > beyond:
            share = gains["law"] / gains["process"]
            halved = {"half of what the process removes": share >= 0.5}
            for name in own:
                predicted[name].append(right | halved)
            told = f"{100.0 * share:.0f} %"
        where = next((told for key, told in WHERE.items() if each[key]), "-")
        laws = "; ".join(each["laws"]) or "none"
        rows.append(f"| {'@'.join(each['truth'])}, {each['size']:g} | {told} | {where} | {laws} |")
    for which, known in (("above the noise", seen), ("predicted by the process", predicted)):
        for name, kept in known.items():
            whose = " ".join(filter(None, ("strangers", name, which)))
            for what in kept[0] if kept else ():
                hits = sum(each[what] for each in kept)
                rows.append(_rate(f"{whose}: {what.replace('_', ' ')}", hits, len(kept)))
    rows.append(_rate("sound wrists: no law", sum(not x["laws"] for x in sound), len(sound)))
    told = [
        (probability, right)
        for each in strange
        for probability, right in zip(each["probabilities"], each["right_laws"], strict=True)
    ]
    probabilities, right = map(np.array, zip(*told, strict=True))
    off = calibration_error(probabilities, right)
    rows.append(f"calibration error of the probabilities of {len(told)} laws: {off:.2f}")
    for mean, count, hits in binned(probabilities, right):
        rows.append(_rate(f"laws told with {100.0 * mean:.0f} % on average: right", hits, count))
    for whose, kept in (("strangers", strange), ("sound wrists", sound)):
        times = [each["cpu_s"] for each in kept if "cpu_s" in each] or [0.0]
        rows.append(
            f"processor time of one search, {whose}: median {np.median(times):.1f} s, "
            f"longest {max(times):.1f} s"
        )
    return "\n".join(rows)


def _rate(what: str, hits: int, count: int) -> str:
    low, high = wilson(hits, count) if count else (0.0, 1.0)
    return f"{what}: {hits} of {count} (95 %: {100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    """Ask every case, print each line and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sound", type=int, default=20)
    parser.add_argument("--sizes", type=float, nargs="+", default=[3.0, 10.0])
    parser.add_argument("--output", type=Path)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no more after")
    arguments = parser.parse_args()
    asked = cases(arguments.sizes, arguments.sound)
    lines, end = [], time.monotonic() + 60.0 * arguments.minutes
    for case in np.random.default_rng(0).permutation(np.array(asked, dtype=object)):
        if time.monotonic() > end:
            break
        lines.append(answer(case))
        print(json.dumps({k: v for k, v in lines[-1].items() if k != "shown"}), flush=True)
        if arguments.output:
            with arguments.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(lines[-1]) + "\n")
    print(table(lines))
    print(f"{len(lines)} of {len(asked)} cases were asked")


if __name__ == "__main__":
    main()
