"""Whose share is it?  The error budget of a load by component, over the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.response import RATED_FORCE, respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.energy import strain_energies
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.vectors import cross

PER_AXIS = 41


@dataclass(frozen=True)
class Push:
    """A load in fixed axes of F at a point of the platform."""

    # `force`, `moment`: (3,), in F [N, N m]
    force: Array
    moment: Array
    point: Array  # (3,), where the force acts, in U [m]

    @classmethod
    def rated(cls, table: Table) -> Push:
        """Return the rated load of the maps."""
        return cls(RATED_FORCE, np.zeros(3), table.geometry.load_point)

    @classmethod
    def of_millimetres(cls, load: Sequence[float], point_mm: Sequence[float]) -> Push:
        """Return a load from 3 or 6 numbers [N, N m] and its point in U [mm].

        Raises `InputError` if all numbers are zero: no load, no shares of it.
        """
        if not np.any(load):
            raise InputError("load: all numbers are 0, there is nothing to share out")
        whole = np.concatenate([np.array(load, dtype=float), np.zeros(6 - len(load))])
        return cls(whole[:3], whole[3:], 1e-3 * np.array(point_mm, dtype=float))

    @property
    def text(self) -> str:
        """The load in words, for titles."""
        force = ", ".join(f"{value:.3g}" for value in self.force)
        point = ", ".join(f"{1e3 * value:.3g}" for value in self.point)
        words = f"({force}) N at ({point}) mm"
        if np.any(self.moment):
            words += f", ({', '.join(f'{value:.3g}' for value in self.moment)}) N m"
        return words

    def wrench(self, platform: Array) -> Array:
        """Return the wrench at O in F, (..., 6), for rotations U -> F (..., 3, 3)."""
        force = np.broadcast_to(self.force, (*platform.shape[:-2], 3))
        moment = self.moment + cross(platform @ self.point, force)
        return np.concatenate([force, moment], axis=-1)


@dataclass(frozen=True)
class Budget:
    """What a load alone does at poses on a grid over the map domain."""

    theta: Array  # (n, 2), motor angles [rad]
    operative: NDArray[np.bool_]  # (n,), poses in the operative workspace
    twist: Array  # (n, 6), of the platform, own weight left out [m, rad]
    # (n, 8), part of the strain energy by component, in the order of `ELASTIC`; rows add up to 1
    shares: Array


def budget(table: Table, push: Push, per_axis: int = PER_AXIS) -> Budget:
    """Compute twist and energy shares of a load over the workspace.

    `table`: the lookup; evaluated in closed form, because only that knows the components.  Raises
    `LoadRangeError` if the load at O is outside the table's range.
    """
    theta = table.workspace.grid(per_axis)
    configuration = table.mechanism.forward(theta)
    wrench = push.wrench(configuration.platform)
    for each in np.reshape(wrench, (-1, 6)):
        table.check_load(each)
    twist, shares = load_alone(table, configuration, wrench)
    return Budget(theta, table.workspace.operative(theta), twist, shares)


def load_alone(table: Table, configuration: Configuration, wrench: Array) -> tuple[Array, Array]:
    """Return twists (..., 6) and energy shares (..., 8) of wrenches (..., 6) without own weight.

    Without a load all shares are 0.
    """
    operators = contact_operators(configuration, table.components, np.zeros(3))
    response = respond(operators, wrench)
    energy = strain_energies(configuration, table.components, wrench, response.force)
    total = energy.sum(axis=-1, keepdims=True)
    return response.twist, energy / np.where(total > 0.0, total, 1.0)
