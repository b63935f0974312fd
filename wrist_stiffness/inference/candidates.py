"""Candidate effects: each a function from parameters to a change of the observations.

A candidate is linear in its `parameters` and may be non-linear in its `shape` (a gap, a time
constant, an order).  For a fixed shape it is a block of columns, so every question about it is
linear algebra; the shape itself is searched on its grid (variable projection).

Nuisances (registrations, zeros, tare, well-known tolerances) are refitted before any effect is
considered: they explain whatever they can first, and an effect counts only for what it explains
beyond them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.observations import Array, Observations


@dataclass(frozen=True)
class Parameter:
    """A factor in front of one column.

    Parameters
    ----------
    name : str
        Name with its unit, for example ``flexibility_percent``.
    lower, upper : float
        What is physically possible.
    plausible : float, optional
        Size that would not surprise: the scale of its prior, and what decides whether the data
        could have shown the effect.
    scale : float, optional
        Usual size, if that is another one: then the scale of its prior.  Without either it is the
        size at which the column does as much as the base leaves.
    """

    name: str
    lower: float = -np.inf
    upper: float = np.inf
    plausible: float | None = None
    scale: float | None = None

    def __post_init__(self) -> None:
        """Refuse sizes that no prior can have, and bounds with nothing between them."""
        for key, size in (("plausible", self.plausible), ("scale", self.scale)):
            if size is not None and not 0.0 < size < np.inf:
                raise InputError(f"{self.name}: {key} is {size:g}, must be finite and above 0")
        if not self.lower < self.upper:
            bounds = f"lower is {self.lower:g}, upper is {self.upper:g}"
            raise InputError(f"{self.name}: {bounds}: lower must be smaller")


@dataclass(frozen=True)
class ShapeParameter:
    """A parameter on which the columns depend non-linearly, with the values to try first.

    Parameters
    ----------
    name : str
        Name with its unit, for example ``time_constant_s``.
    grid : tuple of float
        Increasing values; the search stays between the first and the last.
    """

    name: str
    grid: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse a grid that cannot be searched."""
        if len(self.grid) < 2 or any(np.diff(self.grid) <= 0):
            raise InputError(f"grid of {self.name!r} needs at least two increasing values")


@dataclass(frozen=True)
class Candidate:
    """One effect at one place.

    Parameters
    ----------
    effect, component : str
        What, and where.
    parameters : tuple of Parameter
        One for each of the k columns.
    columns : callable
        (observations, shape values) -> (n, m, k) change of the observations per parameter.
    shape : tuple of ShapeParameter, optional
        Non-linear parameters, in the order in which `columns` takes them.
    needs : str, optional
        What data would excite the effect.
    evidence, check : str, optional
        What a technician would see; what to do on the machine to be sure.
    compensable : str, optional
        ``yes``, ``needs_signal`` or ``no``.
    inexactness : float, optional
        Share of what the effect does by which its law may be wrong under any one condition (0.05:
        5 %); what is left of a large effect within it is no evidence for another one.
    """

    effect: str
    component: str
    parameters: tuple[Parameter, ...]
    columns: Callable[[Observations, tuple[float, ...]], Array]
    shape: tuple[ShapeParameter, ...] = ()
    needs: str = "more varied conditions"
    evidence: str = ""
    check: str = ""
    compensable: str = "yes"
    inexactness: float = 0.05

    def __post_init__(self) -> None:
        """Refuse a law without a column."""
        if not self.parameters:
            raise InputError(f"{self.name} has no parameter, it needs one for each column")

    @property
    def name(self) -> str:
        """Effect and place as one word, ``effect@component``."""
        return f"{self.effect}@{self.component}"

    @property
    def shapes(self) -> list[tuple[float, ...]]:
        """Every combination of the grids; one empty shape for a linear effect."""
        return list(product(*(shape.grid for shape in self.shape)))

    def evaluate(self, observations: Observations, shape: tuple[float, ...]) -> Array:
        """Columns at one shape, (n, m, k).

        Raises
        ------
        InputError
            If the columns have another size than announced or are not numbers.
        """
        columns = np.asarray(self.columns(observations, shape), dtype=np.float64)
        expected = (*observations.values.shape, len(self.parameters))
        if columns.shape != expected:
            raise InputError(f"{self.name} returned columns {columns.shape}, not {expected}")
        if not np.isfinite(columns).all():
            raise InputError(f"{self.name} returned a column that is not a number")
        return columns


@dataclass(frozen=True)
class Nuisance:
    """A group of columns that belongs to the base.

    Parameters
    ----------
    name : str
        What a person calls it, for example ``registration of the tracker``.
    columns : callable
        observations -> (n, m, p).
    prior_std : tuple of float, optional
        Standard deviation of each of the p parameters around zero; without it they are free.
    per_session : bool, optional
        Set anew in every session (a registration) instead of once for the machine.
    """

    name: str
    columns: Callable[[Observations], Array]
    prior_std: tuple[float, ...] | None = None
    per_session: bool = False


@dataclass(frozen=True, eq=False)
class NuisanceColumns:
    """All nuisance groups over one table."""

    columns: Array  # (n, m, p), change of the observations per parameter
    prior_std: Array  # (p,), infinite where the parameter is free
    # group, session (None = the same in all sessions) and place in the group
    keys: tuple[tuple[str, int | None, int], ...]


def nuisance_columns(
    observations: Observations, nuisances: tuple[Nuisance, ...]
) -> NuisanceColumns:
    """Evaluate every group, with one copy per session where it is set anew.

    Raises `InputError` if columns and priors do not fit together, or a column is not a number.
    """
    n, m = observations.values.shape
    blocks, priors = [np.empty((n, m, 0))], [np.empty(0)]
    keys: list[tuple[str, int | None, int]] = []
    for nuisance in nuisances:
        columns = np.asarray(nuisance.columns(observations), dtype=np.float64)
        if columns.shape[:2] != (n, m) or columns.ndim != 3:
            raise InputError(f"{nuisance.name} returned columns {columns.shape}, not {(n, m)} x p")
        if not np.isfinite(columns).all():
            raise InputError(f"{nuisance.name} returned a column that is not a number")
        p = columns.shape[2]
        prior = np.full(p, np.inf) if nuisance.prior_std is None else np.array(nuisance.prior_std)
        if prior.shape != (p,) or not (prior > 0).all():
            raise InputError(f"{nuisance.name} needs {p} positive prior deviations, has {prior}")
        sessions: list[int | None] = [None]
        if nuisance.per_session:
            sessions = [int(session) for session in np.unique(observations.sessions)]
        for session in sessions:
            inside = 1.0 if session is None else (observations.sessions == session)[:, None, None]
            blocks.append(columns * inside)
            priors.append(prior)
            keys += [(nuisance.name, session, place) for place in range(p)]
    return NuisanceColumns(np.concatenate(blocks, axis=2), np.concatenate(priors), tuple(keys))
