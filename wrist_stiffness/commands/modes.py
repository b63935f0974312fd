"""Natural frequencies of a wrist over its workspace, with flanges open, at rest and closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.commands.picture_folder import picture_folder
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.modes import NaturalModes, RigidBody, natural_modes, plate
from wrist_stiffness.mechanism.vectors import cross

PER_AXIS = 31
"""Grid of the map; a pose costs some 5 ms for each state of the flanges."""

PICTURED_POSE = np.radians([25.0, -20.0])

STATES = ("open", "at rest", "closed")
"""No flange touches; those touch that do under own weight and payload; all do."""


def payload_of(
    mass_and_place: Sequence[float] | None, inertia_kg_mm2: Sequence[float] | None
) -> RigidBody | None:
    """Return a payload from what people type.

    Parameters
    ----------
    mass_and_place : 4 numbers or None
        Mass [kg] and centre of gravity in U [mm].
    inertia_kg_mm2 : 3 numbers or None
        Moments of inertia about that, along the axes of U [kg mm^2]; a point if None.

    Raises
    ------
    InputError
        If the mass is not above zero, no body has this inertia, or there is no mass to it.
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
    """Natural frequencies over the map domain, motors locked, without damping.

    Parameters
    ----------
    poses : (n, n, 2) float
        Motor angles on a grid [rad].
    frequency : dict of str to (n, n, 6) float
        By state of the flanges, the slowest first [Hz]; NaN outside the domain.
    """

    poses: Array
    frequency: dict[str, Array]

    def operative(self, table: Table, state: str) -> Array:
        """Frequencies in the operative workspace (k, 6) [Hz]."""
        return self.frequency[state][table.workspace.operative(self.poses)]


def mode_map(table: Table, payload: RigidBody | None = None, per_axis: int = PER_AXIS) -> ModeMap:
    """Solve for the natural modes on a grid over the map domain.

    Parameters
    ----------
    table : Table
        With masses.
    payload : RigidBody, optional
        What the platform carries.
    per_axis : int
        Grid points along each motor angle.

    Returns
    -------
    ModeMap
        On the grid.

    Raises
    ------
    TableError
        If the table is of an older version and holds no masses.
    LoadRangeError
        If the payload weighs more than the table's range.
    """
    poses = table.workspace.rectangle_grid(per_axis)
    inside = table.workspace.domain(poses)
    configuration = table.mechanism.forward(poses[inside])
    found = {}
    for state in STATES:
        values = np.full((*poses.shape[:-1], 6), np.nan)
        values[inside] = modes_at(table, configuration, payload, state).frequency
        found[state] = values
    return ModeMap(poses, found)


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
        weight = np.broadcast_to(payload.mass * table.geometry.gravity, (poses, 3))
        place = configuration.platform @ payload.centre
        wrench = np.concatenate([weight, cross(place, weight)], axis=-1)
        for each in wrench:
            table.check_load(each)
    return respond(table.operators_at(configuration, "closed_form"), wrench).active


def draw_modes(
    table: Table, found: ModeMap, folder: str | Path, payload: RigidBody | None = None
) -> list[Path]:
    """Draw the first natural frequency over both motor angles, and the shapes of four modes.

    Parameters
    ----------
    table : Table
        The lookup.
    found : ModeMap
        Of the table and the payload.
    folder : path
        Where the PNG files go; made if missing.
    payload : RigidBody, optional
        What the platform carries.

    Returns
    -------
    list of Path
        `map_mode_1.png` and `mode_shapes.png`.

    Raises
    ------
    InputError
        If the folder cannot be made.
    """
    from wrist_stiffness.report.pictures.bent_wrist import draw_mode_shapes
    from wrist_stiffness.report.pictures.joint_map import draw_map

    pictures = [picture_folder(folder) / name for name in ("map_mode_1.png", "mode_shapes.png")]
    carried = "no payload" if payload is None else f"payload {payload.mass:g} kg"
    draw_map(
        table,
        found.poses,
        found.frequency["at rest"][..., 0],
        "first natural frequency, motors locked [Hz]",
        f"{carried}, flanges as they rest",
        pictures[0],
    )
    configuration = table.mechanism.forward(PICTURED_POSE[None])
    draw_mode_shapes(
        table, configuration, modes_at(table, configuration, payload, "at rest"), pictures[1]
    )
    return pictures
