"""Natural frequencies of a wrist over its workspace, with flanges open, at rest and closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.commands.budget import Push
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.modes import NaturalModes, RigidBody, natural_modes, plate

PER_AXIS = 31
"""Grid of the map; a pose costs some 5 ms for each state of the flanges."""

STATES = ("open", "at rest", "closed")
"""No flange touches; those touch that do under own weight and payload; all do."""

ModeSummary = dict[str, dict[str, list[float]]]
"""Lowest, mean and highest of each mode, by state of the flanges [Hz]."""


def payload_of(
    mass_and_place: Sequence[float] | None, inertia_kg_mm2: Sequence[float] | None
) -> RigidBody | None:
    """Return a payload from what people type.

    `mass_and_place` (4 numbers): mass [kg] and centre of gravity in U [mm]; `inertia_kg_mm2` (3
    numbers): moments of inertia about that, along the axes of U [kg mm^2]; a point if None.  Raises
    `InputError` if the mass is not above zero, no body has this inertia, or there is no mass to it.
    """
    if mass_and_place is None:
        if inertia_kg_mm2 is not None:
            raise InputError("an inertia of the payload needs its mass and place: --payload")
        return None
    mass, *place = mass_and_place
    if not mass > 0.0:
        raise InputError(f"payload of {mass:g} kg is not above 0")
    inertia = np.diag(1e-6 * np.array(inertia_kg_mm2 or [0.0] * 3, dtype=float))
    return RigidBody(mass, 1e-3 * np.array(place), inertia)


@dataclass(frozen=True)
class ModeMap:
    """Natural frequencies over the map domain, motors locked, without damping."""

    poses: Array  # (n, n, 2), motor angles on a grid [rad]
    # dict of str to (n, n, 6), by state of the flanges, the slowest first [Hz]; NaN outside the
    # domain
    frequency: dict[str, Array]


def mode_map(table: Table, payload: RigidBody | None = None) -> ModeMap:
    """Solve for the natural modes on a grid over the map domain.

    Raises `TableError` if the table is of an older version and holds no masses; `LoadRangeError` if
    the payload weighs more than the table's range.
    """
    poses = table.workspace.rectangle_grid(PER_AXIS)
    inside = table.workspace.domain(poses)
    configuration = table.mechanism.forward(poses[inside])
    found = {}
    for state in STATES:
        values = np.full((*poses.shape[:-1], 6), np.nan)
        values[inside] = modes_at(table, configuration, payload, state).frequency
        found[state] = values
    return ModeMap(poses, found)


def summarise(table: Table, found: ModeMap) -> ModeSummary:
    """Return frequencies [Hz] in the operative workspace by state of the flanges."""
    inside = table.workspace.operative(found.poses)
    return {
        state: {
            name: getattr(values[inside], name)(axis=0).tolist() for name in ("min", "mean", "max")
        }
        for state, values in found.frequency.items()
    }


def modes_at(
    table: Table, configuration: Configuration, payload: RigidBody | None, state: str
) -> NaturalModes:
    """Return the natural modes at poses of shape (n,) with the flanges in one of `STATES`."""
    carried = plate(table.geometry.platform)
    bodies = (carried,) if payload is None else (carried, payload)
    touching = _touching(table, configuration, payload, state)
    return natural_modes(configuration, table.components, bodies, touching)


def _touching(
    table: Table, configuration: Configuration, payload: RigidBody | None, state: str
) -> NDArray[np.bool_]:
    poses, sectors = len(configuration.theta), len(table.components.sectors.gap)
    if state != "at rest":
        return np.full((poses, sectors), state == "closed")
    wrench = np.zeros((poses, 6))
    if payload is not None:
        weight = Push(payload.mass * table.geometry.gravity, np.zeros(3), payload.centre)
        wrench = weight.wrench(configuration.platform)
        for each in wrench:
            table.check_load(each)
    return respond(table.operators_at(configuration, "closed_form"), wrench).active
