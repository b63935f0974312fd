"""Parameters of an effect: names with units for people, SI values for the laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array

UNITS = {
    "um": 1e-6,
    "mm": 1e-3,
    "m": 1.0,
    "mdeg": np.pi / 180e3,
    "deg": np.pi / 180.0,
    "mrad": 1e-3,
    "rad": 1.0,
    "N": 1.0,
    "Nmm": 1e-3,
    "Nm": 1.0,
    "g": 1e-3,
    "kg": 1.0,
    "gmm2": 1e-9,
    "ms": 1e-3,
    "s": 1.0,
    "h": 3600.0,
    "K": 1.0,
    "percent": 1e-2,
    "ppm": 1e-6,
}
"""Size in SI units of everything that a parameter's name may end in."""


def has_unit(key: str) -> bool:
    """Tell whether a parameter's name ends in a known unit, as `clearance_um` does."""
    words = key.split("_")
    return len(words) > 1 and words[-1] in UNITS


def si_factor(key: str) -> float:
    """Return the SI size of the unit that a parameter's name ends in.

    `key`: `clearance_um`, `slope_um_per_N`; a name without a known unit is dimensionless.  Gives
    1e-6 for `clearance_um`, 1 where there is no unit.
    """
    words = key.split("_")
    if len(words) >= 4 and words[-2] == "per" and words[-3] in UNITS and words[-1] in UNITS:
        return UNITS[words[-3]] / UNITS[words[-1]]
    return UNITS[words[-1]] if has_unit(key) else 1.0


@dataclass(frozen=True)
class Parameter:
    """One parameter of a law, in the unit that its name ends in.

    Parameters
    ----------
    key : str
        Name with unit as people type it, `clearance_um`.
    lower, upper : float
        Bounds, both allowed.
    scale : float
        Prior standard deviation: how large it may be in an ordinary wrist.  Those of the catalogue
        are assumed.
    mean : float
        Prior mean.
    linear : bool
        Whether the effect is proportional to it (all linear parameters of a law together), so that
        a regression may treat it as a column.
    grid : tuple of float
        Two or more increasing values to try first of a parameter in which the law is not linear;
        those of the catalogue are assumed.

    Raises
    ------
    InputError
        If the grid cannot be searched.
    """

    key: str
    lower: float
    upper: float
    scale: float
    mean: float = 0.0
    linear: bool = True
    grid: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check the grid."""
        if self.grid and not (len(self.grid) > 1 and np.all(np.diff(self.grid) > 0.0)):
            raise InputError(f"{self.key}: grid {self.grid}: not two or more increasing values")

    def within(self, value: float) -> float:
        """Return a value, brought within the bounds."""
        return min(max(value, self.lower), self.upper)


@dataclass(frozen=True)
class Estimate:
    """Value of a parameter and its standard uncertainty, in the unit of its name.

    Parameters
    ----------
    value : float
        The value.
    sigma : float
        One standard uncertainty, not negative.
    """

    value: float
    sigma: float = 0.0


def symmetric(key: str, bound: float, scale: float) -> Parameter:
    """Return a linear parameter with bounds of both signs."""
    return Parameter(key, -bound, bound, scale)


def axis_keys(pattern: str) -> tuple[str, ...]:
    """Return three keys, `pattern` with `{}` replaced by x, y and z."""
    return tuple(pattern.format(axis) for axis in "xyz")


def symmetric_vector(pattern: str, bound: float, scale: float) -> tuple[Parameter, ...]:
    """Return three linear parameters with bounds of both signs."""
    return tuple(symmetric(key, bound, scale) for key in axis_keys(pattern))


def vector(values: Mapping[str, float], *patterns: str) -> Array:
    """Return the three values of each of k patterns, (3 k,)."""
    return np.array([values[key] for pattern in patterns for key in axis_keys(pattern)])
