"""Choose settings for an experiment: greedily by gain per second, then by exchange.

Each step looks at a random part of the pool: nearly as good as all of it (Mirzasoleiman et al.
2015) at a fraction of the time.  A setting may be chosen again: optimal designs repeat settings.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wrist_stiffness.mechanism.components import Array

LOOKED_AT = 40
"""Settings that are compared in each step."""

EXCHANGES = 12
"""Settings that each chosen one is compared with at the end."""

Utility = Callable[[Array], Array]
"""From Gram matrices (..., q, q) of experiments to what they are worth, (...)."""


def choose(
    grams: Array,
    cost_s: Array,
    start: Array,
    budget_s: float,
    utility: Utility,
    enough: Callable[[Array], bool],
    rng: np.random.Generator,
    looked_at: int = LOOKED_AT,
    per_second: bool = True,
) -> list[int]:
    """Choose settings, in the order of their worth; a number may be there more than once.

    `grams` (m, q, q): of each setting; `cost_s` (m,): duration of each [s]; `start` (q, q): of what
    is measured anyway; `budget_s`: duration that the chosen ones may have together [s]; `utility`:
    worth of experiments; increasing; `enough`: tells of a Gram matrix (q, q) whether nothing more
    is needed; `rng`: which settings are compared; `looked_at`: how many in each step; `per_second`:
    whether short ones are preferred; else as few as possible are chosen.
    """
    chosen: list[int] = []
    total, spent = start.copy(), 0.0
    # What every plan has may be reckoned enough; alone it is no answer to anybody's question.
    while not chosen or not enough(total):
        left = np.flatnonzero(cost_s <= budget_s - spent)
        if len(left) == 0:
            break
        looked = rng.choice(left, min(looked_at, len(left)), replace=False)
        gain = utility(total + grams[looked]) - utility(total)
        if per_second:
            gain = gain / cost_s[looked]
        best = int(looked[np.argmax(gain)])
        chosen.append(best)
        total += grams[best]
        spent += float(cost_s[best])
    return _exchanged(chosen, grams, cost_s, total, budget_s - spent, utility, rng)


def _exchanged(
    chosen: list[int],
    grams: Array,
    cost_s: Array,
    total: Array,
    spare_s: float,
    utility: Utility,
    rng: np.random.Generator,
) -> list[int]:
    """Swap each chosen setting for a better one that takes no more time than there is."""
    chosen = list(chosen)
    for place, old in enumerate(chosen):
        fitting = np.flatnonzero(cost_s <= cost_s[old] + max(spare_s, 0.0))
        looked = np.append(old, rng.choice(fitting, min(EXCHANGES, len(fitting)), replace=False))
        rest = total - grams[old]
        best = int(looked[np.argmax(utility(rest + grams[looked]))])
        spare_s += float(cost_s[old] - cost_s[best])
        chosen[place], total = best, rest + grams[best]
    return chosen
