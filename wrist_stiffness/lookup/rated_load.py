"""The paper's experiment: the rated load on the platform, read out at points, Eqs. (1)-(10)."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.lookup.readout import fit_platform_error
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.statics import ContactOperators
from wrist_stiffness.mechanism.vectors import cross

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
