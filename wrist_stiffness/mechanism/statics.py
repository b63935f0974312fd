"""Elasto-statics of the wrist in closed form: components turned, carried by G and summed.

    C(theta) = sum_k G_k C_k G_k'          xi = C W + sum_k G_k delta_k + B lambda

With rigid interface frames every C_k is constant in its own body, so a pose costs a few small
matrix products instead of a finite-element solve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import (
    CARRIER,
    ELASTIC,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.configuration import BODIES, Configuration
from wrist_stiffness.mechanism.influence import Influence, influence
from wrist_stiffness.mechanism.vectors import below, beside, block_diagonal, both_halves

N_ELASTIC = len(ELASTIC)

_CARRIER_NUMBER = np.array([BODIES.index(CARRIER[name]) for name in ELASTIC])


def component_rotations(configuration: Configuration) -> Array:
    """Rotation from home of the body that carries each elastic component, (..., 8, 3, 3)."""
    return configuration.bodies.take(_CARRIER_NUMBER, axis=-3)


def turned_flexibilities(configuration: Configuration, components: ElasticComponents) -> Array:
    """Flexibility of each component at O in F at the pose, (..., 8, 6, 6)."""
    r = block_diagonal(component_rotations(configuration))
    return r @ components.flexibility @ np.swapaxes(r, -1, -2)


def component_shares(configuration: Configuration, components: ElasticComponents) -> Array:
    """Share G_k C_k G_k' of each component in the platform's compliance.

    `configuration`: of shape (...).  Gives (..., 8, 6, 6): in the order of `ELASTIC`; symmetric
    positive semi-definite; they add up to C [m/N, rad/N, rad/(N m)].
    """
    g = influence(configuration).of_components()
    carried = block_diagonal(g @ component_rotations(configuration))
    return carried @ components.flexibility @ np.swapaxes(carried, -1, -2)


def weight_wrench(
    configuration: Configuration,
    components: ElasticComponents,
    gravity: Array,
    projectors: Influence,
) -> Array:
    """Return the wrench of own weight that bends each elastic component, with free slides.

    `configuration`: of shape (...); `gravity` (3,): acceleration of gravity in F [m/s^2].  Gives
    (..., 8, 6): what its platform side carries, its own condensed weight there included, at O in F
    [N, N m].
    """
    r = component_rotations(configuration)
    field = _to_body(r, gravity)
    motor_side, platform_side = (
        both_halves(r, (weights @ field)[..., 0])
        for weights in (components.weight_motor_side, components.weight_platform_side)
    )
    carried = both_halves(
        np.swapaxes(projectors.of_components(), -1, -2),
        platform_weight(configuration, components, gravity)[..., None, :],
    )
    return np.asarray(carried + projectors.through_components(motor_side, platform_side))


def platform_weight(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> Array:
    """Weight of the platform as a wrench at O in F, (..., 6)."""
    r = configuration.platform
    return both_halves(r, (components.platform_weight @ _to_body(r, gravity))[..., 0])


def platform_twist(projectors: Influence, screws: Array) -> Array:
    """Sum G_k delta_k over the elastic components, (..., 6) for `screws` (..., 8, 6) [m, rad]."""
    return both_halves(projectors.of_components(), screws).sum(axis=-2)


def slides(projectors: Influence, screws: Array) -> Array:
    """Slides of joint_2 to joint_4 for `screws` (..., 8, 6) at the components, (..., 3) [m]."""
    return projectors.slid(screws[..., :3])


def _to_body(rotation: Array, vector: Array) -> Array:
    """Return a vector (3,) of F in turned bodies, as columns (..., 3, 1)."""
    return np.swapaxes(rotation, -1, -2) @ vector[:, None]


@dataclass(frozen=True)
class ContactOperators:
    """What is needed to solve flange contact at a pose for any load and any screw (m sectors).

    0 <= lambda  perpendicular to  gap + B' W + sum_k N_k delta_k + A lambda >= 0
    xi = C W + twist0 + sum_k G_k delta_k + B lambda
    """

    compliance: Array  # (..., 6, 6), C [m/N, ...]
    # (..., 6, m), B, the platform's twist for a unit contact force of each sector
    force_twist: Array
    # (..., m, m), A, opening of each gap for unit forces [m/N]; symmetric positive definite
    approach: Array
    gap: Array  # (..., m), gaps under own weight alone [m]
    weight_twist: Array  # (..., 6), platform twist under own weight with free slides [m, rad]
    slide: Array  # (m, 3), opening of each gap for a unit slide of joint_2, joint_3 and joint_4
    slides: Array  # (..., 8, 3, 3), slides (rows) by a translation of each elastic component

    @cached_property
    def screw_gap(self) -> Array:
        """N_k: opening of each gap for a screw at each elastic component, (..., m, 8, 6)."""
        out = np.zeros((*self.gap.shape, N_ELASTIC, 6))
        # (m, slide) times (component, slide, xyz), component by component.
        out[..., :3] = np.swapaxes(self.slide @ self.slides, -3, -2)
        return out


def contact_operators(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> ContactOperators:
    """Assemble the operators of the contact problem at a pose.

    `configuration`: of shape (...); `gravity` (3,): acceleration of gravity in F [m/s^2].  Gives
    `ContactOperators`: of the same leading shape; m = 0 sectors if no joint has a flange.
    """
    projectors = influence(configuration)
    return assembled_operators(
        configuration,
        projectors,
        components,
        turned_flexibilities(configuration, components),
        gravity,
        weight_wrench(configuration, components, gravity, projectors),
    )


def assembled_operators(
    configuration: Configuration,
    projectors: Influence,
    components: ElasticComponents,
    flexibility: Array,
    gravity: Array,
    wrench: Array,
) -> ContactOperators:
    """Do the same where what it rests on is known.

    `configuration`: of shape (...); `flexibility` (..., 8, 6, 6): of the components at O in F at
    the pose [m/N, rad/N, rad/(N m)]; `gravity` (3,): acceleration of gravity in F [m/s^2]; `wrench`
    (..., 8, 6): of own weight through the components [N, N m].
    """
    sums = _summed(configuration, projectors, components, flexibility, gravity, wrench)
    return ContactOperators(**sums, slide=components.sectors.slide, slides=projectors.slides())


def changed_operators(
    operators: ContactOperators,
    configuration: Configuration,
    before: ElasticComponents,
    after: ElasticComponents,
    gravity: Array,
    wrench: Array,
) -> ContactOperators:
    """Return the operators after a change of some parts' flexibility, flanges included.

    They are sums over the parts, so only what changes is computed.

    `configuration`: of shape (...); `before`, `after`: parts with the same weights and the same
    flange sectors; `gravity` (3,): acceleration of gravity in F [m/s^2]; `wrench` (..., 8, 6): of
    own weight through the components [N, N m].
    """
    contact = {
        joint: replace(
            flange,
            screw=flange.screw - before.contact[joint].screw,
            approach=flange.approach - before.contact[joint].approach,
            weight_approach=flange.weight_approach - before.contact[joint].weight_approach,
            gap=flange.gap - before.contact[joint].gap,
        )
        for joint, flange in after.contact.items()
    }
    flexibility = after.flexibility - before.flexibility
    change = replace(after, flexibility=flexibility, contact=contact)
    sectors = change.sectors
    moved = np.asarray(flexibility.any(axis=(1, 2)))
    moved[sectors.component[sectors.screw.any(1) | sectors.weight_approach.any(1)]] = True
    which = np.flatnonzero(moved)
    turn = block_diagonal(component_rotations(configuration).take(which, axis=-3))
    turned = turn @ flexibility[which] @ np.swapaxes(turn, -1, -2)
    projectors = influence(configuration)
    sums = _summed(configuration, projectors, change, turned, gravity, wrench, which)
    added = {name: getattr(operators, name) + value for name, value in sums.items()}
    return replace(operators, **added)


def _summed(
    configuration: Configuration,
    projectors: Influence,
    components: ElasticComponents,
    flexibility: Array,
    gravity: Array,
    wrench: Array,
    which: NDArray[np.intp] | None = None,
) -> dict[str, Array]:
    """Return what of `ContactOperators` is a sum over the components, by its name.

    Or over some of them by their numbers: then all others count as rigid.  The flexibility
    (..., c, 6, 6) is of these, turned to the pose.
    """
    sectors = components.sectors
    part: slice | NDArray[np.intp] = slice(None)
    mine: slice | NDArray[np.intp] = slice(None)
    own = sectors.component
    if which is not None:
        part, mine = which, np.flatnonzero(np.isin(own, which))
        own = np.searchsorted(which, own[mine])
    g, rows = projectors.of_components()[..., part, :, :], projectors.slides()[..., part, :, :]
    r = component_rotations(configuration)[..., part, :, :]
    through = wrench[..., part, :]
    sagged = flexibility @ through[..., None]
    # Sums over the components by one product each: side by side, then below each other.
    carry, slid = beside(block_diagonal(g)), beside(rows)

    # A unit slide force of each passive joint: by virtual work it pulls at the components with the
    # rows that map their translations to the slides.
    bent = flexibility[..., :3] @ np.swapaxes(rows, -1, -2)
    slide_flexibility = slid @ below(bent[..., :3, :])
    slide_twist = carry @ below(bent)

    # What a unit force of each sector does through its own bushing.
    screw, screw_slide, screw_twist = (np.empty((*r.shape[:-3], len(own), k)) for k in (6, 3, 6))
    for component in np.unique(own):
        alike = own == component
        # Half-vectors below each other: one product for all sectors.
        back, carried, moved = (np.swapaxes(m[..., component, :, :], -1, -2) for m in (r, g, rows))
        turned = sectors.screw[mine][alike].reshape(-1, 3) @ back
        screw[..., alike, :] = turned.reshape(*turned.shape[:-2], -1, 6)
        screw_slide[..., alike, :] = turned[..., ::2, :] @ moved
        screw_twist[..., alike, :] = (turned @ carried).reshape(*turned.shape[:-2], -1, 6)
    # Half of a symmetric sum.
    half = 0.5 * slide_flexibility @ sectors.slide.T
    half[..., mine] += np.swapaxes(screw_slide, -1, -2)
    approach = sectors.slide @ half
    approach = approach + np.swapaxes(approach, -1, -2)
    approach += sectors.approach
    force_twist = slide_twist @ sectors.slide.T
    force_twist[..., mine] += np.swapaxes(screw_twist, -1, -2)

    gap = sectors.gap + (slid @ below(sagged[..., :3, :]))[..., 0] @ sectors.slide.T
    field = _to_body(r, gravity).take(own, axis=-3)
    gap[..., mine] += (sectors.weight_approach[mine, None, :] @ field)[..., 0, 0]
    gap[..., mine] += (screw * through.take(own, axis=-2)).sum(axis=-1)
    return {
        "compliance": carry @ below(flexibility @ np.swapaxes(block_diagonal(g), -1, -2)),
        "force_twist": force_twist,
        "approach": approach,
        "gap": gap,
        "weight_twist": (carry @ below(sagged))[..., 0],
    }
