"""How large and of which shape the rivals of a class would be if each of them were the true one.

What the best member of a class leaves in the data at hand is known.  Another member, were it true,
has left the same: its parameters are those that fit it, as well as the data determine them.  An
experiment is worth what it tells between effects that agree on what was measured before and differ
elsewhere; random values would already disagree on the old data and ask for less than it takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.planning.information import (
    Goal,
    Information,
    Layout,
    beyond_nuisances,
    discrimination,
)

DRAWS = 3
"""Values of each rival, besides the best ones, that fit the data at hand about as well."""


@dataclass(frozen=True, eq=False)
class Truths:
    """Truths as combinations of the columns that were evaluated."""

    combined: Array  # (q, r), new columns by the old ones: nuisances, effects' columns, truths
    layout: Layout  # of the new columns

    def of(self, gram: Array) -> Array:
        """Return Gram matrices (..., r, r) of the new columns from those (..., q, q) of the old."""
        found: Array = self.combined.T @ gram @ self.combined
        return found


def as_asked(known: Information, alike: Sequence[Sequence[str]]) -> Truths:
    """Take truths as they are, the members of each class made as large as its first one.

    `known`: of an experiment that shows how large they are; `alike`: classes.  Gives `Truths`: only
    scaled.
    """
    layout = known.layout
    size = np.ones(len(known.total))
    for members in alike:
        shown = [name for name in members if name in layout.truths]
        sizes = discrimination(known.total, layout, [Goal(name, "") for name in shown])
        for name, own in zip(shown, sizes, strict=True):
            if own > 0.0 and sizes[0] > 0.0:
                size[len(layout.prior) + layout.truths[name]] = sizes[0] / own
    return Truths(np.diag(size), layout)


def after_data(
    gram: Array, layout: Layout, alike: Sequence[Sequence[str]], rng: np.random.Generator
) -> Truths:
    """Take for each member of a class what fits the data that its first member explains.

    `gram` (q, q): of the data at hand.  `layout`: of its columns.  `alike`: classes; the first
    truth of the first member says what was measured.  `rng`: draws values within the uncertainty
    that these data leave, from a prior of plausible sizes.  Gives `Truths`: `DRAWS` + 1 for each
    member, the most probable one first.
    """
    p, q = len(layout.prior), len(gram)
    left = beyond_nuisances(gram, layout)
    blocks, truths = [np.eye(q)], dict(layout.truths)
    at = q - p
    for members in alike:
        shown = [name for name in members if name in layout.truths]
        for name in shown:
            measured, own = layout.truths[shown[0]][0], layout.columns[name]
            inner = left[np.ix_(own, own)] + np.eye(len(own))
            spread = np.linalg.inv(np.linalg.cholesky(inner)).T
            new = np.zeros((q, DRAWS + 1))
            whole = layout.truths[name][0]
            new[p + whole] = 1.0
            missing = left[own, measured] - left[own, whole]
            new[p + own] = np.linalg.solve(inner, missing)[:, None]
            new[p + own, 1:] += spread @ rng.standard_normal((len(own), DRAWS))
            blocks.append(new)
            truths[name] = np.arange(at, at + DRAWS + 1)
            at += DRAWS + 1
    return Truths(np.concatenate(blocks, axis=1), replace(layout, truths=truths))
