"""How a law becomes columns of a linear fit, and where a fit with the law itself begins.

A law is linear in some parameters and not in others.  The linear ones become columns by
differences; the others are a grid of shapes.  Some laws need other coordinates: a gap, a hardening
or a friction is a shape times a share of it; a mass and its place are linear as a mass and its
first moment (`point_mass`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.parameters import Parameter

Shape = tuple[float, ...]
Values = dict[str, float]

SMALL = 0.1
"""Share of a parameter's prior scale at which a column is the tangent."""


@dataclass(frozen=True)
class Column:
    """One column: (prediction at `trial` - prediction at `origin`) / size, per unit of a factor."""

    # what stands in front of the column, with its bounds and usual size: one of the law's
    # parameters, or one that a recipe has instead
    factor: Parameter
    # `trial`, `origin`: values of the law's parameters, all of them; an empty origin is the law's
    # absence
    trial: Values
    size: float  # how many units of the factor the trial has more than the origin
    origin: Values = field(default_factory=dict)


@dataclass(frozen=True)
class Carried:
    """Columns that are the effect of another law at the same place, times signals.

    For waves that come round more than once in the second of a unit: the effect of the carrier is
    taken once a unit, the signals at all its moments, and columns are exact between the points of
    the grid as well.
    """

    law: str  # Id of the carrier
    values: Values  # of its parameters, all of them
    # (shape, block of n samples) -> (n, k), one for each column of the recipe
    signals: Callable[[Shape, Block], Array]


@dataclass(frozen=True)
class Recipe:
    """Columns of a law at a place.

    Parameters
    ----------
    shape : tuple of Parameter
        What is not linear; a search stays between the first and the last value of each grid.
    columns : callable
        shape -> its columns, of the same factors at every shape.
    start : callable
        (factors by name, shape) -> values of the law's parameters with which a fit may begin; they
        may be out of bounds.
    carried : Carried, optional
        Another way to the same columns.
    """

    shape: tuple[Parameter, ...]
    columns: Callable[[Shape], tuple[Column, ...]]
    start: Callable[[Mapping[str, float], Shape], Values]
    carried: Carried | None = None

    @property
    def shapes(self) -> list[Shape]:
        """Every point of the grid; one without a shape where all is linear."""
        return list(product(*(each.grid for each in self.shape)))


def tangents(parameters: Sequence[Parameter], held: Collection[str] = ()) -> Recipe:
    """Return the recipe of a law that is linear in all parameters without a grid.

    Parameters
    ----------
    parameters : sequence of Parameter
        Of the law at a place.
    held : collection of str
        Those that do nothing there, or are left to a fit of the law itself, which begins with zero.
    """
    active = [each for each in parameters if each.key not in held]
    gridded = [each for each in active if each.grid]
    other = [each for each in active if not each.grid]
    nothing = {each.key: 0.0 for each in parameters}

    def still(at: Shape) -> Values:
        return nothing | dict(zip((each.key for each in gridded), at, strict=True))

    def columns(at: Shape) -> tuple[Column, ...]:
        sizes = {each: SMALL * each.scale for each in other}
        return tuple(
            Column(each, still(at) | {each.key: size}, size) for each, size in sizes.items()
        )

    def start(found: Mapping[str, float], at: Shape) -> Values:
        return still(at) | {each.key: found[each.key] for each in other}

    return Recipe(tuple(gridded), columns, start)


def at_usual_size(parameter: Parameter, size: float) -> Recipe:
    """Return the recipe of a law with one parameter that is nearly linear, by its effect at a size.

    Parameters
    ----------
    parameter : Parameter
        The only one.
    size : float
        In its unit.
    """
    return share_of_shape((parameter,), parameter.key, {parameter.key: size})


def share_of_shape(
    parameters: Sequence[Parameter], key: str, fixed: Mapping[str, float] | None = None
) -> Recipe:
    """Return the recipe of a law that is linear in nothing: its shapes on grids, times a share.

    Parameters
    ----------
    parameters : sequence of Parameter
        Of the law at a place; those with a grid are the shape, unless they are fixed.
    key : str
        The one of them in units of which the share counts, so that it reads as that parameter.
    fixed : dict of str to float
        Values of the others in every trial.
    """
    fixed = fixed or {}
    gridded = [each for each in parameters if each.grid and each.key not in fixed]
    own = next(each for each in parameters if each.key == key)

    def values(at: Shape) -> Values:
        return {**fixed, **dict(zip((each.key for each in gridded), at, strict=True))}

    def columns(at: Shape) -> tuple[Column, ...]:
        return (Column(own, values(at), values(at)[key]),)

    def start(found: Mapping[str, float], at: Shape) -> Values:
        return values(at) | {key: found[key]}

    return Recipe(tuple(gridded), columns, start)
