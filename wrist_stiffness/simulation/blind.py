"""A hidden effect that a seed draws and nobody is told: blind tests, and how they are opened."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect, places
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.simulation.size import Scale

SMALLEST, LARGEST = 0.5, 30.0
"""Range of the drawn sizes, even in their logarithm, in units of one sample's noise."""

ATTEMPTS = 20


@dataclass(frozen=True)
class Secret:
    """What a seed hides."""

    hidden: HiddenEffect  # with its magnitude
    size: float  # in units of one sample's noise


def draw(
    seed: int,
    table: Table,
    settings: CellSettings,
    seconds: float,
    tell: Callable[[str], None] = lambda text: None,
    without: Collection[str] = (),
) -> Secret:
    """Draw effect, place, form and size.

    Every effect of the catalogue is as likely as any other, then every place of it.  A drawn size
    that its effect cannot have on a wrist that still works is drawn again with all the rest.

    `seed`: not negative.  `settings`: the size holds for this experiment.  `seconds`: duration of
    the experiment [s].  `tell`: is told before every run of the experiment; not what is tried.
    `without`: effects that are not drawn, such as those that every session sets up anew.  Raises
    `InputError` if the seed is negative or nothing fits after many draws.
    """
    if seed < 0:
        raise InputError(f"blind seed {seed} is negative")
    # Apart from the noise, which a user may seed with the same number.
    rng = np.random.default_rng([seed, 0x5EC2E7])
    scale = Scale(table, replace(settings, hidden=()), seconds, tell)
    names = [name for name in CATALOGUE if name not in without]
    for _ in range(ATTEMPTS):
        entry = CATALOGUE[effect := str(rng.choice(names))]
        found = places({effect: entry})
        _, component, form = found[rng.integers(len(found))]
        size = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
        shape = int(rng.integers(2**31))
        hidden = HiddenEffect(effect, component, form, entry.plausible, shape)
        try:
            return Secret(scale.sized(hidden, size, entry.largest), size)
        except InputError:
            continue
    raise InputError(f"blind seed {seed}: no effect fits this experiment after {ATTEMPTS} draws")
