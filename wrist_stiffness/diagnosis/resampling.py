"""Blocks of neighbouring units: cross-validation and stability of a choice.

All sums of squares come from one Gram matrix per block, so leaving blocks out or drawing them
again costs nothing in the number of units.
"""

import numpy as np

from wrist_stiffness.diagnosis.hypotheses import Hypothesis, addition
from wrist_stiffness.diagnosis.observations import Array, Labels, Mask
from wrist_stiffness.diagnosis.projection import Base

RIDGE = 1e-9
"""Keeps a resample solvable in which a parameter is not seen."""

RESAMPLES = 50
"""Draws of blocks from which a stability is told."""


def time_blocks(sessions: Labels, wanted: int) -> Labels:
    """Cut the units into blocks of neighbours that never span two sessions, (n,)."""
    blocks = np.empty(len(sessions), dtype=np.int64)
    names = np.unique(sessions)
    number = 0
    for session in names:
        places = np.flatnonzero(sessions == session)
        share = max(1, round(wanted * len(places) / len(sessions)))
        for piece in np.array_split(places, min(share, len(places))):
            blocks[piece] = number
            number += 1
    return blocks


class BlockGrams:
    """Gram matrices per block of a base, some hypotheses and the observations.

    Parameters
    ----------
    base : Base
        What is refitted in every resample.
    hypotheses : list of Hypothesis
        Candidates for one more effect.
    blocks : (n,) array
        Block of each unit.
    """

    def __init__(self, base: Base, hypotheses: list[Hypothesis], blocks: Labels) -> None:
        beyond = [addition(base, each).beyond for each in hypotheses]
        stacked = np.hstack([base.basis, *beyond, base.residual[:, None]])
        norm = np.linalg.norm(stacked, axis=0)
        stacked = stacked / np.where(norm > 0, norm, 1.0)
        data = len(stacked) - base.n_priors
        block = np.repeat(blocks, data // len(blocks))
        own = [stacked[:data][block == each] for each in np.unique(blocks)]
        self._grams = np.array([rows.T @ rows for rows in own])
        self._priors = stacked[data:].T @ stacked[data:]
        sizes = [each.shape[1] for each in beyond]
        starts = np.cumsum([0, *sizes])[:-1]
        self._members = [slice(a, a + k) for a, k in zip(starts, sizes, strict=True)]
        self._n_base = base.basis.shape[1]
        self._scale = float(norm[-1] ** 2)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self._grams)

    def gains(self, weights: Array) -> Array:
        """Give what each hypothesis explains when blocks count so often, (h,).

        Parameters
        ----------
        weights : (b,) array
            How often each block was drawn.
        """
        gram = np.tensordot(weights, self._grams, axes=1) + self._priors
        gram[np.diag_indices(len(gram) - 1)] += RIDGE
        p = self._n_base
        # The base is eliminated once for all hypotheses (Schur complement).
        beyond = gram[p:, p:] - gram[p:, :p] @ np.linalg.solve(gram[:p, :p], gram[:p, p:])
        moment = beyond[:-1, -1]
        own = (moment[m] @ np.linalg.solve(beyond[m, m], moment[m]) for m in self._members)
        return self._scale * np.fromiter(own, float, len(self._members))


def stability(grams: BlockGrams, inside: Mask, prices: Array, rng: np.random.Generator) -> float:
    """Share of block resamples whose best candidate is one of a class.

    Parameters
    ----------
    grams : BlockGrams
        Blocks with all rivals.
    inside : (h,) array of bool
        Which hypotheses belong to the class.
    prices : (h,) array
        What each hypothesis costs, in sums of squares.
    rng : numpy.random.Generator
        Draws the blocks.
    """
    draws = rng.multinomial(grams.n_blocks, np.full(grams.n_blocks, 1 / grams.n_blocks), RESAMPLES)
    chosen = [int(np.argmax(grams.gains(draw.astype(float)) - prices)) for draw in draws]
    return float(np.mean(inside[chosen]))
