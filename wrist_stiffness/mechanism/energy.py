"""Whose share is it?  The strain energy of each component, with flanges in contact."""

from __future__ import annotations

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array, ElasticComponents
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.influence import IN_LIMB_1, Influence, influence
from wrist_stiffness.mechanism.statics import (
    component_rotations,
    turned_flexibilities,
)
from wrist_stiffness.mechanism.vectors import both_halves


def component_wrenches(
    projectors: Influence, components: ElasticComponents, wrench: Array, force: Array
) -> Array:
    """Return the wrench through each component under a platform load and contact forces.

    `projectors`: of configurations of shape (...); `wrench` (..., 6): on the platform at O in F [N,
    N m]; `force` (..., m): contact force of each sector [N], as the contact solution gives it.
    Gives (..., 8, 6): G_k' W + N_k' lambda at O in F [N, N m]; own weight is not in it.
    """
    halves = np.reshape(wrench, (*np.shape(wrench)[:-1], 1, 2, 3)) @ projectors.of_components()
    # Net push of the hubs along the joint axes, by virtual work on the slides.
    push = (force @ components.sectors.slide)[..., None, None, :]
    halves[..., :1, :] += push @ projectors.slides()
    return np.asarray(halves.reshape(*halves.shape[:-2], 6))


def component_wrench(
    projectors: Influence, components: ElasticComponents, k: int, wrench: Array, force: Array
) -> Array:
    """Return the same through component k of `ELASTIC` alone, (..., 6)."""
    first = IN_LIMB_1[k]
    carried = both_halves(
        np.swapaxes(projectors.limb_1 if first else projectors.limb_2, -1, -2), wrench
    )
    push = (force @ components.sectors.slide)[..., None, :] @ projectors.slides_limb_1
    carried[..., :3] += push[..., 0, :] if first else -push[..., 0, :]
    return carried


def component_screws(
    configuration: Configuration, components: ElasticComponents, wrench: Array, force: Array
) -> Array:
    """Return the elastic screw of each component under a platform load and contact forces.

    `configuration`: of shape (...); `wrench` (..., 6): on the platform at O in F [N, N m]; `force`
    (..., m): contact force of each sector [N].  Gives (..., 8, 6): C_k W_k, plus what pressed
    flanges add to their bushing; at O in F [m, rad].
    """
    through = component_wrenches(influence(configuration), components, wrench, force)
    flexibility = turned_flexibilities(configuration, components)
    bent = (flexibility @ through[..., None])[..., 0]
    return bent + flange_screws(configuration, components, force)


def flange_screws(
    configuration: Configuration, components: ElasticComponents, force: Array
) -> Array:
    """Return what pressed flanges (..., m) [N] add to the screws of their bushings, (..., 8, 6)."""
    home = _pressed(force[..., None] * components.sectors.screw, components)
    return both_halves(component_rotations(configuration), home)


def strain_energies(
    configuration: Configuration, components: ElasticComponents, wrench: Array, force: Array
) -> Array:
    """Return the strain energy of each component; a bushing's flanges belong to it.

    Where every touching sector had no gap, the energies add up to half the load's work: shares are
    then an error budget.

    `configuration`: of shape (...); `wrench` (..., 6): on the platform at O in F [N, N m]; `force`
    (..., m): contact force of each sector [N].  Gives (..., 8): in the order of `ELASTIC` [J].
    """
    through = component_wrenches(influence(configuration), components, wrench, force)
    flexibility = turned_flexibilities(configuration, components)
    energy: Array = 0.5 * np.einsum("...ki,...kij,...kj->...k", through, flexibility, through)
    sectors = components.sectors
    home = force[..., None] * sectors.screw
    bent = both_halves(component_rotations(configuration).take(sectors.component, axis=-3), home)
    own = np.einsum("...mi,...mi->...m", through.take(sectors.component, axis=-2), bent)
    own += 0.5 * force * (force @ sectors.approach)
    return energy + _pressed(own[..., None], components)[..., 0]


def _pressed(by_sector: Array, components: ElasticComponents) -> Array:
    """Sum over the sectors (..., m, d) of each component, (..., 8, d)."""
    belongs = (components.sectors.component == np.arange(len(ELASTIC))[:, None]).astype(float)
    summed: Array = belongs @ by_sector
    return summed
