"""Tell how often the truth lies within the stated errors of parameters.

    python bench/hidden_effects/coverage.py [--each 4] [--sizes 1 3] [--output lines.jsonl]

An effect hides in a wrong wrist, its law is added as `extend` adds it, and its value is compared
with what was hidden: laws of which one parameter is the magnitude of the truth.  The truth shares
no formula with the law, so an error may be off even where the fit is perfect.  Two minutes, ten
samples a second, an interferometer of stated noise; wrists and noise of seeds that nothing else
uses.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from bench_wrist import wrist
from cases import Case, searched
from observe import hidden_effects, observe
from rates import wilson

from wrist_stiffness.errors import WristError
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import si_factor
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.base import base_laws
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect, is_plausible
from wrist_stiffness.simulation.laws.law import UniformSoftness

FIRST_SEED = 8001
"""Seeds of wrists and noise from here on are used by nothing else."""

MAGNITUDE = {
    "backlash:single": "width_mdeg",
    "bushing_stiffness:plain": "flexibility_percent",
    "drive_compliance:linear": "compliance_mdeg_per_Nm",
    "flange_contact:open": "gap_um",
    "gravity:mass": "mass_g",
    "joint_clearance:algebraic": "clearance_um",
    "joint_clearance:exponential": "clearance_um",
    "joint_friction:coulomb": "coefficient",
    "link_stiffness:uniform": "flexibility_percent",
    "time_delay:plain": "delay_ms",
}
"""Parameter that is the magnitude of a truth, by effect and form: those of which a wrist that still
works can have enough to show in two minutes."""

CENTRAL = 1.645
"""Standard uncertainties to either side that hold 90 %."""


def cases(each: int, sizes: Sequence[float]) -> list[Case]:
    """Return every effect at some of its places, at each size."""
    found = []
    for name in MAGNITUDE:
        effect, form = name.split(":")
        places = [p for p in searched(CATALOGUE) if p[0] == effect and p[2] == form]
        found += [Case((places[n % len(places)],), s) for n in range(each) for s in sizes]
    rows = enumerate(found)
    return [Case(case.effects, case.size, seed=FIRST_SEED + n) for n, case in rows]


def beside_base(case: Case, hidden: HiddenEffect) -> float:
    """Return by what the base, wrong as it is, multiplies an effect that scales a part of it."""
    if hidden.effect not in ("bushing_stiffness", "link_stiffness"):
        return 1.0
    own = base_laws(case.base, wrist(), case.seed, 0)
    softer = {each.component: each for each in own if isinstance(each, UniformSoftness)}
    return 1.0 + softer[hidden.component].fraction


def answer(case: Case) -> dict[str, Any]:
    """Return the line of one case."""
    ((law, place, form),) = case.effects
    line: dict[str, Any] = {"effect": f"{law}:{form}", "place": place, "size": case.size}
    model = ErrorModel("benchmark", wrist(), "closed_form")
    key = MAGNITUDE[line["effect"]]
    typical = {p.key: p.mean or p.scale for p in find_law(law).parameters(place)}
    try:
        hidden = hidden_effects(case)
        line |= {"truth": beside_base(case, hidden[0]) * hidden[0].magnitude / si_factor(key)}
        line |= {"plausible": is_plausible(hidden[0])}
        session = observe(case, hidden, 0)
        problem = WristProblem(model, (as_units(model, session),))
        fit = problem.extended(problem.begin(), effect_at(find_law(law), place, typical)).settled()
    except WristError as error:
        return line | {"out_of_reach": str(error)}
    found = fit.base.beyond()[f"{law}@{place}"]
    (at,) = (n for n in fit.places[found.name] if fit.base.problem.unknowns[n].key == key)
    step = fit.base.problem.unknowns[at].step
    error = float(np.sqrt(fit.covariance[at, at])) * step
    return line | {"value": found.estimates[key].value, "error": error}


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return how often the truth lies within 90 %, effect by effect."""
    rows = ["| effect | truth within 90 % | off by, in stated errors |", "|-|-|-|"]
    kept = [each for each in lines if "error" in each and each["plausible"]]
    hits = 0
    for name in MAGNITUDE:
        own = [each for each in kept if each["effect"] == name]
        off = [(each["value"] - each["truth"]) / each["error"] for each in own]
        inside = sum(abs(each) < CENTRAL for each in off)
        hits += inside
        told = ", ".join(f"{each:.1f}" for each in off)
        rows.append(f"| {name.removesuffix(':plain')} | {inside} of {len(own)} | {told} |")
    low, high = wilson(hits, len(kept))
    share = f"{100 * low:.0f} to {100 * high:.0f} %"
    return "\n".join([*rows, f"together {hits} of {len(kept)} (95 %: {share})"])


def main() -> None:
    """Ask every case, print each line and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--sizes", type=float, nargs="+", default=[1.0, 3.0])
    parser.add_argument("--output", type=Path)
    arguments = parser.parse_args()
    lines = []
    for case in cases(arguments.each, arguments.sizes):
        lines.append(answer(case))
        print(json.dumps(lines[-1]), flush=True)
        if arguments.output:
            with arguments.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(lines[-1]) + "\n")
    print(table(lines))


if __name__ == "__main__":
    main()
