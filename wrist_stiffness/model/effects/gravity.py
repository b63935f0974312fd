"""Weights that are not the modelled ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.components import ELASTIC, LINKS
from wrist_stiffness.mechanism.statics import component_rotations, weight_response
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.columns import Column, Recipe, Shape, Values, factor
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.point_mass import mass_columns, place_of
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import vector

TILTS = ("tilt_x_mdeg", "tilt_y_mdeg")

TRIAL_G, TRIAL_MM, TRIAL_MDEG = 10.0, 10.0, 100.0
"""Of the trials for columns; the effect is linear in the mass, its first moment and small tilts."""


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
        centre = tuple(Parameter(f"{a}_mm", -500.0, 500.0, 20.0, linear=False) for a in "xyz")
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
        columns = mass_columns(parameters, TRIAL_G, nothing, TRIAL_MM)
        tilts = [each for each in parameters if each.key in TILTS]
        columns += tuple(
            Column(factor(each), nothing | {each.key: TRIAL_MDEG}, TRIAL_MDEG) for each in tilts
        )

        def start(found: Mapping[str, float], at: Shape) -> Values:
            mass = found["mass_g"]
            centre = place_of(parameters, found, mass or 1.0, nothing)
            return centre | {"mass_g": mass} | {each.key: found[each.key] for each in tilts}

        return Recipe((), lambda at: columns, start)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the weight as a wrench, and the change of all weights by the tilt."""
        modelled = at.table.geometry.gravity
        tilt = [values.get(key, 0.0) for key in TILTS]
        gravity = Rotation.from_rotvec([*tilt, 0.0]).apply(modelled)
        weight = np.empty((len(at.block), 6))
        weight[:, :3] = values["mass_g"] * gravity
        weight[:, 3:] = cross(at.body(place) @ vector(values, "{}_mm"), weight[:, :3])
        if place == "platform":
            added = Contribution(wrench=weight)
            return (added + tilted(at, gravity - modelled) if any(tilt) else added), None
        ends = np.zeros((len(weight), len(ELASTIC), 6))
        ends[:, ELASTIC.index(place)] = 0.5 * weight
        return Contribution(through=at.influence.through_components(ends, ends)), None


def tilted(at: Situation, change: np.ndarray) -> Contribution:
    """Return what a change of gravity (3,) in F [m/s^2] does to the weights of all parts."""
    sectors = at.parts.sectors
    turn = component_rotations(at.configuration).take(sectors.component, axis=-3)
    return Contribution(
        through=weight_response(at.configuration, at.parts, change).wrench,
        gap=np.einsum("mi,nmji,j->nm", sectors.weight_approach, turn, change),
    )
