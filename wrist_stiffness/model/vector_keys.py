"""Parameters that come as vectors: one key for each axis."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.parameters import Parameter, symmetric

AXES = ("x", "y", "z")


def axis_keys(pattern: str) -> tuple[str, ...]:
    """Return three keys, `pattern` with `{}` replaced by x, y and z."""
    return tuple(pattern.format(axis) for axis in AXES)


def symmetric_vector(pattern: str, bound: float, scale: float) -> tuple[Parameter, ...]:
    """Return three linear parameters with bounds of both signs."""
    return tuple(symmetric(key, bound, scale) for key in axis_keys(pattern))


def vector(values: Mapping[str, float], pattern: str) -> Array:
    """Return the three values of a pattern, (3,)."""
    return np.array([values[key] for key in axis_keys(pattern)])


SHIFT, TURN = "shift_{}_um", "turn_{}_mdeg"


def twist_parameters() -> tuple[Parameter, ...]:
    """Return six parameters of a small screw: where something was set up by hand."""
    return (*symmetric_vector(SHIFT, 1e5, 1000.0), *symmetric_vector(TURN, 2e4, 200.0))


def twist(values: Mapping[str, float]) -> Array:
    """Return the small screw that six parameters state, (6,) [m, rad]."""
    return np.concatenate([vector(values, SHIFT), vector(values, TURN)])


FORCE, MOMENT = "f{}_N", "m{}_Nmm"
