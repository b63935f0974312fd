"""How many extra poses tell twins apart: planned ones against random ones.

A virtual cell hides an effect (laws of the simulation, not of the model) and is measured as in the
paper: 25 poses, one load, one approach; it is made so large that its own law is worth its
parameters there.  The effects that fit these measurements about as well, and are worth theirs, are
its class of twins.  `plan` chooses extra approaches; where these do not suffice, what is still open
is fitted anew to all measurements and planned for again, five times at most.  The others are
random: poses, sides and loads drawn from the same pool, and measured in the same way, with their
load and without it.  In a third arm they are measured under their load only, as in the paper.
All are performed by the virtual cell, with instruments set up anew.

Counted are poses (one approach each; the other side is another pose) and measurements at rest.  A
class is resolved from the number on at which every wrong twin lies behind the true one by 25 in the
Bayesian information criterion, noise aside, with everything refitted that a diagnosis refits and
every twin at the values that fit all measurements best.  The order of the poses counts for neither
side: each number is the median over 200 random orders (of planned poses, within each plan).
Reference poses and long holds, which a plan has besides, are left out.

A draw whose class random poses resolve at once (a median of one) is no case, as nothing can be half
of one; nor is one that neither resolves within 100 poses.

    python bench/plan_resolves/run.py FIRST_SEED END_SEED [OUT.jsonl]

Seeds that OUT.jsonl holds are not computed again.
"""

from __future__ import annotations

import json
import sys
import warnings
from dataclasses import asdict
from pathlib import Path
from time import monotonic

from arms import Arms
from report import report
from tqdm import tqdm
from twins import Catalogue, NoCase, in_paper_design

from wrist_stiffness.errors import InputError

AT_ONCE = 1.0
"""Random poses that are too few to be halved."""


def outcome(seed: int, paper: Catalogue) -> dict[str, object]:
    """Return what became of one draw, as a line of the results."""
    begin = monotonic()
    try:
        case = paper.draw(seed)
        found: dict[str, object] = {"seed": seed, "truth": case.truth, "twins": case.twins}
        arms = Arms(case, paper)
        random, measured = arms.random()
        if random.poses <= AT_ONCE:
            return {**found, "left_out": "random poses resolve it at once"}
        planned, plans = arms.planned()
        needed = {"planned": planned, "random": random, "random_once": arms.under_load(measured)}
        found |= {name: asdict(each) for name, each in needed.items()}
        return {**found, "plans": plans, "seconds": round(monotonic() - begin, 1)}
    except NoCase as error:
        return {"seed": seed, "left_out": str(error)}
    except InputError as error:
        return {"seed": seed, "left_out": str(error)[:60]}


def main() -> None:
    """Run what is missing and print what all took."""
    warnings.simplefilter("ignore")
    first, end = int(sys.argv[1]), int(sys.argv[2])
    here = Path(__file__).parent
    out = Path(sys.argv[3]) if len(sys.argv) > 3 else here / "results" / "twins.jsonl"
    out.parent.mkdir(exist_ok=True)
    lines = out.read_text().splitlines() if out.exists() else []
    found = {line["seed"]: line for line in map(json.loads, lines)}
    paper = in_paper_design()
    with out.open("a") as stream:
        for seed in tqdm(range(first, end)):
            if seed not in found:
                found[seed] = outcome(seed, paper)
                stream.write(json.dumps(found[seed]) + "\n")
                stream.flush()
    report([found[seed] for seed in range(first, end)])


if __name__ == "__main__":
    main()
