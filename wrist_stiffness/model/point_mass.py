"""A mass at a place: linear in the mass and in its first moment, mass times place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wrist_stiffness.model.columns import Column, Factor, Values, factor
from wrist_stiffness.model.parameters import Parameter

PLACE = {axis: f"{axis}_mm" for axis in "xyz"}


def mass_columns(
    parameters: Sequence[Parameter], mass_g: float, at: Values, arm_mm: float
) -> tuple[Column, ...]:
    """Return columns of a mass and of its first moment along x, y and z.

    `parameters`: among them `mass_g`, `x_mm`, `y_mm` and `z_mm`.  `at`: values of all other
    parameters in the trials; the first moment counts from its place.  `arm_mm`: by how much the
    trials move the mass.
    """
    own = {each.key: each for each in parameters}
    heavy = at | {"mass_g": mass_g}
    return (
        Column(factor(own["mass_g"]), heavy, mass_g),
        *(
            Column(
                Factor(_moment(axis), plausible=own["mass_g"].scale * own[key].scale),
                heavy | {key: at[key] + arm_mm},
                mass_g * arm_mm,
                heavy,
            )
            for axis, key in PLACE.items()
        ),
    )


def place_of(
    parameters: Sequence[Parameter], found: Mapping[str, float], mass_g: float, at: Values
) -> Values:
    """Return where a mass is, within the bounds, by the factors of `mass_columns`."""
    own = {each.key: each for each in parameters}
    return {
        key: own[key].within(at[key] + found[_moment(axis)] / mass_g) for axis, key in PLACE.items()
    }


def _moment(axis: str) -> str:
    return f"moment_{axis}_gmm"
