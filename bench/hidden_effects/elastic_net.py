"""Elastic net with stability selection: many words at once, kept if most half samples choose them.

Meinshausen and Bühlmann, Stability selection, J. R. Statist. Soc. B 72 (2010) 417.
"""

from __future__ import annotations

import warnings

import numpy as np
from bench_wrist import Array
from dictionary import Dictionary
from observe import Riddle
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import enet_path
from solvers import MOST_FINDINGS, Answer, explained, nothing
from whitened import whitened

HALVES = 40
"""Half samples of the rows."""

KEEP = 0.8
"""Share of the half samples that must choose a word."""

FALSE = 1.0
"""Expected number of columns chosen wrongly, which limits how many may enter at a time."""

L1_RATIO = 0.9

STEPS = np.geomspace(1.0, 1e-2, 30)
"""Penalties of the path over the largest that does anything."""


def elastic_net(riddle: Riddle, words: Dictionary) -> Answer:
    """Choose words by stability selection and fit them by least squares."""
    fit = whitened(riddle, words)
    candidates = words.searched
    blocks = [fit.word(word) for word in candidates]
    owner = np.repeat(np.arange(len(blocks)), [block.shape[1] for block in blocks])
    design = np.concatenate(blocks, axis=1)
    length = np.linalg.norm(design, axis=0)
    # A direction that data within their noise cannot show is no candidate.
    design, owner = design[:, length > 1.0] / length[length > 1.0], owner[length > 1.0]
    if design.shape[1] == 0:
        return nothing(riddle)
    share = _stability(design, fit.rest, owner, len(blocks), riddle.case.seed)
    order = [i for i in np.argsort(-share, kind="stable") if share[i] >= KEEP][:MOST_FINDINGS]
    if not order:
        return nothing(riddle)
    chosen = [candidates[i] for i in order]
    values, gain, _ = fit.fit(chosen)
    gains = [
        gain - fit.fit([w for w in chosen if w is not word])[1] if len(chosen) > 1 else gain
        for word in chosen
    ]
    names = tuple((chosen[i].name,) for i in np.argsort(gains)[::-1])
    return Answer("effect", names, explained(chosen, values))


def _stability(design: Array, rest: Array, owner: np.ndarray, words: int, seed: int) -> Array:
    """Return the share of half samples in which each word is chosen, (words,)."""
    rng = np.random.default_rng(seed)
    columns = design.shape[1]
    most = int(np.sqrt(FALSE * (2.0 * KEEP - 1.0) * columns))
    hits = np.zeros(words)
    for _ in range(HALVES):
        rows = rng.permutation(len(rest))[: len(rest) // 2]
        largest = np.max(np.abs(design[rows].T @ rest[rows])) / len(rows) / L1_RATIO
        with warnings.catch_warnings():
            # The path is only read for its order of entry.
            warnings.simplefilter("ignore", ConvergenceWarning)
            _, path, _ = enet_path(
                design[rows], rest[rows], l1_ratio=L1_RATIO, alphas=largest * STEPS, tol=1e-3
            )
        active = path != 0.0
        allowed = np.flatnonzero(active.sum(axis=0) <= max(most, 1))
        hits[np.unique(owner[active[:, allowed[-1]]])] += 1.0
    return hits / HALVES
