"""Scatter that neighbouring units have in common: what a motor at rest hides of its count.

A rest, a change of the load and the next rest have the same hidden angles: their differences know
nothing of them, and their mean is no better than one of them.  Taken for independent, the hidden
counts would both drown what a load does and make the mean look too good.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.evidence import Evidence
from wrist_stiffness.inference.noise import rich_basis
from wrist_stiffness.inference.observations import Array, Labels, Mask, Observations

LAW_RANK = 8
"""Columns of the error of one law."""

OWN_SHARES = np.geomspace(3e-3, 1.0, 6)
"""Shares of the variance of a hidden count that may be a unit's own within a stand: motors move."""


def own_covariance(observations: Observations, covariance: Array) -> Array:
    """Return the covariance of each unit without what it shares, (n, m, m).

    `observations`: units; `covariance` (m, m) or (n, m, m): of each unit by itself.
    """
    n, m = observations.values.shape
    whole = np.broadcast_to(covariance, (n, m, m))
    if observations.shared is None or observations.stand is None:
        return whole
    shared = observations.shared * (observations.stand >= 0)[:, None, None]
    return np.asarray(whole - shared @ np.swapaxes(shared, 1, 2))


def with_shared(observations: Observations, own: Array) -> Array:
    """Return the covariance of each unit by itself, (n, m, m), from its own part (m, m)."""
    whole = np.broadcast_to(own, (*observations.values.shape, len(own)))
    shared = observations.shared
    return whole if shared is None else whole + shared @ np.swapaxes(shared, 1, 2)


class Apart:
    """Brings columns to unit scatter that the units of a stand no longer share.

    The covariance of a stand is that of independent units plus few directions; its inverse root
    differs from theirs in these directions alone.  So it is with what all units have in common.

    `observations`: units; `factors` (n, m, m): inverse factors of each unit's own covariance.
    """

    def __init__(self, observations: Observations, factors: Array) -> None:
        self._factors, self._measured = factors, observations.measured
        self._parts: list[tuple[csr_array | Array, Array]] = []
        if observations.shared is not None and observations.stand is not None:
            self._add_stands(observations, observations.shared, observations.stand)
        if observations.common is not None:
            tall = self(observations.common * observations.measured[:, :, None])
            left, size, _ = np.linalg.svd(tall.reshape(-1, tall.shape[2]), full_matrices=False)
            self._parts.append((left, _shrink(size)))

    def _add_stands(self, observations: Observations, shared: Array, stands: Labels) -> None:
        loadings = self._factors @ (shared * observations.measured[:, :, None])
        numbers = np.arange(observations.values.size).reshape(observations.values.shape)
        entries, sizes, count = [], [np.empty(0)], 0
        for stand in np.unique(stands[stands >= 0]):
            units = stands == stand
            tall = loadings[units].reshape(-1, loadings.shape[2])
            left, size, _ = np.linalg.svd(tall, full_matrices=False)
            rows, columns = np.meshgrid(numbers[units], count + np.arange(len(size)), indexing="ij")
            entries.append(np.stack([left.ravel(), rows.ravel(), columns.ravel()]))
            sizes.append(size)
            count += len(size)
        if count:
            value, row, column = np.concatenate(entries, axis=1)
            at = (row.astype(int), column.astype(int))
            directions = csr_array((value, at), shape=(observations.values.size, count))
            self._parts.append((directions, _shrink(np.concatenate(sizes))))

    def __call__(self, columns: Array) -> Array:
        """Return columns (n, m, k), zero where not measured, of unit scatter, (n, m, k)."""
        white = np.asarray(self._factors @ columns)
        flat = white.reshape(len(white) * white.shape[1], white.shape[2])
        for directions, shrink in self._parts:
            flat -= directions @ (shrink * (directions.T @ flat))
        return white

    @property
    def log_density(self) -> float:
        """Logarithm of the density of numbers whose rows are zero, up to what all share."""
        own = np.log(np.diagonal(self._factors, axis1=1, axis2=2)).sum()
        return float(own + sum(np.log1p(-shrink).sum() for _, shrink in self._parts))

    def undone(self, white: Array) -> Array:
        """Return the columns (n, m, k) that became these."""
        flat = white.reshape(white.shape[0] * white.shape[1], white.shape[2]).copy()
        for directions, shrink in reversed(self._parts):
            flat += directions @ (shrink / (1.0 - shrink) * (directions.T @ flat))
        return np.asarray(np.linalg.solve(self._factors, flat.reshape(white.shape)))

    def rows(self, values: Array) -> Array:
        """Return (n, m) or (n, m, k) as rows of unit scatter, (n m,) or (n m, k); NaN become 0."""
        columns = values if values.ndim == 3 else values[:, :, None]
        white = self(np.where(self._measured[:, :, None], np.nan_to_num(columns), 0.0))
        flat = white.reshape(self._measured.size, columns.shape[2])
        return flat if values.ndim == 3 else flat[:, 0]


def as_they_stood(observations: Observations, base: Array, structure: Array) -> Observations:
    """Return the units with as much shared in each session as is likeliest.

    Motors that are corrected at rest move by less than a count, and no encoder shows it.  What is
    compared is what a rich model leaves of the units: a load does the same to both.

    `observations`: unchanged where nothing states their noise; `base` (n, m, p), `structure`
    (n, m, q): columns of what is refitted, and of what else could be behind the values.
    """
    covariance = observations.covariance
    if covariance is None or observations.shared is None or observations.stand is None:
        return observations
    columns = np.concatenate([base, structure, observations.values[:, :, None]], axis=2)

    def log_likelihood(units: Observations) -> float:
        own = own_covariance(units, covariance)
        apart = Apart(units, component_factors(own, units.measured))
        rows, p = apart.rows(columns), base.shape[2]
        basis = rich_basis(rows[:, :p], rows[:, p:-1], int(units.measured.sum()))
        left = rows[:, -1] - basis @ (basis.T @ rows[:, -1])
        return apart.log_density - 0.5 * float(left @ left)

    best, whole = log_likelihood(observations), observations.shared
    for session in np.unique(observations.sessions[observations.stand >= 0]):
        here = (observations.sessions == session)[:, None, None]
        for own in OWN_SHARES:
            shared = np.where(here, np.sqrt(1.0 - own) * whole, observations.shared)
            moved = replace(observations, shared=shared)
            found = log_likelihood(moved)
            if found <= best:
                break
            observations, best = moved, found
    return observations


def _shrink(size: Array) -> Array:
    """Return by how much directions shrink in which there is so much scatter more, (k, 1)."""
    return np.asarray(1.0 - 1.0 / np.sqrt(1.0 + size[:, None] ** 2))


def component_factors(covariance: Array, measured: Mask) -> Array:
    """Inverse Cholesky factors of each unit's covariance over its measured components.

    `covariance` (n, m, m): covariance of each unit; `measured` (n, m): unmeasured components get a
    unit diagonal and no coupling.
    Returns L^-1 (n, m, m) with L L^T = covariance.

    Raises `InputError` with the row and its least variance in any direction if that is not above 0.
    """
    m = covariance.shape[1]
    both = measured[:, :, None] & measured[:, None, :]
    safe = np.where(both, covariance, np.eye(m))
    try:
        return np.linalg.inv(np.linalg.cholesky(safe)).astype(np.float64)
    except np.linalg.LinAlgError:
        least = np.linalg.eigvalsh(safe)[:, 0]
        row = int(np.argmin(least))
        raise InputError(
            f"covariance of row {row}: a variance of {least[row]:.3g}, must be above 0"
        ) from None


class Whitened:
    """Units of a table as rows of unit scatter.

    `observations`: n units of m components; `own` (n, m, m): covariance of each without what it
    shares; `alike` (n, l): columns of units under like conditions, for which a law errs alike.
    """

    variance: Array  # (m,) or (n, m), of each component as it is known

    def __init__(self, observations: Observations, own: Array, alike: Array) -> None:
        self.observations, self._alike = observations, alike
        self._factors = component_factors(own, observations.measured)
        self._apart = Apart(observations, self._factors)
        self._rows = np.flatnonzero(observations.measured.ravel())

    @property
    def unit(self) -> Labels:
        """Unit of each row, (N,)."""
        return self._rows // self.observations.n_components

    def whiten(self, values: Array) -> Array:
        """Return (n, m) or (n, m, k) as rows of unit scatter, (N,) or (N, k)."""
        return self._apart.rows(values)[self._rows]

    def without(self, aside: Mask) -> Callable[[Array], Array]:
        """Return what makes of rows (N,) or (N, k) those as if some units were not measured."""
        table = self.observations
        blank = table.with_values(np.where(aside[:, None], np.nan, table.values))
        apart, kept = Apart(blank, self._factors), np.flatnonzero(blank.measured.ravel())

        def taken(rows: Array) -> Array:
            flat = np.zeros((table.values.size, *rows.shape[1:]))
            flat[self._rows] = rows
            raw = self._apart.undone(flat.reshape(*table.values.shape, -1))
            return apart.rows(raw)[kept].reshape(len(kept), *rows.shape[1:])

        return taken

    def varied(self, change: Array) -> Array:
        """Return what a change (n, m) adds where its size changes with the conditions, (N, l)."""
        return self.whiten(change[:, :, None] * self._alike[:, None, :])

    def above(self, found: Evidence) -> dict[str, float]:
        """Return what is left above the noise, RMS by quantity."""
        measured = self.observations.measured
        variance, own = np.broadcast_to(self.variance, measured.shape), np.zeros(measured.shape)
        component = self._rows % self.observations.n_components
        for quantity in self.observations.quantities:
            at = list(quantity.components)
            rows = np.isin(component, at)
            if rows.any():
                own[:, at] = variance[:, at] * found.left_of(quantity.name, rows)
        return self.observations.rms(own)
