"""A one-sided spring in the way of the tool point: the force depends on the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.vectors import cross

FORCE_TOLERANCE = 1e-9
"""Error of the equilibrium force [N]."""


@dataclass(frozen=True)
class EnvironmentSpring:
    """A wall with a stiffness, frictionless.

    Parameters
    ----------
    normal : (3,) float
        Unit vector from the wall towards the tool, in F.
    place : float
        Where the wall begins: component along the normal, from O [m].
    stiffness : float
        [N/m]; 0 for no wall.
    """

    normal: Array
    place: float
    stiffness: float

    def wrench(self, table: Table, configuration: Configuration, tool_point: Array) -> Array:
        """Return what the wall does to the platform when wrist and wall are in equilibrium.

        Parameters
        ----------
        table : Table
            The true wrist.
        configuration : Configuration
            At the true motor angles, one pose.
        tool_point : (3,) float
            In U [m].

        Returns
        -------
        (6,) float
            At O in F [N, N m]; zero where the tool does not touch.
        """
        operators = table.operators_at(configuration, "closed_form")
        arm = configuration.platform @ tool_point
        unit = np.concatenate([self.normal, cross(arm, self.normal)])

        def depth(force: float) -> float:
            # First order: what the wrist gives way along the force is the force's own twist.
            return self.place - float(
                self.normal @ arm + unit @ respond(operators, force * unit).twist
            )

        largest = self.stiffness * max(depth(0.0), 0.0)
        if largest <= FORCE_TOLERANCE:
            return np.zeros(6)
        # The tool gives way, so the depth falls with the force: one root, inside the bracket.
        force = brentq(
            lambda force: force - self.stiffness * max(depth(force), 0.0),
            0.0,
            largest,
            xtol=FORCE_TOLERANCE,
        )
        return force * unit
