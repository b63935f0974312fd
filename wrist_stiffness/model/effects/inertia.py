"""Inertia of fast motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.columns import Column, Recipe, Shape, Values, factor
from wrist_stiffness.model.law import Contribution, Law
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.point_mass import mass_columns, place_of
from wrist_stiffness.model.situation import Situation
from wrist_stiffness.model.vector_keys import vector

AT_PLATE = {"x_mm": 0.0, "y_mm": 0.0, "z_mm": -12.0, "inertia_gmm2": 0.0}
"""About where the shipped wrist has its plate: from there a moving mass is sought."""


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

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return mass, its centre of gravity in U, and inertia about it."""
        return (
            Parameter("mass_g", 0.0, 5000.0, 50.0, linear=False),
            *(Parameter(f"{a}_mm", -200.0, 200.0, 20.0, linear=False) for a in "xyz"),
            Parameter("inertia_gmm2", 0.0, 1e8, 1e4, linear=False),
        )

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return columns of a mass moving at the plate, of its place, and of a round inertia."""
        parameters = self.parameters(place)
        own = {each.key: each for each in parameters}
        round_inertia = own["inertia_gmm2"]
        columns = (
            *mass_columns(parameters, own["mass_g"].scale, AT_PLATE, 1.0),
            Column(
                factor(round_inertia),
                AT_PLATE | {"mass_g": 0.0, "inertia_gmm2": round_inertia.scale},
                round_inertia.scale,
            ),
        )

        def start(found: Mapping[str, float], at: Shape) -> Values:
            mass = max(found["mass_g"], 1.0)
            centre = place_of(parameters, found, mass, AT_PLATE)
            return centre | {"mass_g": mass, "inertia_gmm2": max(found["inertia_gmm2"], 0.0)}

        return Recipe((), lambda at: columns, start)

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return the wrench; the state is the last sample's time and velocity."""
        omega = (at.jacobian @ at.speed[..., None])[..., 0]
        time, before = state if state else (at.block.time[0], omega[0])
        interval = np.diff(at.block.time, prepend=time)[:, None]
        step = np.diff(omega, axis=0, prepend=before[None])
        alpha = np.divide(step, interval, out=np.zeros_like(step), where=interval > 0.0)
        arm = at.body("platform") @ vector(values, "{}_mm")
        acceleration = cross(alpha, arm) + cross(omega, cross(omega, arm))
        wrench = np.empty((len(omega), 6))
        wrench[:, :3] = -values["mass_g"] * acceleration
        wrench[:, 3:] = cross(arm, wrench[:, :3]) - values["inertia_gmm2"] * alpha
        return Contribution(wrench=wrench), (at.block.time[-1], omega[-1])
