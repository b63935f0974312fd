"""A hidden effect that a seed draws and nobody is told: blind tests, and how they are opened."""

from __future__ import annotations

from collections.abc import Callable
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
    """What a seed hides.

    Parameters
    ----------
    hidden : HiddenEffect
        With its magnitude.
    size : float
        In units of one sample's noise.
    """

    hidden: HiddenEffect
    size: float


class ToldScale(Scale):
    """A scale that tells before every run of the experiment, of which a size takes several.

    Parameters
    ----------
    tell : callable
        Is told what begins; not of which effect.
    table, settings, seconds
        As of `Scale`.
    """

    def __init__(
        self, tell: Callable[[str], None], table: Table, settings: CellSettings, seconds: float
    ) -> None:
        self._tell, self._runs = tell, 0
        super().__init__(table, settings, seconds)

    def size(self, hidden: HiddenEffect) -> float:
        """Return the size of an effect in units of one sample's noise."""
        self._runs += 1
        self._tell(f"finding how much of the effect has the wanted size, run {self._runs}")
        return super().size(hidden)


def draw(
    seed: int,
    table: Table,
    settings: CellSettings,
    seconds: float,
    tell: Callable[[str], None] = lambda text: None,
) -> Secret:
    """Draw effect, place, form and size.

    Every effect of the catalogue is as likely as any other, then every place of it.  A drawn size
    that its effect cannot have within the catalogue's limit is drawn again with all the rest.

    Parameters
    ----------
    seed : int
        Not negative.
    table : Table
        Of the wrist.
    settings : CellSettings
        The size holds for this experiment.
    seconds : float
        Duration of the experiment [s].
    tell : callable
        Is told before every run of the experiment; not what is tried.

    Returns
    -------
    Secret
        The same for the same arguments.

    Raises
    ------
    InputError
        If the seed is negative or nothing fits after many draws.
    """
    if seed < 0:
        raise InputError(f"blind seed {seed} is negative")
    # Apart from the noise, which a user may seed with the same number.
    rng = np.random.default_rng([seed, 0x5EC2E7])
    scale = ToldScale(tell, table, replace(settings, hidden=()), seconds)
    for _ in range(ATTEMPTS):
        effect = str(rng.choice(list(CATALOGUE)))
        _, component, form = places({effect: CATALOGUE[effect]})[
            rng.integers(len(places({effect: CATALOGUE[effect]})))
        ]
        size = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
        start = CATALOGUE[effect].plausible
        hidden = HiddenEffect(effect, component, form, start, int(rng.integers(2**31)))
        try:
            return Secret(scale.sized(hidden, size), size)
        except InputError:
            continue
    raise InputError(f"blind seed {seed}: no effect fits this experiment after {ATTEMPTS} draws")
