"""Platform twist under a load: the linear part, and contact where flanges touch.

0 <= lambda  perpendicular to  gap + B' W + A lambda >= 0
xi = C W + weight twist + B lambda
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.readout import fit_platform_error
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contacts
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.statics import ContactOperators
from wrist_stiffness.mechanism.vectors import cross


@dataclass(frozen=True)
class Response:
    """Elastic answer of the wrist."""

    twist: Array  # (..., 6), platform twist at O in F, first order [m, rad]
    force: Array  # (..., m), contact force of each sector [N]
    active: NDArray[np.bool_]  # (..., m), sectors in contact


def respond(operators: ContactOperators, wrench: Array) -> Response:
    """Solve for the platform's twist under a load, with contact.

    `operators`: of shape (...); `wrench` (..., 6): load on the platform at O in F [N, N m].  Gives
    `Response`: twist, contact forces and active sectors of shape (...).
    """
    free = operators.weight_twist + np.einsum("...ij,...j->...i", operators.compliance, wrench)
    gap = operators.gap + np.einsum("...im,...i->...m", operators.force_twist, wrench)
    m, n = gap.shape[-1], math.prod(gap.shape[:-1])
    found = solve_contacts(operators.approach.reshape(n, m, m), gap.reshape(n, m))
    force, active = (each.reshape(gap.shape) for each in found)
    moved = free + np.einsum("...im,...m->...i", operators.force_twist, force)
    return Response(moved, force, active)


RATED_FORCE = np.array([0.0, 0.0, -1.0])
"""Downward in F [N]: the paper's payload of 100 g, pressed on by the other manipulator."""


def rated_wrench(configuration: Configuration, geometry: Geometry) -> Array:
    """Return the rated load at O in F, (..., 6) [N, N m]; it acts at the geometry's load point."""
    point = configuration.platform @ geometry.load_point
    force = np.broadcast_to(RATED_FORCE, point.shape)
    return np.concatenate([force, cross(point, force)], axis=-1)


def rated_map(
    configuration: Configuration, operators: ContactOperators, geometry: Geometry
) -> Array:
    """Return the paper's figures at n poses: the wrist's answer to the rated load.

    `configuration`: n poses; `operators`: there; made without gravity for the paper's load-only
    figures.  Gives (n, 5): s_x, s_y, s_z, |s| [m] and phi [rad], through the readout points.
    """
    twist = respond(operators, rated_wrench(configuration, geometry)).twist
    points = np.einsum("nij,pj->npi", configuration.platform, geometry.platform.readout_points)
    moved = points + twist[:, None, :3] + cross(twist[:, None, 3:], points)
    error = fit_platform_error(points, moved)
    return np.column_stack([error.shift, error.shift_norm, error.phi])
