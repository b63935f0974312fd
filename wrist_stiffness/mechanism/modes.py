"""Natural modes of the wrist with its motors locked.

With the slides free, every motion is a choice of the elastic screws of the eight components: these
48 numbers are the coordinates, their flexibility is block diagonal, and the laws that carry a
screw to the frames (`influence.py`) carry the parts' condensed masses back.  A flange that touches
and stays in touch is a constraint, which only lessens the flexibility:

    C = diag(C_k) - S A^-1 S'        M = sum_k J_k' M_k J_k + G' M_platform G        C M x = x / w^2
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError, TableError
from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import PlatformDimensions
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import (
    component_rotations,
    contact_operators,
    turned_flexibilities,
)
from wrist_stiffness.mechanism.vectors import beside, block_diagonal, skew

MODES = 6
"""So many are told at each pose."""

COORDINATES = 6 * len(ELASTIC)


@dataclass(frozen=True)
class RigidBody:
    """A mass that moves with the platform.

    Raises `InputError` if the mass is negative, or no body has such an inertia.
    """

    mass: float  # [kg]
    centre: Array  # (3,), its centre of gravity in U [m]
    inertia: Array  # (3, 3), about that, in the axes of U [kg m^2]

    def __post_init__(self) -> None:
        """Refuse what no body is."""
        if not self.mass >= 0.0:
            raise InputError(f"mass of {self.mass:g} kg is not 0 or more")
        if not np.min(self.second_moments) >= -1e-9 * np.max(np.abs(self.inertia)):
            raise InputError(
                "no body has moments of inertia of "
                f"{', '.join(f'{v:g}' for v in np.linalg.eigvalsh(self.inertia))} kg m^2: "
                "none may be negative or larger than the other two together"
            )

    @property
    def second_moments(self) -> Array:
        """Integrals of the mass times the squares of the places along the principal axes (3,)."""
        moments = np.linalg.eigvalsh(self.inertia)
        return np.asarray(moments.sum() / 2.0 - moments)

    @property
    def at_centre(self) -> Array:
        """Mass for screws of U at O, (6, 6) [kg, kg m, kg m^2]."""
        arm = skew(self.centre)
        coupled = self.mass * arm
        return np.block(
            [[self.mass * np.eye(3), -coupled], [coupled, self.inertia - coupled @ arm]]
        )


def plate(platform: PlatformDimensions) -> RigidBody:
    """Return the platform: a round plate of even thickness."""
    radius, along = platform.diameter / 2.0, np.outer(platform.normal, platform.normal)
    across = (3.0 * radius**2 + platform.thickness**2) / 12.0
    shape = across * (np.eye(3) - along) + radius**2 / 2.0 * along
    return RigidBody(platform.mass, platform.centre_of_gravity, platform.mass * shape)


@dataclass(frozen=True)
class NaturalModes:
    """Natural modes at poses of shape (...), the slowest first."""

    frequency: Array  # (..., k) [Hz]
    # (..., k, 8, 6), elastic screw of each component, of any scale, at O in F [m, rad]
    screws: Array


def natural_modes(
    configuration: Configuration,
    components: ElasticComponents,
    bodies: tuple[RigidBody, ...],
    closed: NDArray[np.bool_],
) -> NaturalModes:
    """Solve for the slowest natural modes at poses, motors locked, without damping.

    Inertia inside a part follows its frames as in statics, so modes far below the parts' own are
    right (docs/physics.md).

    `configuration`: of shape (...); `bodies`: what moves with the platform: its plate, and a
    payload; `closed` (..., m): flange sectors that are and stay in touch.  Gives
    `NaturalModes`: of shape (...).  Raises `TableError` if the components have no masses.
    """
    if components.mass is None:
        raise TableError(
            "the table holds no masses, an older version made it; build it again with "
            "'wrist-stiffness table build'"
        )
    mass = _mass(configuration, components, bodies)
    flexibility = _flexibility(configuration, components, np.asarray(closed))
    # Metres and radians are brought to one size before a root is taken.
    size = np.sqrt(np.diagonal(mass, axis1=-2, axis2=-1).mean(axis=tuple(range(mass.ndim - 2))))
    size[size == 0.0] = 1.0
    value, vector = np.linalg.eigh(flexibility * np.outer(size, size))
    root = vector * np.sqrt(np.maximum(value, 0.0))[..., None, :]
    scaled = mass / np.outer(size, size)
    square, shape = np.linalg.eigh(np.swapaxes(root, -1, -2) @ scaled @ root)
    slowest = root @ shape[..., : -MODES - 1 : -1] / size[:, None]
    screws = np.swapaxes(slowest, -1, -2)
    return NaturalModes(
        frequency=1.0 / (2.0 * np.pi * np.sqrt(square[..., : -MODES - 1 : -1])),
        screws=screws.reshape(*screws.shape[:-1], len(ELASTIC), 6),
    )


def _mass(
    configuration: Configuration, components: ElasticComponents, bodies: tuple[RigidBody, ...]
) -> Array:
    projectors = influence(configuration)
    both = np.concatenate(
        [beside(block_diagonal(laws)) for laws in projectors.of_frames()], axis=-2
    )
    turn = block_diagonal(component_rotations(configuration))
    home = np.zeros((*turn.shape[:-2], 12, 12))
    home[..., :6, :6] = home[..., 6:, 6:] = np.swapaxes(turn, -1, -2)
    both = home @ both
    parts = (np.swapaxes(both, -1, -2) @ components.mass @ both).sum(axis=-3)
    back = np.swapaxes(block_diagonal(configuration.platform), -1, -2)
    moved = back @ beside(block_diagonal(projectors.of_components()))
    carried = sum(body.at_centre for body in bodies)
    total: Array = parts + np.swapaxes(moved, -1, -2) @ carried @ moved
    return total


def _flexibility(
    configuration: Configuration, components: ElasticComponents, closed: NDArray[np.bool_]
) -> Array:
    own = turned_flexibilities(configuration, components)
    lead = own.shape[:-3]
    flexibility = np.zeros((*lead, len(ELASTIC), 6, len(ELASTIC), 6))
    for k in range(len(ELASTIC)):
        flexibility[..., k, :, k, :] = own[..., k, :, :]
    flexibility = flexibility.reshape(*lead, COORDINATES, COORDINATES)
    sectors = components.sectors
    if not closed.any():
        return flexibility
    operators = contact_operators(configuration, components, np.zeros(3))
    pressed = np.swapaxes(operators.screw_gap, -3, -2)  # (..., 8, m, 6)
    pressed = pressed @ own
    turn = block_diagonal(component_rotations(configuration))
    for number, (component, screw) in enumerate(zip(sectors.component, sectors.screw, strict=True)):
        pressed[..., component, number, :] += turn[..., component, :, :] @ screw
    by_force = np.swapaxes(pressed, -2, -1).reshape(*lead, COORDINATES, len(sectors.gap))
    # A sector that does not touch gets an equation of its own, without effect.
    by_force = by_force * closed[..., None, :]
    both = closed[..., :, None] & closed[..., None, :]
    approach = np.where(both, operators.approach, np.eye(len(sectors.gap)))
    return flexibility - by_force @ np.linalg.solve(approach, np.swapaxes(by_force, -1, -2))
