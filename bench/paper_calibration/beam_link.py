"""Flexibility of a link as a curved Timoshenko beam between two rigid bores.

Against the solid link the diagonal terms agree within 4 % for the sizes searched here; the
calibration is finished with solids.
"""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import LinkDimensions

RIGID_END = 0.35
"""Part of a bore's diameter that stiffens the bar past the bore's centre, fitted to four solids."""

SHEAR_FACTOR = 5.0 / 6.0

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(16)


def torsion_constant(side_a: float, side_b: float) -> float:
    """Saint-Venant torsion constant of a rectangle [m^4] (Roark's approximation)."""
    long, short = max(side_a, side_b), min(side_a, side_b)
    ratio = short / long
    return long * short**3 * (1.0 / 3.0 - 0.21 * ratio * (1.0 - ratio**4 / 12.0))


def link_flexibility(link: LinkDimensions, angle: float) -> Array:
    """Flexibility of the platform-side bore against the motor-side bore.

    Parameters
    ----------
    link : LinkDimensions
        The link.
    angle : float
        Between its bores [rad].

    Returns
    -------
    (6, 6) float
        At O in the link's own axes (motor-side bore on +x, arc towards +y) [m/N, rad/N, rad/(N m)].
    """
    young = link.material.young
    shear = young / (2.0 * (1.0 + link.material.poisson))
    radial, axial, radius = link.section_radial, link.section_axial, link.arc_radius
    area = radial * axial
    per_length = np.array(
        [
            1.0 / (SHEAR_FACTOR * shear * area),
            1.0 / (young * area),
            1.0 / (SHEAR_FACTOR * shear * area),
            1.0 / (young * radial * axial**3 / 12.0),
            1.0 / (shear * torsion_constant(radial, axial)),
            1.0 / (young * axial * radial**3 / 12.0),
        ]
    )
    start = RIGID_END * link.motor_bore / radius
    end = angle - RIGID_END * link.platform_bore / radius
    half = (end - start) / 2.0
    place = (start + end) / 2.0 + half * POINTS
    cosine, sine, zero = np.cos(place), np.sin(place), np.zeros_like(place)
    radially = np.stack([cosine, sine, zero], axis=-1)
    along = np.stack([-sine, cosine, zero], axis=-1)
    normal = np.stack([zero, zero, zero + 1.0], axis=-1)
    axes = np.stack([radially, along, normal], axis=1)
    # A wrench at O as force and moment in the section's axes.
    section = np.zeros((len(place), 6, 6))
    section[:, :3, :3] = section[:, 3:, 3:] = axes
    section[:, 3:, :3] = -np.cross(axes, radius * radially[:, None, :])
    return np.einsum(
        "nij,i,nik,n->jk", section, per_length, section, WEIGHTS * half * radius, optimize=True
    )
