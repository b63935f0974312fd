"""A diagnosis of the same recordings is the same to the bit, whatever order sets come in."""

import os
import subprocess
import sys

COLUMNS = """
from itertools import product
from wrist_stiffness.campaign.fitting.recipes import recipe
from wrist_stiffness.model.registry import catalogue

for law in catalogue().values():
    for place in law.places:
        own = recipe(law, place, frozenset(("motor_1", "link_1")))
        for shape in product(*(parameter.grid for parameter in own.shape)):
            print(law.id, place, [(c.factor.name, c.trial, c.origin) for c in own.columns(shape)])
"""


def test_the_columns_of_every_law_come_in_one_order():
    """Python orders sets of names by a seed that is drawn anew in every process."""
    said = [
        subprocess.run(
            [sys.executable, "-c", COLUMNS],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "3")
    ]
    assert "gravity platform" in said[0]
    assert said[0] == said[1]
