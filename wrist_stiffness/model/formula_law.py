"""An effect that a user states as a formula in the model file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.formula import COUNTS, Formula, Past, UndefinedFormulaError
from wrist_stiffness.model.law import Contribution, Law, require_id
from wrist_stiffness.model.parameters import Parameter, si_factor
from wrist_stiffness.model.places import LIMB
from wrist_stiffness.model.situation import Situation

MOTION = ("theta_1", "theta_2", "theta_dot_1", "theta_dot_2")
TURNS = {"turn_2": "joint_2", "turn_3": "joint_3", "turn_4": "joint_4"}
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
TEMPERATURE = "T_"

SIGNALS = frozenset(
    {
        *MOTION,
        *TURNS,
        *WRENCH,
        *(f"W_{axis}" for axis in WRENCH),
        "time",
        *(f"{TEMPERATURE}{part}" for part in (*LIMB, "ambient")),
    }
)
"""What every formula may use."""

LOAD_SENSOR, TOOL = "load_sensor", "tool"
"""Components at which a formula is no screw but a wrench on the platform that the load sensor does
not say: fixed in the cell, and turning with the platform."""

WRENCH_PLACES = (LOAD_SENSOR, TOOL)

FORMULA_PLACES = (*LIMB, *WRENCH_PLACES)
"""Components of a formula."""


def words_of(direction: ArrayLike, digits: int = 12) -> str:
    """Return a direction, or several, as `extend --direction` takes them."""
    rows = np.atleast_2d(direction)
    return "; ".join(" ".join(f"{number:.{digits}g}" for number in row) for row in rows)


class FormulaLaw(Law):
    """A screw along a fixed direction of the component's body, as large as a formula says.

    At the load sensor it is a wrench on the platform, beyond what the sensor says, at O in F; at
    the tool the same in U [N, N m].

    `name`: id of the effect.  `place`: its component.  `direction` (6,) or (r, 6): (translation;
    rotation) at O in the component's home frame for a value of 1 [m, rad], of as many formulas as
    the expression has between commas; their screws add up.  `expression`: in `theta_1`,
    `theta_2` [rad], `theta_dot_1`, `theta_dot_2` [rad/s], `turn_2` ... `turn_4` (turns of the
    passive joints from home [rad]), `fx` ... `mz` (wrench through the component at O in its home
    frame [N, N m]; at the load sensor that on the platform in F, at the tool in U), `W_fx` ...
    `W_mz` (wrench on the platform at O in F), `T_<component>` [degC],
    `time` [s], the covariates and the parameters.  `covariates`: those that it may use.  `keys`:
    parameters; one whose name ends in a known unit is converted to SI units.  Raises `InputError`
    if the id cannot be one, the component carries no screw, the direction is not six finite numbers
    or zero, a name is no name or used twice, the expression is not allowed, or has not as many
    formulas as there are directions.
    """

    check = ""
    excited_by = "a wide range of what the formula depends on"

    def __init__(
        self,
        name: str,
        place: str,
        direction: Array,
        expression: str,
        covariates: Sequence[str],
        keys: Sequence[str],
    ) -> None:
        require_id(name)
        if place not in FORMULA_PLACES:
            known = ", ".join(FORMULA_PLACES)
            raise InputError(f"{name}: component {place!r} is not one of {known}")
        rows = np.atleast_2d(direction)
        for row in rows:
            if row.shape != (6,) or not np.isfinite(row).all() or not row.any():
                raise InputError(
                    f"{name}: direction {row.tolist()} is not six finite numbers, one not zero"
                )
        self.id = name
        self.stage = "load" if place in WRENCH_PLACES else "reaction"
        self.places = (place,)
        self.sentence = f"{{place}}: {expression}"
        self.direction = rows
        self.covariates = tuple(covariates)
        # Their first value is 1: a formula may divide by them.
        self.own = tuple(
            Parameter(key, -np.inf, np.inf, np.inf, mean=1.0, linear=False) for key in keys
        )
        for own in (*self.covariates, *keys):
            if not own.isidentifier():
                raise InputError(f"{name}: {own!r} is not a name")
            if own in SIGNALS or own in COUNTS or (*covariates, *keys).count(own) > 1:
                raise InputError(f"{name}: the name {own} is in use")
        self.formula = Formula(expression, (*sorted(SIGNALS), *self.covariates, *keys))
        if self.formula.count != len(rows):
            raise InputError(
                f"{name}: {expression!r} has commas for {self.formula.count} formulas, but there "
                f"are directions for {len(rows)}"
            )
        self.signals = tuple(
            used
            for used in sorted(self.formula.names)
            if used in self.covariates or used.startswith(TEMPERATURE)
        )

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the screw."""
        variables = {name: self._signal(at, place, name, values) for name in self.formula.names}
        past = Past(at.block.time, dict(state or {}))
        value = self.formula(variables, past)
        if len(self.direction) == 1:
            value = value[..., None]
        size = np.broadcast_to(value, (len(at.block), len(self.direction)))
        if not np.isfinite(size).all():
            row = int(np.argmin(np.isfinite(size).all(axis=1)))
            there = {
                name: float(np.broadcast_to(v, len(size))[row]) for name, v in variables.items()
            }
            per_si = {each.key: 1.0 / si_factor(each.key) for each in self.own}
            told = f"{self.id}: {self.formula.undefined(there, per_si)}"
            raise UndefinedFormulaError(told, float(at.block.time[row]))
        screws = size @ self.direction
        if place == TOOL:
            screws = at.in_base("platform", screws)
        load = self.stage == "load"
        return Contribution(wrench=screws) if load else at.screw(place, screws), past.states or None

    def _signal(
        self, at: Situation, place: str, name: str, values: Mapping[str, float]
    ) -> float | Array:
        if name in values:
            return values[name]
        if name in self.covariates:
            return at.covariate(name)
        if name == "time":
            return at.block.time
        if name.startswith(TEMPERATURE):
            reference = at.table.geometry.reference_temperature
            return at.temperature(name.removeprefix(TEMPERATURE)) + reference
        if name in TURNS:
            return at.turn(TURNS[name])
        if name in MOTION:
            return np.concatenate([at.block.theta, at.speed], axis=1)[:, MOTION.index(name)]
        if name.startswith("W_") or place == LOAD_SENSOR:
            return at.wrench[:, WRENCH.index(name.removeprefix("W_"))]
        place = "platform" if place == TOOL else place
        return at.at_home(place, at.through_place(place))[:, WRENCH.index(name)]
