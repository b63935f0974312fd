"""Solving the whole-wrist model at a pose: load, own weight, misfit, heat, flange contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import nnls
from scipy.sparse.linalg import LinearOperator, eigsh

from whole_wrist.model import SCREWS, PlacedBody, WristAtPose, platform_weight
from wrist_stiffness.fem.elasticity import rigid_motion
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.modes import RigidBody
from wrist_stiffness.mechanism.vectors import block_diagonal


@dataclass(frozen=True)
class Disturbance:
    """What acts on the wrist besides the platform's load.

    Parameters
    ----------
    gravity : (3,) float
        Acceleration field in F [m/s^2].
    screws : mapping of str to (6,) float
        Displacement of a component's motor-side wall against its frame, at O in F [m, rad].
    warming : mapping of str to float
        Uniform temperature rise of a link together with the pins in its bores [K].
    """

    gravity: Array = field(default_factory=lambda: np.zeros(3))
    screws: Mapping[str, Array] = field(default_factory=dict)
    warming: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PoseSolution:
    """Solved displacements and contact.

    Parameters
    ----------
    twist : (6,) float
        Of the platform at O in F [m, rad].
    forces : (m,) float
        Contact force of each flange sector [N].
    openings : (m,) float
        Gap of each sector [m].
    displacements : list of (3 n,) float
        Of each part's nodes in F [m].
    screws : (SCREWS,) float
        Of the rigid frames, then slide and turn of each passive joint.
    """

    twist: Array
    forces: Array
    openings: Array
    displacements: list[Array]
    screws: Array


def solve_pose(
    model: WristAtPose, wrench: Array, disturbance: Disturbance | None = None
) -> PoseSolution:
    """Solve a pose for a platform load, with one-sided frictionless flange contact.

    Parameters
    ----------
    model : WristAtPose
        The factored pose.
    wrench : (6,) float
        On the platform at O in F [N, N m].
    disturbance : Disturbance, optional
        What else acts.

    Returns
    -------
    PoseSolution
        Displacements and contact forces.
    """
    disturbance = disturbance or Disturbance()
    imposed = [_imposed(model, part, disturbance) for part in model.placed]
    load = np.zeros(model.openings.shape[1])
    load[model.platform_columns] += wrench + platform_weight(model, disturbance.gravity)
    for part, follow, displacement in zip(model.placed, model.follow, imposed, strict=True):
        nodal = _nodal_loads(part, disturbance) - part.stiffness @ displacement
        load += follow.T @ nodal
    free = model.factor.solve(load)
    forces = _contact_forces(model, model.gaps + model.openings @ free)
    unknowns = free + model.by_force @ forces if np.any(forces) else free
    return PoseSolution(
        twist=unknowns[model.platform_columns],
        forces=forces,
        openings=model.gaps + model.openings @ unknowns,
        displacements=[
            t @ unknowns + displacement
            for t, displacement in zip(model.follow, imposed, strict=True)
        ],
        screws=unknowns[-SCREWS:],
    )


def natural_frequencies(
    model: WristAtPose,
    bodies: tuple[RigidBody, ...],
    closed: NDArray[np.bool_],
    count: int = 6,
) -> Array:
    """Solve for the slowest natural modes of a pose, every node with its mass, motors locked.

    Parameters
    ----------
    model : WristAtPose
        The factored pose.
    bodies : tuple of RigidBody
        What moves with the platform: its plate, and a payload.
    closed : (m,) bool
        Flange sectors that stay in touch.
    count : int
        Modes.

    Returns
    -------
    (count,) float
        Frequencies, the slowest first [Hz].
    """
    size = model.openings.shape[1]
    mass = sum(
        follow.T @ sparse.kron(part.body.mass, sparse.eye(3)) @ follow
        for part, follow in zip(model.placed, model.follow, strict=True)
    )
    turn = block_diagonal(model.configuration.platform)
    platform = turn @ sum(body.at_centre for body in bodies) @ turn.T
    place = np.arange(size)[model.platform_columns]
    rows, columns = np.repeat(place, 6), np.tile(place, 6)
    mass = sparse.csr_matrix(mass) + sparse.csr_matrix(
        (platform.ravel(), (rows, columns)), shape=(size, size)
    )
    touching, pushed = model.openings[closed], model.by_force[:, closed]
    approach = touching @ pushed

    def flexibility(load: Array) -> Array:
        free = model.factor.solve(load)
        return free - pushed @ np.linalg.solve(approach, touching @ free) if any(closed) else free

    operator = LinearOperator((size, size), matvec=flexibility, dtype=float)
    # About zero only the flexibility is asked for, never the stiffness.
    square = eigsh(mass, k=count, M=mass, sigma=0.0, OPinv=operator, return_eigenvectors=False)
    return np.sqrt(np.sort(square)) / (2.0 * np.pi)


def _contact_forces(model: WristAtPose, gaps: Array) -> Array:
    """Complementarity as non-negative least squares: min f'A f / 2 + gap'f over f >= 0."""
    if np.all(gaps >= 0.0):
        return np.zeros(len(gaps))
    root = np.linalg.cholesky(model.openings @ model.by_force)
    return np.asarray(nnls(root.T, -np.linalg.solve(root, gaps))[0])


def _imposed(model: WristAtPose, part: PlacedBody, disturbance: Disturbance) -> Array:
    """Return the displacements of walls that do not come from the unknowns (3 n,)."""
    displacement = np.zeros(part.stiffness.shape[0])
    if part.name in disturbance.screws:
        motion = part.axes.T @ (rigid_motion(part.nodes) @ disturbance.screws[part.name])
        held = np.zeros_like(displacement)
        held[part.motor_wall] = motion[part.motor_wall]
        displacement += part.axes @ held
    if part.name in disturbance.warming:
        link = model.wrist.geometry.links[part.name]
        strain = link.material.expansion * disturbance.warming[part.name]
        rotation = model.configuration.rotations[part.name]
        ends = model.wrist.geometry.link_ends(part.name)
        for wall, end in zip((part.motor_wall, part.platform_wall), ends, strict=True):
            # A pin grows about the point where its axis crosses the bar's centre line.
            centre = link.arc_radius * rotation @ end
            on_wall = part.nodes.ravel()[wall].reshape(-1, 3)
            displacement[wall] += (strain * (on_wall - centre)).ravel()
    return displacement


def _nodal_loads(part: PlacedBody, disturbance: Disturbance) -> Array:
    in_part = part.turn[:3, :3].T @ disturbance.gravity
    load = part.body.weight @ in_part
    if part.name in disturbance.warming:
        # A free growth about any point is what its nodal forces leave.
        strain = disturbance.warming[part.name] * part.body.solid.material.expansion
        load = load + part.body.stiffness @ (strain * part.body.mesh.nodes.ravel())
    return np.asarray(part.turn @ load)
