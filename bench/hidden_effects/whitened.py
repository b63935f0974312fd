"""Least squares on the units of one day with nuisances and a wrong base marginalised."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from bench_wrist import Array
from dictionary import Dictionary, Word
from observe import Riddle, Session
from scipy.linalg import cho_factor, cho_solve, solve_triangular

NUISANCE_SCALE = 300.0
"""Prior of a nuisance in units of the noise of one unit: practically free."""


class Whitened:
    """The first day, whitened.

    Parameters
    ----------
    session : Session
        Units of the day.
    words : Dictionary
        Its nuisances are free, its base has the spread of wrong bases.
    with_base : bool
        Whether a wrong base counts as unknown.
    """

    def __init__(self, session: Session, words: Dictionary, with_base: bool = True) -> None:
        self._rows = session.measured.ravel()
        units = len(session.residual)
        total = session.wander.copy()
        for i, covariance in enumerate(session.covariance):
            total[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] += covariance
        total = total[np.ix_(self._rows, self._rows)]
        columns = np.concatenate(
            [word.train.reshape(6 * units, -1) for word in words.nuisance], axis=1
        )[self._rows]
        size = np.sqrt(np.mean(columns**2, axis=0))
        columns = columns[:, size > 0.0] / size[size > 0.0]
        columns *= NUISANCE_SCALE * np.sqrt(np.trace(total) / len(total))
        self._base = words.base.train.reshape(6 * units, -1)[self._rows]
        if not with_base:
            self._base = self._base[:, :0]
        self.nuisance = np.concatenate([columns, self._base], axis=1)
        total += self.nuisance @ self.nuisance.T
        self._factor = cho_factor(total, lower=True)
        self.rest = self.white(session.residual)
        self._words: dict[str, Array] = {}

    def white(self, values: Array) -> Array:
        """Whiten (u, 6) or (u, 6, r) to (rows,) or (rows, r)."""
        flat = values.reshape(len(self._rows), *values.shape[2:])[self._rows]
        out: Array = solve_triangular(self._factor[0], flat, lower=True)
        return out

    def word(self, word: Word) -> Array:
        """Return a word whitened, (rows, r)."""
        if word.name not in self._words:
            self._words[word.name] = self.white(word.train)
        return self._words[word.name]

    def base_estimate(self, values: Array) -> Array:
        """Return the most likely coefficients of the base's columns for residuals (u, 6)."""
        weighted: Array = cho_solve(self._factor, values.ravel()[self._rows])
        return np.asarray(self._base.T @ weighted)

    def without_nuisance(self, values: Array) -> Array:
        """Return residuals (u, 6) less their best explanation by nuisances and base."""
        out = np.zeros(len(self._rows))
        flat = values.ravel()[self._rows]
        out[self._rows] = flat - self.nuisance @ (self.nuisance.T @ cho_solve(self._factor, flat))
        return out.reshape(values.shape)

    def fit(self, words: Sequence[Word]) -> tuple[Array, float, int]:
        """Return coefficients, fall of chi-square and number of coefficients."""
        design = np.concatenate([self.word(word) for word in words], axis=1)
        values, _, rank, _ = np.linalg.lstsq(design, self.rest, rcond=1e-6)
        left = self.rest - design @ values
        return values, float(self.rest @ self.rest - left @ left), int(rank)


@lru_cache(maxsize=1)
def whitened(riddle: Riddle, words: Dictionary) -> Whitened:
    """Return the first day of a riddle, whitened; the solvers of a case share it."""
    return Whitened(riddle.train, words)
