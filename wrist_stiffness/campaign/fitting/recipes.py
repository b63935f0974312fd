"""How each law of the catalogue becomes columns: which trials, at which shapes.

A law is linear in some parameters and not in others.  The linear ones become columns by
differences; the others are a grid of shapes.  A few laws need other coordinates: a mass and its
place are linear as a mass and its first moment; a gap, a hardening or a friction is a shape times
a share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from wrist_stiffness.diagnosis import Parameter as Factor
from wrist_stiffness.diagnosis import ShapeParameter
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Estimate, Parameter

Shape = tuple[float, ...]
Values = dict[str, float]

Maker = Callable[[Law, str, frozenset[str], Mapping[str, float]], "Recipe"]

SMALL = 0.1
"""Share of a parameter's prior scale at which a column is the tangent."""

GRIDS: dict[str, tuple[float, ...]] = {
    "time_constant_s": (2.0, 8.0, 25.0, 90.0, 400.0),
    "lag_s": (0.0, 200.0, 1200.0),
    "motor_share_percent": (0.0, 100.0),
    "hysteresis_deg": (0.0, 5.0),
}
"""Values to try first of parameters in which a law is not linear, in the units of their names
(assumed)."""


@dataclass(frozen=True)
class Column:
    """One column: (prediction at `trial` - prediction at `origin`) / size, per unit of a factor.

    Parameters
    ----------
    factor : Factor
        What stands in front of the column.
    trial, origin : dict of str to float
        Values of the law's parameters, all of them; an empty origin is the law's absence.
    size : float
        How many units of the factor the trial has more than the origin.
    """

    factor: Factor
    trial: Values
    size: float
    origin: Values = field(default_factory=dict)


@dataclass(frozen=True)
class Recipe:
    """Columns of a law at a place.

    Parameters
    ----------
    shape : tuple of ShapeParameter
        Grids of what is not linear.
    columns : callable
        shape -> its columns.
    start : callable
        (factors, shape) -> values of the law's parameters with which a fit may begin.
    idle : tuple of str
        Parameters that do nothing here.
    """

    shape: tuple[ShapeParameter, ...]
    columns: Callable[[Shape], tuple[Column, ...]]
    start: Callable[[Mapping[str, float], Shape], Values]
    idle: tuple[str, ...] = ()


def factor(parameter: Parameter) -> Factor:
    """Return a linear parameter as the statistics know it."""
    return Factor(parameter.key, parameter.lower, parameter.upper, parameter.scale)


def recipe(
    law: Law, place: str, signals: frozenset[str], near: Mapping[str, float] | None = None
) -> Recipe:
    """Return how a law becomes columns.

    Parameters
    ----------
    law : Law
        Of the catalogue, or a user's own.
    place : str
        Component.
    signals : frozenset of str
        Components with a thermometer.
    near : dict of str to float, optional
        Values of the law's parameters about which the columns are wanted.
    """
    return SPECIAL.get(law.id, plain)(law, place, signals, near or {})


def plain(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
    """Return differences in most parameters at the points of the grids of the others."""
    parameters = law.parameters(place)
    gridded = [p for p in parameters if p.key in GRIDS and not _idle(p.key, place, signals)]
    other = [p for p in parameters if p.key not in GRIDS]
    shape = tuple(ShapeParameter(p.key, _inserted(GRIDS[p.key], near.get(p.key))) for p in gridded)
    fixed = {p.key: 0.0 for p in parameters if p.key in GRIDS and p not in gridded}

    def still(at: Shape) -> Values:
        return {
            **{p.key: 0.0 for p in other},
            **fixed,
            **dict(zip((p.key for p in gridded), at, strict=True)),
        }

    def columns(at: Shape) -> tuple[Column, ...]:
        return tuple(Column(factor(p), still(at) | {p.key: size(p)}, size(p)) for p in other)

    def size(parameter: Parameter) -> float:
        value = near.get(parameter.key, 0.0)
        return value if abs(value) > SMALL * parameter.scale else SMALL * parameter.scale

    def start(found: Mapping[str, float], at: Shape) -> Values:
        return still(at) | {p.key: found[p.key] for p in other}

    return Recipe(shape, columns, start, tuple(fixed))


def _idle(key: str, place: str, signals: frozenset[str]) -> bool:
    """Tell whether a parameter of warmth does nothing: the part has its own thermometer."""
    return key in ("lag_s", "motor_share_percent") and place in signals


def _inserted(grid: tuple[float, ...], value: float | None) -> tuple[float, ...]:
    """Return a grid with one more value in it."""
    return grid if value is None else tuple(sorted({*grid, value}))


def at_width(key: str, width: float) -> Maker:
    """Return the recipe of a law with one parameter that is nearly linear, at a usual size."""

    def make(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
        (parameter,) = law.parameters(place)
        size = near.get(key, 0.0) or width
        column = Column(factor(parameter), {key: size}, size)
        return Recipe((), lambda at: (column,), lambda found, at: {key: found[key]})

    return make


def shares(key: str, grids: Mapping[str, tuple[float, ...]], fixed: Mapping[str, float]) -> Maker:
    """Return the recipe of a law that is linear in nothing: shapes of `grids`, times a share.

    The share counts in units of `key`, so that it reads as that parameter.
    """

    def make(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
        own = {p.key: p for p in law.parameters(place)}
        names = tuple(grids)

        def columns(at: Shape) -> tuple[Column, ...]:
            values = {**fixed, **dict(zip(names, at, strict=True))}
            return (Column(factor(own[key]), values, values[key]),)

        def start(found: Mapping[str, float], at: Shape) -> Values:
            values = {**fixed, **dict(zip(names, at, strict=True))}
            return values | {key: found[key]}

        shape = tuple(
            ShapeParameter(f"at_{name}", _inserted(grid, near.get(name)))
            for name, grid in grids.items()
        )
        return Recipe(shape, columns, start)

    return make


MASS_G, ARM_MM = 10.0, 10.0
"""Of the trials of a weight; its effect is linear in the mass and in its first moment."""


def first_moment(own: Mapping[str, Parameter], axis: str) -> Factor:
    """Return a mass times its place along an axis, usually as large as both usually are."""
    usual = own["mass_g"].scale * own[f"{axis}_mm"].scale
    return Factor(f"moment_{axis}_gmm", plausible=usual)


def weight(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
    """Return columns of a mass and its first moment, and of the tilt of the base."""
    own = {p.key: p for p in law.parameters(place)}
    zero = dict.fromkeys(own, 0.0)
    heavy = zero | {"mass_g": MASS_G}
    columns = [Column(factor(own["mass_g"]), heavy, MASS_G)]
    for axis in "xyz":
        moment = first_moment(own, axis)
        columns.append(Column(moment, heavy | {f"{axis}_mm": ARM_MM}, MASS_G * ARM_MM, heavy))
    for key in [each for each in own if each not in ("mass_g", "x_mm", "y_mm", "z_mm")]:
        columns.append(Column(factor(own[key]), zero | {key: 100.0}, 100.0))

    def start(found: Mapping[str, float], at: Shape) -> Values:
        mass = found["mass_g"]
        arm = {
            f"{a}_mm": _clipped(own[f"{a}_mm"], found[f"moment_{a}_gmm"] / (mass or 1.0))
            for a in "xyz"
        }
        tilt = {key: found[key] for key in own if key in found}
        return zero | arm | tilt

    return Recipe((), lambda at: tuple(columns), start)


PLATE_MM = -12.0
"""Along z of U, about where the shipped wrist has its plate: from there a moving mass is sought."""


def moving_mass(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
    """Return columns of a mass moving at the plate, of its place, and of a round inertia."""
    own = {p.key: p for p in law.parameters(place)}
    mass, inertia = own["mass_g"].scale, own["inertia_gmm2"].scale
    at_plate = {"mass_g": mass, "x_mm": 0.0, "y_mm": 0.0, "z_mm": PLATE_MM, "inertia_gmm2": 0.0}
    nothing = at_plate | {"mass_g": 0.0}
    columns = [
        Column(factor(own["mass_g"]), at_plate, mass),
        *(
            Column(
                first_moment(own, a),
                at_plate | {f"{a}_mm": at_plate[f"{a}_mm"] + 1.0},
                mass,
                at_plate,
            )
            for a in "xyz"
        ),
        Column(factor(own["inertia_gmm2"]), nothing | {"inertia_gmm2": inertia}, inertia),
    ]

    def start(found: Mapping[str, float], at: Shape) -> Values:
        moved = max(found["mass_g"], 1.0)
        arm = {
            f"{a}_mm": _clipped(
                own[f"{a}_mm"], at_plate[f"{a}_mm"] + found[f"moment_{a}_gmm"] / moved
            )
            for a in "xyz"
        }
        return {"mass_g": moved, **arm, "inertia_gmm2": max(found["inertia_gmm2"], 0.0)}

    return Recipe((), lambda at: tuple(columns), start)


def _clipped(parameter: Parameter, value: float) -> float:
    return min(max(value, parameter.lower), parameter.upper)


ORDERS = tuple(3.0 + 1.2 * i for i in range(40))
"""Waves a turn that are tried first (assumed): a search goes on between two of them."""


def gear(law: Law, place: str, signals: frozenset[str], near: Mapping[str, float]) -> Recipe:
    """Return columns of the waves of a gear on a grid of orders; its run-out is found by a fit."""
    own = {p.key: p for p in law.parameters(place)}
    waves = [key for key in own if key.endswith("_mdeg")]
    still = dict.fromkeys(own, 0.0)
    order = ShapeParameter("order", _inserted(ORDERS, near.get("order")))

    def columns(at: Shape) -> tuple[Column, ...]:
        return tuple(
            Column(factor(own[key]), still | {"order": at[0], key: 1.0}, 1.0) for key in waves
        )

    def start(found: Mapping[str, float], at: Shape) -> Values:
        run_out = {key: near.get(key, 0.0) for key in own if key.startswith("run_out")}
        return still | run_out | {"order": at[0]} | {key: found[key] for key in waves}

    return Recipe((order,), columns, start)


GAPS_UM = (-40.0, -10.0, -2.0, 2.0, 10.0, 40.0)
"""Gaps that are tried first, of both signs (assumed)."""

SPECIAL: dict[str, Maker] = {
    "gravity": weight,
    "inertia": moving_mass,
    "transmission_error": gear,
    "backlash": at_width("width_mdeg", 20.0),
    "joint_clearance": at_width("clearance_um", 5.0),
    "flange_contact": shares("gap_um", {"gap_um": GAPS_UM}, {}),
    "bushing_hardening": shares(
        "hardening_percent_per_N", {"hardening_percent_per_N": (5.0, 50.0, 300.0)}, {}
    ),
    "joint_friction": shares(
        "coefficient",
        {"coefficient": (0.03, 0.15, 0.6), "bristle_um_per_N": (0.0, 30.0)},
        {"preload_N": 0.0, "presliding_um": 3.0},
    ),
}


def effect_at(law: Law, place: str, values: Mapping[str, float]) -> Effect:
    """Return the law with these values, each brought within its bounds."""
    bounds = {p.key: p for p in law.parameters(place)}
    return Effect(
        law, place, {key: Estimate(_clipped(bounds[key], value)) for key, value in values.items()}
    )
