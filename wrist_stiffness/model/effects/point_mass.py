"""Masses that are not the modelled ones: their weight, and their inertia in fast motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import ELASTIC, LINKS
from wrist_stiffness.mechanism.statics import component_rotations, weight_wrench
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.columns import Column, Recipe, Shape, Values
from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues
from wrist_stiffness.model.memory import slope
from wrist_stiffness.model.parameters import Parameter, vector

PLACE = {axis: f"{axis}_mm" for axis in "xyz"}

TILTS = ("tilt_x_mdeg", "tilt_y_mdeg")

TRIAL_G, TRIAL_MM, TRIAL_MDEG = 10.0, 10.0, 100.0
"""Of the trials for columns; the effect is linear in the mass, its first moment and small tilts."""

AT_PLATE = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": -12.0, "inertia_gmm2": 0.0}
"""About where the shipped wrist has its plate: from there a moving mass is sought."""


def by_first_moment(
    parameters: Sequence[Parameter],
    mass_g: float,
    at: Values,
    arm_mm: float,
    sizes: Mapping[str, float],
    lightest_g: float = -np.inf,
) -> Recipe:
    """Return columns of a mass, of its first moment along x, y and z, and of further parameters.

    The first moment, mass times place, is linear where the place is not.

    `parameters`: among them `mass_g`, `x_mm`, `y_mm` and `z_mm`.  `mass_g`, `arm_mm`: mass of the
    trials, and by how much they move it.  `at`: values of all other parameters in the trials; the
    first moment counts from its place.  `sizes`: of the trials of further parameters.
    `lightest_g`: mass with which a fit begins at least.
    """
    own, still = {each.key: each for each in parameters}, at | {"mass_g": 0.0}
    heavy = at | {"mass_g": mass_g}
    columns = [Column(own["mass_g"], heavy, mass_g)]
    for axis, key in PLACE.items():
        moment = Parameter(_moment(axis), -np.inf, np.inf, own["mass_g"].scale * own[key].scale)
        moved = heavy | {key: at[key] + arm_mm}
        columns.append(Column(moment, moved, mass_g * arm_mm, heavy))
    columns += [Column(own[key], still | {key: size}, size) for key, size in sizes.items()]

    def start(found: Mapping[str, float], shape: Shape) -> Values:
        mass = max(found["mass_g"], lightest_g)
        begin = {"mass_g": mass} | {key: found[key] for key in sizes}
        for axis, key in PLACE.items():
            begin[key] = own[key].within(at[key] + found[_moment(axis)] / (mass or 1.0))
        return begin

    return Recipe((), lambda shape: tuple(columns), start)


def _moment(axis: str) -> str:
    return f"moment_{axis}_gmm"


class Gravity(Law):
    """A mass more (or less) at a centre of gravity fixed in the body.

    A mass on a link pulls half at each bore.  At the platform also the mounting tilt, which turns
    gravity in F and so every weight.
    """

    id = "gravity"
    stage = "load"
    places = ("platform", *LINKS)
    sentence = "{place} carries a weight that is not modelled, or the wrist is mounted tilted"
    check = "weigh payload and fittings; lay a level on the base"
    excited_by = "unloaded poses all over the workspace"
    smooth = False
    inexactness = 0.0

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return mass and centre of gravity in the body at home, and the tilt of the base."""
        centre = tuple(Parameter(key, -500.0, 500.0, 20.0, linear=False) for key in PLACE.values())
        mass = Parameter("mass_g", -500.0, 20000.0, 30.0, linear=False)
        if place != "platform":
            return (mass, *centre)
        tilt = (Parameter(key, -2e5, 2e5, 1000.0, linear=False) for key in TILTS)
        return (mass, *centre, *tilt)

    def sized_by(self, place: str) -> tuple[str, ...]:
        """Return all but the tilt: a heavy payload does not turn the wrist."""
        return tuple(each.key for each in self.parameters(place) if each.key not in TILTS)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return columns of the mass and its first moment, and of the tilt of the base."""
        parameters = self.parameters(place)
        nothing = {each.key: 0.0 for each in parameters}
        tilts = {key: TRIAL_MDEG for key in TILTS if key in nothing}
        return by_first_moment(parameters, TRIAL_G, nothing, TRIAL_MM, tilts)

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the weight as a wrench, and the change of all weights by the tilt."""
        modelled = at.table.geometry.gravity
        tilt = [values.get(key, 0.0) for key in TILTS]
        gravity = Rotation.from_rotvec([*tilt, 0.0]).apply(modelled)
        weight = np.empty((len(at.block), 6))
        weight[:, :3] = values["mass_g"] * gravity
        weight[:, 3:] = cross(at.body(place) @ vector(values, "{}_mm"), weight[:, :3])
        if place == "platform":
            added = Contribution(wrench=weight)
            return added + tilted(at, gravity - modelled) if any(tilt) else added
        ends = np.zeros((len(weight), len(ELASTIC), 6))
        ends[:, ELASTIC.index(place)] = 0.5 * weight
        return Contribution(through=at.influence.through_components(ends, ends))


def tilted(at: Situation, change: np.ndarray) -> Contribution:
    """Return what a change of gravity (3,) in F [m/s^2] does to the weights of all parts."""
    sectors = at.parts.sectors
    turn = component_rotations(at.configuration).take(sectors.component, axis=-3)
    return Contribution(
        through=weight_wrench(at.configuration, at.parts, change, at.influence),
        gap=np.einsum("mi,nmji,j->nm", sectors.weight_approach, turn, change),
    )


class Inertia(Law):
    """-m a of a mass at a centre of gravity in U, and -I alpha of a round inertia about it.

    The acceleration is the backward difference of the rigid platform's velocity.
    """

    id = "inertia"
    stage = "load"
    places = ("platform",)
    sentence = "the platform's mass resists fast motion"
    check = "repeat the motion at half the speed: the error falls to a quarter"
    signals = ("motor speeds, or a dense recording",)
    excited_by = "the same motion at several speeds"
    inexactness = 0.03
    own = (
        Parameter("mass_g", 0.0, 5000.0, 50.0, linear=False),
        *(Parameter(key, -200.0, 200.0, 20.0, linear=False) for key in PLACE.values()),
        Parameter("inertia_gmm2", 0.0, 1e8, 1e4, linear=False),
    )

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return columns of a mass moving at the plate, of its place, and of a round inertia."""
        mass, *_, inertia = self.own
        sizes = {inertia.key: inertia.scale}
        return by_first_moment(self.own, mass.scale, AT_PLATE, 1.0, sizes, lightest_g=1.0)

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return the wrench; the state is the last sample's time and velocity."""
        omega = (at.jacobian @ at.speed[..., None])[..., 0]
        alpha, state = slope(at.block.time, omega, state)
        arm = at.body("platform") @ vector(values, "{}_mm")
        acceleration = cross(alpha, arm) + cross(omega, cross(omega, arm))
        wrench = np.empty((len(omega), 6))
        wrench[:, :3] = -values["mass_g"] * acceleration
        wrench[:, 3:] = cross(arm, wrench[:, :3]) - values["inertia_gmm2"] * alpha
        return Contribution(wrench=wrench), state
