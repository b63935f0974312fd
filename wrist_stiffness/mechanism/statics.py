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
    PASSIVE_JOINTS,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.influence import Influence, influence
from wrist_stiffness.mechanism.kinematics import Configuration
from wrist_stiffness.mechanism.vectors import block_diagonal

N_ELASTIC = len(ELASTIC)


def component_rotations(configuration: Configuration) -> Array:
    """Rotation from home of the body that carries each elastic component, (..., 8, 3, 3)."""
    shape = configuration.b.shape[:-1]
    out = np.empty((*shape, N_ELASTIC, 3, 3))
    for i, name in enumerate(ELASTIC):
        carrier = CARRIER[name]
        out[..., i, :, :] = np.eye(3) if carrier == "frame" else configuration.rotations[carrier]
    return out


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
    projectors = influence(configuration)
    r = component_rotations(configuration)
    field = np.swapaxes(r, -1, -2) @ gravity
    motor_frames, platform_frames = projectors.of_frames()
    wrench = _carried(
        projectors.of_components(),
        platform_weight(configuration, components, gravity)[..., None, :],
    )
    for weights, frames in (
        (components.weight_motor_side, motor_frames),
        (components.weight_platform_side, platform_frames),
    ):
        local = np.einsum("kij,...kj->...ki", weights, field)
        turned = np.einsum("...kij,...khj->...khi", r, local.reshape(*local.shape[:-1], 2, 3))
        # Row m of `frames` moves frame m; its transpose carries the frame's wrench to component k.
        through = np.einsum("...mkji,...mhj->...khi", frames, turned)
        wrench = wrench + through.reshape(*through.shape[:-2], 6)
    screw = np.einsum(
        "...kij,...kj->...ki", turned_flexibilities(configuration, components), wrench
    )
    return WeightResponse(wrench, screw, platform_twist(projectors, screw))


def platform_weight(
    configuration: Configuration, components: ElasticComponents, gravity: Array
) -> Array:
    """Weight of the platform as a wrench at O in F, (..., 6)."""
    r = configuration.platform
    local = np.einsum("ij,...j->...i", components.platform_weight, np.swapaxes(r, -1, -2) @ gravity)
    halves = np.einsum("...ij,...hj->...hi", r, local.reshape(*local.shape[:-1], 2, 3))
    return halves.reshape(*halves.shape[:-2], 6)


def platform_twist(projectors: Influence, screws: Array) -> Array:
    """Sum G_k delta_k over the elastic components, (..., 6) for `screws` (..., 8, 6) [m, rad]."""
    halves = screws.reshape(*screws.shape[:-1], 2, 3)
    twist = np.einsum("...kij,...khj->...hi", projectors.of_components(), halves)
    return twist.reshape(*twist.shape[:-2], 6)


def slides(projectors: Influence, screws: Array) -> Array:
    """Slides of joint_2, joint_3, joint_4 for screws (..., 8, 6) at the components, (..., 3) [m]."""
    return np.einsum("...kij,...kj->...i", projectors.slides(), screws[..., :3])


def _carried(g: Array, wrench: Array) -> Array:
    """Wrench G_k' W through each component, (..., 8, 6)."""
    wrench = np.broadcast_to(wrench, (*wrench.shape[:-2], N_ELASTIC, 6))
    halves = np.einsum("...kji,...khj->...khi", g, wrench.reshape(*wrench.shape[:-1], 2, 3))
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


def contact_joints(components: ElasticComponents) -> list[str]:
    """Return the passive joints with flanges, in the order in which their sectors are stacked."""
    return [joint for joint in PASSIVE_JOINTS if joint in components.contact]


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
    weight = weight_response(configuration, components, gravity)
    joints = contact_joints(components)
    parts = [components.contact[joint] for joint in joints]
    sizes = [len(part.gap) for part in parts]
    m = sum(sizes)
    lead = configuration.b.shape[:-1]

    screw_gap = np.zeros((*lead, m, N_ELASTIC, 6))
    local = np.zeros((*lead, N_ELASTIC, 6, m))
    approach = np.zeros((*lead, m, m))
    gap = np.zeros((*lead, m))
    start = 0
    for joint, part, size in zip(joints, parts, sizes, strict=True):
        rows = slice(start, start + size)
        k, slide = ELASTIC.index(joint), PASSIVE_JOINTS.index(joint)
        screw_gap[..., rows, :, :3] = (
            part.sign[:, None, None] * projectors.slides()[..., None, :, slide, :]
        )
        local[..., k, :, rows] = block_diagonal(r[..., k, :, :]) @ part.screw
        approach[..., rows, rows] = part.approach
        field = np.swapaxes(r[..., k, :, :], -1, -2) @ gravity
        gap[..., rows] = part.gap + np.einsum("ij,...j->...i", part.weight_approach, field)
        start += size

    # Wrench of the contact forces through each component, by virtual work on the slides.
    through = np.moveaxis(screw_gap, -3, -1)
    screw = flexibility @ through + local
    force_twist = np.einsum(
        "...kij,...khjm->...him", g, screw.reshape(*screw.shape[:-2], 2, 3, m)
    ).reshape(*lead, 6, m)
    coupling = np.einsum("...mki,...kin->...mn", screw_gap, local)
    approach = (
        approach
        + np.einsum("...kim,...kij,...kjn->...mn", through, flexibility, through, optimize=True)
        + coupling
        + np.swapaxes(coupling, -1, -2)
    )
    gap = (
        gap
        + np.einsum("...mki,...ki->...m", screw_gap, weight.screw)
        + np.einsum("...kim,...ki->...m", local, weight.wrench)
    )
    return ContactOperators(
        compliance=component_shares(configuration, components).sum(axis=-3),
        force_twist=force_twist,
        approach=approach,
        gap=gap,
        weight_twist=weight.twist,
        screw_gap=screw_gap,
    )
