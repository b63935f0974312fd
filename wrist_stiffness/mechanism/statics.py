"""Elasto-statics of the wrist in closed form: components turned, carried by G and summed.

    C(theta) = sum_k G_k C_k G_k'          xi = C W + sum_k G_k delta_k + B lambda

With rigid interface frames every C_k is constant in its own body, so a pose costs a few small
matrix products instead of a finite-element solve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import (
    CARRIER,
    ELASTIC,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.influence import Influence, influence
from wrist_stiffness.mechanism.kinematics import BODIES, Configuration
from wrist_stiffness.mechanism.vectors import block_diagonal

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

    Parameters
    ----------
    configuration : Configuration
        Of shape (...).
    components : ElasticComponents
        Condensed parts.

    Returns
    -------
    (..., 8, 6, 6) float
        In the order of `ELASTIC`; symmetric positive semi-definite; they add up to C.
    """
    g = influence(configuration).of_components()
    carried = block_diagonal(g @ component_rotations(configuration))
    return carried @ components.flexibility @ np.swapaxes(carried, -1, -2)


def compliance(configuration: Configuration, components: ElasticComponents) -> Array:
    """Platform compliance C(theta) with free slides, (..., 6, 6) [m/N, rad/N, rad/(N m)]."""
    return component_shares(configuration, components).sum(axis=-3)


@dataclass(frozen=True)
class WeightResponse:
    """What the own weight of all parts does at a pose, with free slides.

    Parameters
    ----------
    wrench : (..., 8, 6) float
        Wrench at O in F that bends each component: what its platform side carries, its own
        condensed weight there included [N, N m].
    screw : (..., 8, 6) float
        Elastic screw of each component [m, rad].
    twist : (..., 6) float
        Twist of the platform [m, rad].
    """

    wrench: Array
    screw: Array
    twist: Array


def weight_response(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> WeightResponse:
    """Return the response to the parts' own weight.

    Parameters
    ----------
    configuration : Configuration
        Of shape (...).
    components : ElasticComponents
        Condensed parts with their weights.
    gravity : (3,) float
        Acceleration of gravity in F [m/s^2].

    Returns
    -------
    WeightResponse
        Wrenches through the components, their screws and the platform's twist.
    """
    return _weight_response(
        configuration,
        components,
        gravity,
        influence(configuration),
        turned_flexibilities(configuration, components),
    )


def _weight_response(
    configuration: Configuration,
    components: ElasticComponents,
    gravity: Array,
    projectors: Influence,
    flexibility: Array,
) -> WeightResponse:
    r = component_rotations(configuration)
    field = _to_body(r, gravity)
    motor_side, platform_side = (
        _turned(r, (weights @ field)[..., 0])
        for weights in (components.weight_motor_side, components.weight_platform_side)
    )
    carried = _turned(
        np.swapaxes(projectors.of_components(), -1, -2),
        platform_weight(configuration, components, gravity)[..., None, :],
    )
    wrench = carried + projectors.through_components(motor_side, platform_side)
    screw = (flexibility @ wrench[..., None])[..., 0]
    return WeightResponse(wrench, screw, platform_twist(projectors, screw))


def platform_weight(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> Array:
    """Weight of the platform as a wrench at O in F, (..., 6)."""
    r = configuration.platform
    return _turned(r, (components.platform_weight @ _to_body(r, gravity))[..., 0])


def platform_twist(projectors: Influence, screws: Array) -> Array:
    """Sum G_k delta_k over the elastic components, (..., 6) for `screws` (..., 8, 6) [m, rad]."""
    return _turned(projectors.of_components(), screws).sum(axis=-2)


def slides(projectors: Influence, screws: Array) -> Array:
    """Slides of joint_2 to joint_4 for `screws` (..., 8, 6) at the components, (..., 3) [m]."""
    return np.einsum("...kij,...kj->...i", projectors.slides(), screws[..., :3])


def _to_body(rotation: Array, vector: Array) -> Array:
    """Return a vector (3,) of F in turned bodies, as columns (..., 3, 1)."""
    return np.swapaxes(rotation, -1, -2) @ vector[:, None]


def _turned(matrix: Array, six: Array) -> Array:
    """Apply (..., 3, 3) matrices to both halves of 6-vectors (..., 6)."""
    halves = six.reshape(*six.shape[:-1], 2, 3) @ np.swapaxes(matrix, -1, -2)
    return halves.reshape(*halves.shape[:-2], 6)


@dataclass(frozen=True)
class ContactOperators:
    """What is needed to solve flange contact at a pose for any load and any screw (m sectors).

        0 <= lambda  perpendicular to  gap + B' W + sum_k N_k delta_k + A lambda >= 0
        xi = C W + twist0 + sum_k G_k delta_k + B lambda

    Parameters
    ----------
    compliance : (..., 6, 6) float
        C [m/N, ...].
    force_twist : (..., 6, m) float
        B, the platform's twist for a unit contact force of each sector.
    approach : (..., m, m) float
        A, opening of each gap for unit forces [m/N]; symmetric positive definite.
    gap : (..., m) float
        Gaps under own weight alone [m].
    weight_twist : (..., 6) float
        Platform twist under own weight with free slides [m, rad].
    screw_gap : (..., m, 8, 6) float
        N_k: opening of each gap for a screw at each elastic component.
    """

    compliance: Array
    force_twist: Array
    approach: Array
    gap: Array
    weight_twist: Array
    screw_gap: Array


def contact_operators(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> ContactOperators:
    """Assemble the operators of the contact problem at a pose.

    Parameters
    ----------
    configuration : Configuration
        Of shape (...).
    components : ElasticComponents
        Condensed parts.
    gravity : (3,) float
        Acceleration of gravity in F [m/s^2].

    Returns
    -------
    ContactOperators
        Of the same leading shape; m = 0 sectors if no joint has a flange.
    """
    projectors = influence(configuration)
    g = projectors.of_components()
    r = component_rotations(configuration)
    flexibility = turned_flexibilities(configuration, components)
    weight = _weight_response(configuration, components, gravity, projectors, flexibility)
    sectors = components.sectors
    own, lead, m = sectors.component, configuration.b.shape[:-1], len(sectors.gap)

    # A unit slide force of each passive joint: by virtual work it pulls at the components with the
    # rows that map their translations to the slides.
    rows = projectors.slides()
    bent = flexibility[..., :3] @ np.swapaxes(rows, -1, -2)
    slide_flexibility = (rows @ bent[..., :3, :]).sum(axis=-3)
    slide_twist = (block_diagonal(g) @ bent).sum(axis=-3)

    # What a unit force of each sector does through its own bushing.
    screw = _turned(r.take(own, axis=-3), sectors.screw)
    screw_slide = rows.take(own, axis=-3) @ screw[..., :3, None]
    coupling = sectors.slide @ np.swapaxes(screw_slide[..., 0], -1, -2)
    screw_twist = _turned(g.take(own, axis=-3), screw)

    screw_gap = np.zeros((*lead, m, N_ELASTIC, 6))
    # (m, slide) times (component, slide, xyz), component by component.
    screw_gap[..., :3] = np.swapaxes(sectors.slide @ rows, -3, -2)
    field = _to_body(r, gravity).take(own, axis=-3)
    gap = (
        sectors.gap
        + (sectors.weight_approach[:, None, :] @ field)[..., 0, 0]
        + slides(projectors, weight.screw) @ sectors.slide.T
        + (screw * weight.wrench.take(own, axis=-2)).sum(axis=-1)
    )
    return ContactOperators(
        compliance=component_shares(configuration, components).sum(axis=-3),
        force_twist=slide_twist @ sectors.slide.T + np.swapaxes(screw_twist, -1, -2),
        approach=sectors.approach
        + sectors.slide @ slide_flexibility @ sectors.slide.T
        + coupling
        + np.swapaxes(coupling, -1, -2),
        gap=gap,
        weight_twist=weight.twist,
        screw_gap=screw_gap,
    )
