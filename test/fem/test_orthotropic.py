"""Orthotropic parts: fields whose energy is known by hand, exact sleeves, the isotropic limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.fem.elasticity import mass_matrix, stiffness_matrix
from wrist_stiffness.fem.parts import assemble_body
from wrist_stiffness.fem.superelement import condense
from wrist_stiffness.mechanism.material import OrthotropicMaterial

LAYERS = OrthotropicMaterial(
    young=(2.0e9, 9.0e9, 3.5e9),
    poisson=(0.1, 0.2, 0.4),
    shear=(0.9e9, 0.6e9, 1.7e9),
    density=1400.0,
    expansion=3e-5,
)


@pytest.mark.parametrize("part", ["link_body", "plain_sleeve"])
def test_isotropic_values_given_as_orthotropic_are_that_material(part, request):
    body = request.getfixturevalue(part)
    same = body.solid.material
    three = OrthotropicMaterial(
        young=(same.young,) * 3,
        poisson=(same.poisson,) * 3,
        shear=(same.young / (2.0 * (1.0 + same.poisson)),) * 3,
        density=same.density,
        expansion=same.expansion,
    )
    difference = stiffness_matrix(body.mesh, three) - body.stiffness
    assert abs(difference).max() < 1e-13 * abs(body.stiffness).max()


def fields(x, y, z):
    """Displacements (3, n), and their strains 11, 22, 33, 23, 13, 12 (6, n) in turning axes."""
    zero, one, r, angle = np.zeros_like(x), np.ones_like(x), np.hypot(x, y), np.arctan2(y, x)
    stretch, shear = np.cos(2.0 * angle), -2.0 * np.sin(2.0 * angle)
    return {
        "evenly across": ((x, y, zero), (one, one, zero, zero, zero, zero)),
        "more and more across": ((x * r, y * r, zero), (2 * r, r, zero, zero, zero, zero)),
        "along": ((zero, zero, z), (zero, zero, one, zero, zero, zero)),
        "all ways": ((x, y, z), (one, one, one, zero, zero, zero)),
        "along, across more": ((x * r, y * r, z), (2 * r, r, one, zero, zero, zero)),
        "oval": ((x, -y, zero), (stretch, -stretch, zero, zero, zero, shear)),
        "sheared along": ((zero, zero, x), (zero, zero, zero, -y / r, x / r, zero)),
        "twisted": ((-y * z, x * z, zero), (zero, zero, zero, r, zero, zero)),
    }


@pytest.mark.parametrize("name", fields(*np.ones((3, 1))))
def test_a_stretched_sleeve_has_the_energy_of_its_strains(plain_sleeve, name):
    mesh = plain_sleeve.mesh
    moved, strain = map(np.array, fields(*mesh.nodes.T)[name])
    density = np.einsum("in,ij,jn->n", strain, np.linalg.inv(LAYERS.compliance), strain)
    expected = (mass_matrix(mesh, 1.0) @ density).sum()
    work = moved.T.ravel() @ (stiffness_matrix(mesh, LAYERS) @ moved.T.ravel())
    # What quadratic elements leave of fields that are no quadratics.
    assert work == pytest.approx(expected, rel=1e-3)


def test_a_bonded_sleeve_of_layers_in_torsion_is_exact(plain_sleeve, coarse):
    """As of an isotropic one: u = A r + B / r around the axis leaves the ends free of stress."""
    dimensions = replace(plain_sleeve.solid.dimensions, material=LAYERS)
    inner = dimensions.pin_diameter / 2.0
    outer = inner + dimensions.wall
    sizes = replace(coarse, bushing=0.5e-3, bushing_arc=1.4e-3)
    body = assemble_body(replace(plain_sleeve.solid, dimensions=dimensions), sizes)
    exact = (1 / inner**2 - 1 / outer**2) / (4 * math.pi * LAYERS.shear[0] * dimensions.length)
    assert condense(body, "rigid").flexibility[5, 5] == pytest.approx(exact, rel=2e-4)
