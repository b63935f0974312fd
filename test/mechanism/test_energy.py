"""Energy balance: what the load does is stored in the components, flanges included."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.lookup.response import respond
from wrist_stiffness.mechanism.energy import component_screws, component_wrenches, strain_energies
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import (
    component_shares,
    contact_operators,
    platform_twist,
    slides,
    turned_flexibilities,
)


@pytest.fixture(scope="module")
def case(table):
    rng = np.random.default_rng(7)
    configuration = table.mechanism.forward(np.radians(rng.uniform(-40.0, 40.0, (60, 2))))
    wrench = rng.normal(size=(60, 6)) * [1.0, 1.0, 1.0, 0.02, 0.02, 0.02]
    return configuration, wrench


def test_energy_of_touching_flanges_adds_up_to_the_work(table, case):
    configuration, wrench = case
    operators = contact_operators(configuration, table.components, np.zeros(3))
    operators = replace(operators, gap=np.zeros_like(operators.gap))
    response = respond(operators, wrench)
    assert np.any(response.force > 0.0)
    energy = strain_energies(configuration, table.components, wrench, response.force)
    work = 0.5 * np.einsum("ni,ni->n", wrench, response.twist)
    assert np.allclose(energy.sum(axis=1), work, rtol=1e-9)
    assert np.all(energy >= 0.0)


def test_without_contact_the_energies_are_the_compliance_shares(table, case):
    configuration, wrench = case
    force = np.zeros((len(wrench), len(table.components.sectors.gap)))
    energy = strain_energies(configuration, table.components, wrench, force)
    shares = component_shares(configuration, table.components)
    assert np.allclose(energy, 0.5 * np.einsum("ni,nkij,nj->nk", wrench, shares, wrench), rtol=1e-9)


def test_platform_twist_by_castigliano(table, case):
    """The wrench through each component is the derivative that virtual work asks for."""
    configuration, wrench = case
    operators = contact_operators(configuration, table.components, np.zeros(3))
    force = np.abs(
        np.random.default_rng(1).normal(size=(len(wrench), len(table.components.sectors.gap)))
    )
    through = component_wrenches(influence(configuration), table.components, wrench, force)
    flexibility = turned_flexibilities(configuration, table.components)
    step = 1e-3
    probe = np.random.default_rng(2).normal(size=wrench.shape)
    up, down = (
        strain_energies(configuration, table.components, wrench + sign * step * probe, force).sum(1)
        for sign in (1.0, -1.0)
    )
    twist = np.einsum("nij,nj->ni", operators.compliance, wrench) + np.einsum(
        "nim,nm->ni", operators.force_twist, force
    )
    assert np.allclose((up - down) / (2.0 * step), np.einsum("ni,ni->n", twist, probe), rtol=1e-7)
    assert through.shape == flexibility.shape[:-1]


def test_screws_carried_by_influence_are_the_platform_twist(table, case):
    """sum G_k delta_k = C W + B lambda, and the slides are those that closed the gaps."""
    configuration, wrench = case
    operators = contact_operators(configuration, table.components, np.zeros(3))
    response = respond(operators, wrench)
    screws = component_screws(configuration, table.components, wrench, response.force)
    projectors = influence(configuration)
    twist = platform_twist(projectors, screws)
    assert np.allclose(twist, response.twist, rtol=1e-9, atol=1e-9 * np.abs(response.twist).max())
    opening = operators.gap + np.einsum("nim,ni->nm", operators.force_twist, wrench)
    opening += np.einsum("nij,nj->ni", operators.approach, response.force)
    sectors = table.components.sectors
    local = slides(projectors, screws) @ sectors.slide.T
    assert np.all(opening[response.active] < 1e-12)
    assert local.shape == opening.shape
