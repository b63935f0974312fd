"""Ask a few riddles end to end; a wrong name or verdict fails.

    python bench/hidden_effects/quick.py               # a sound wrist and some visible faults
    python bench/hidden_effects/quick.py --only NAME   # an effect at each of its places, size 3

What is out of reach at that size is said and does not count.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time

from cases import Case, searched
from observe import hidden_effects, observe
from own_diagnosis import diagnosed

from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.catalogue import CATALOGUE

SIZE = 3.0

VISIBLE = (
    ("backlash", "motor_1", "single"),
    ("joint_clearance", "joint_3", "algebraic"),
    ("encoder_eccentricity", "motor_2", "once"),
    ("cable_wrench", "platform", "smooth"),
)
"""Effects that a diagnosis names; of strangers the tutorial tells, which a test runs."""


def is_right(case: Case) -> bool:
    """Ask a case, print what is said, and return whether a class of names holds the truth alone."""
    begun = time.process_time()
    try:
        session = observe(case, hidden_effects(case), 0)
    except InputError as error:
        print(f"out of reach {case.key}: {error}", flush=True)
        return True
    found = diagnosed([session])
    truth = {f"{effect}@{component}" for effect, component, _ in case.effects}
    right = found["verdict"] == ("effect" if truth else "none")
    right &= len(found["named"]) == len(truth) and all(truth & set(x) for x in found["named"])
    said = f"{found['verdict']} {found['named'] or ''}".strip()
    seconds = time.process_time() - begun
    print(f"{'ok   ' if right else 'WRONG'} {case.key}: {said} ({seconds:.0f} s)", flush=True)
    return right


def main() -> int:
    """Return 1 where an answer is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=sorted(CATALOGUE), help="effect of the catalogue")
    given = parser.parse_args()
    cases = [Case((), 0.0), *(Case((place,), SIZE) for place in VISIBLE)]
    if given.only:
        cases = [Case((place,), SIZE) for place in searched(CATALOGUE) if place[0] == given.only]
    answers = [is_right(case) for case in cases]  # all are asked, whatever the first say
    return 0 if all(answers) else 1


if __name__ == "__main__":
    sys.exit(main())
