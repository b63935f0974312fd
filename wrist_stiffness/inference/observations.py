"""The table that a diagnosis starts from: what was measured, under which conditions.

Nothing here knows where the numbers come from.  A row is one *unit*, the smallest thing that
counts as a measurement of its own: the mean over one dwell, or one sample.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.numerals import number

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
Mask = NDArray[np.bool_]


LABELS = ("time_s", "session", "replicate", "samples", "stand")
"""Columns (n,) of a table, where it has them, beside its conditions."""

ROUNDED = 1e-5
"""Of its largest entry, by which the halves of a covariance written with six digits may differ."""

NUMBERS = "biuf"
"""Kinds of NumPy types that are numbers, or yes and no."""


@dataclass(frozen=True)
class Quantity:
    """Some components of an observation that are reported as one length.

    Parameters
    ----------
    name : str
        Short name, for example ``s``.
    unit : str
        Unit of the report, for example ``um``.
    components : tuple of int
        Which components make up the vector.
    per_si : float
        Report units in one unit of the table (1e6 for metres told in micrometres).
    called : tuple of str, optional
        What each component is called, where they are no vector.
    """

    name: str
    unit: str
    components: tuple[int, ...]
    per_si: float = 1.0
    called: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Name and unit, as in ``s_um``."""
        return f"{self.name}_{self.unit}"

    def told(self, size: float, digits: int = 3) -> str:
        """Return a size in its unit as a sentence has it, as in ``12.3 um of s``."""
        return f"{number(size, digits)} {self.unit} of {self.name}"


@dataclass(frozen=True, eq=False)
class Observations:
    """Residuals of a model (measured minus predicted) and the conditions they were seen under.

    Parameters
    ----------
    values : (n, m) array
        Residual of each unit in m components; NaN = not measured.
    covariates : mapping of str to (n,) array
        Conditions of each unit: angles, loads, temperature, signs of approach.
    covariance : (m, m) or (n, m, m) array, optional
        Known random scatter of one unit, without slow wander.
    time_s : (n,) array, optional
        Time of each unit, increasing within a session; without it the order counts.
    session : (n,) array of int, optional
        Units between which the instruments or the machine were set up anew.
    replicate : (n,) array of int, optional
        Units with the same label >= 0 repeat one condition after a new approach.
    samples : (n,) array, optional
        How many samples a unit averages.
    quantities : tuple of Quantity, optional
        What is reported as one length; by default all components as ``value``.
    row : (n,) array of int, optional
        Number of each unit in the table that it was taken from; by default this one.
    stand : (n,) array of int, optional
        Units with the same label >= 0 share a part of their scatter.
    shared : (n, m, s) array, optional
        That part: what each of s standard normal numbers does to a unit; a `covariance` holds it.
    common : (n, m, q) array, optional
        What each of q standard normal numbers does to all units: something of the instrument that
        nobody knows.  `covariance` does not hold it.
    """

    values: Array
    covariates: Mapping[str, Array]
    covariance: Array | None = None
    time_s: Array | None = None
    session: Labels | None = None
    replicate: Labels | None = None
    samples: Array | None = None
    quantities: tuple[Quantity, ...] = field(default=())
    row: Labels | None = None
    stand: Labels | None = None
    shared: Array | None = None
    common: Array | None = None

    def __post_init__(self) -> None:
        """Refuse tables whose columns do not belong together."""
        per_unit = {name: getattr(self, name) for name in (*LABELS, "row")}
        per_unit |= {f"covariate {name!r}": column for name, column in self.covariates.items()}
        whole = {"values": self.values, "covariance": self.covariance}
        for name, column in (whole | per_unit).items():
            if column is not None and getattr(column, "dtype", np.dtype(str)).kind not in NUMBERS:
                raise InputError(f"{name} must be a NumPy array of numbers")
        if self.values.ndim != 2 or self.values.size == 0:
            raise InputError(f"values must be (units, components), not {self.values.shape}")
        n, m = self.values.shape
        if np.isinf(self.values).any():
            raise InputError("values contain an infinite number; write NaN for 'not measured'")
        for name, column in per_unit.items():
            if column is not None and column.shape != (n,):
                raise InputError(f"{name} has shape {column.shape}, but there are {n} units")
            if column is not None and not np.isfinite(column).all():
                row = int(np.flatnonzero(~np.isfinite(column))[0])
                raise InputError(f"{name} is not a number in row {row}")
        if self.covariance is not None and self.covariance.shape not in ((m, m), (n, m, m)):
            raise InputError(
                f"covariance has shape {self.covariance.shape}, needs {(m, m)} or {(n, m, m)}"
            )
        if self.covariance is not None and not np.isfinite(self.covariance).all():
            row = np.argwhere(~np.isfinite(self.covariance))[0][0]
            where = f" in row {row}" if self.covariance.ndim == 3 else ""
            raise InputError(f"covariance is not a number{where}")
        if self.covariance is not None:
            apart = np.abs(self.covariance - np.swapaxes(self.covariance, -1, -2))
            if (apart > ROUNDED * np.abs(self.covariance).max(axis=(-2, -1), keepdims=True)).any():
                raise InputError("covariance is not symmetric")
        if self.time_s is not None:
            same_session = np.diff(self.sessions) == 0
            if (np.diff(self.time_s)[same_session] < 0).any():
                raise InputError("time_s runs backwards inside a session; sort the rows by time")
        if not self.quantities:
            object.__setattr__(self, "quantities", (Quantity("value", "si", tuple(range(m))),))
        for each in self.quantities:
            if missing := set(each.components) - set(range(m)):
                raise InputError(
                    f"quantity {each.name!r} names component {min(missing)}, there are 0 to {m - 1}"
                )

    @property
    def rows(self) -> Labels:
        """Number of each unit in the table that it was taken from, (n,)."""
        return np.arange(self.n_units) if self.row is None else self.row

    @property
    def n_units(self) -> int:
        """Number of units n."""
        return self.values.shape[0]

    @property
    def n_components(self) -> int:
        """Number of components m."""
        return self.values.shape[1]

    @property
    def measured(self) -> Mask:
        """Which entries of `values` were measured, (n, m)."""
        return np.isfinite(self.values)

    @property
    def sessions(self) -> Labels:
        """Session of each unit, (n,); one session where none was given."""
        if self.session is None:
            return np.zeros(self.values.shape[0], dtype=np.int64)
        return self.session

    @property
    def times(self) -> Array:
        """Time of each unit, (n,) [s], or its number where no time was given."""
        if self.time_s is None:
            return np.arange(self.n_units, dtype=np.float64)
        return self.time_s

    @property
    def reported(self) -> tuple[Quantity, ...]:
        """Quantities of which anything was measured."""
        seen = self.measured.sum(axis=0) > 0
        return tuple(q for q in self.quantities if seen[list(q.components)].any())

    def rms(self, variance: Array) -> dict[str, float]:
        """Root mean square of each quantity by its key, from variances (n, m) of its components."""
        mean = np.sum(variance * self.measured, axis=0) / np.maximum(self.measured.sum(axis=0), 1)
        return {
            q.key: float(np.sqrt(mean[list(q.components)].sum())) * q.per_si for q in self.reported
        }

    def covariate(self, name: str) -> Array:
        """One condition by name, (n,).

        Raises
        ------
        InputError
            If the table has no such column.
        """
        try:
            return self.covariates[name]
        except KeyError:
            known = ", ".join(sorted(self.covariates))
            raise InputError(f"no covariate {name!r} in the table, only {known}") from None

    def take(self, rows: Mask | Labels) -> "Observations":
        """Those units only, in the order given by `rows`."""
        own = {name: getattr(self, name) for name in (*LABELS, "shared", "common")}
        taken: dict[str, Any] = {
            name: column if column is None else column[rows] for name, column in own.items()
        }
        if self.covariance is not None and self.covariance.ndim == 3:
            taken["covariance"] = self.covariance[rows]
        covariates = {name: column[rows] for name, column in self.covariates.items()}
        return replace(
            self, values=self.values[rows], covariates=covariates, row=self.rows[rows], **taken
        )

    def with_values(self, values: Array) -> "Observations":
        """Return the same conditions with other measured values, (n, m)."""
        return replace(self, values=values)
