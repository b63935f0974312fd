"""Static condensation of one solid onto the frames at its two walls.

A frame is a rigid body that holds a wall.  `rigid`: every node of the wall follows it.
`distributing`: it is the wall's mean rigid motion (least squares over the surface), the wall may
deform, and a wrench on the frame is spread over the surface accordingly.  `sliding`: of a bushing's
wall that turns on a pin or in a bore, every node follows the frame along the wall's normal and is
free along the wall: pressure without friction, of either sign, as where the fit has no clearance.
All other walls are then rigid.  A sliding wall passes no force along and no moment about its axis:
its flexibility there is zero, which multiplies nothing at a passive joint, and at a motor's says
that the motor itself holds its shaft.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import sparse
from scipy.linalg import qr

from wrist_stiffness.fem.elasticity import cylindrical_axes, rigid_motion, surface_integrals
from wrist_stiffness.fem.factor import CyclicFactor, Factor, factorise, factorise_cyclic
from wrist_stiffness.fem.parts import ElasticBody
from wrist_stiffness.mechanism.components import Array

Interface = Literal["rigid", "distributing", "sliding"]

ALL_WAYS = (0, 1, 2)
RADIALLY = (0,)
"""Directions at a node of a wall, in the axes of `wall_axes`, that follow the frame."""

ALL = (0, 1, 2, 3, 4, 5)
ACROSS = (0, 1, 3, 4)
"""Components of a screw that move a wall, and those that move one about z along its normals."""


@dataclass(frozen=True)
class Superelement:
    """A solid as its two frames see it, at its own origin in its own axes.

    With w a wrench on the platform-side frame, f amounts of the inner loads (sector forces) and g
    an acceleration, the motor-side frame held:

        frame screw = flexibility @ (w + weight_platform_side @ g) + sector_screw @ f
        work screw of sectors = sector_screw.T @ (w + weight_platform_side @ g)
                                + sector_approach @ f + sector_weight @ g
    """

    # (6, 6), screw of the platform-side frame for unit wrenches [m/N, rad/N, rad/(N m)]
    flexibility: Array
    # `weight_motor_side`, `weight_platform_side`: (6, 3), consistent wrenches on the frames for
    # unit accelerations [N/(m/s^2), N m/(m/s^2)]
    weight_motor_side: Array
    weight_platform_side: Array
    # (6, m), wrench on the hub of 1 N between each sector and the hub [N, N m]
    sector_wrench: Array
    # (6, m), screw of the platform-side frame for 1 N on each sector of the flange [m/N, rad/N]
    sector_screw: Array
    # (m, m), mean displacement of each sector away from the hub for 1 N on each sector [m/N]
    sector_approach: Array
    # (m, 3), the same for unit accelerations with both frames held [m/(m/s^2)]
    sector_weight: Array
    # (12, 12), of the motion that follows the frames without inertia, motor side first [kg, kg m,
    # kg m^2]
    mass: Array


def condense(body: ElasticBody, interface: Interface) -> Superelement:
    """Condense a solid onto its two frames.

    `interface` ({"rigid", "distributing", "sliding"}): how the walls follow the frames.
    """
    loads = np.hstack([body.weight, body.pressure])
    if interface == "distributing":
        flexibility, on_motor, on_platform, inner, shape = _condense_distributing(body, loads)
    else:
        slides = interface == "sliding" and body.solid.is_bushing
        stiffness, on_frames, inner, shape = frame_stiffness(body, loads, slides)
        carried = np.ix_(ACROSS, ACROSS) if slides else np.ix_(ALL, ALL)
        flexibility = np.zeros((6, 6))
        flexibility[carried] = _inverse(stiffness[6:, 6:][carried])
        on_motor, on_platform = on_frames[:6], on_frames[6:]
    sector_screw = flexibility @ on_platform[:, 3:]
    # Of the nodes as they move by each shape.
    momentum = body.mass @ shape.reshape(len(body.mesh.nodes), -1)
    return Superelement(
        flexibility=flexibility,
        weight_motor_side=on_motor[:, :3],
        weight_platform_side=on_platform[:, :3],
        sector_wrench=-rigid_motion(body.mesh.nodes).T @ body.pressure,
        sector_screw=sector_screw,
        sector_approach=_symmetric(inner[3:, 3:] + on_platform[:, 3:].T @ sector_screw),
        sector_weight=inner[3:, :3],
        mass=_symmetric(shape.T @ momentum.reshape(shape.shape)),
    )


def frame_stiffness(
    body: ElasticBody, loads: Array, slides: bool = False
) -> tuple[Array, Array, Array, Array]:
    """Guyan condensation onto the motor-side and the platform-side rigid frame.

    `loads` (3 n, k): nodal forces; `slides`: whether the wall on the platform side, about z,
    follows its frame along its normals only.  Gives `stiffness` (12, 12): of the two frames, motor
    side first; `on_frames` (12, k): wrenches on the frames that do the loads' work; `inner` (k, k):
    work of each load along each load's displacements with both frames held; `shape` (3 n, 12):
    displacements of the nodes by the frames' unit screws.
    """
    mesh = body.mesh
    # Cylindrical at the nodes of a bushing, the solid's own at those of a link.
    axes = sparse.csr_matrix(sparse.eye(3 * len(mesh.nodes)))
    if body.solid.is_bushing:
        axes = cylindrical_axes(mesh.nodes)
    rigid = axes.T @ rigid_motion(mesh.nodes)
    motion = np.zeros((len(rigid), 12))
    held = np.zeros(len(rigid), dtype=bool)
    walls = (
        (body.solid.motor_wall, ALL_WAYS),
        (body.solid.platform_wall, RADIALLY if slides else ALL_WAYS),
    )
    for side, (wall, ways) in enumerate(walls):
        unknowns = (3 * mesh.surface_nodes(wall)[:, None] + np.array(ways)).ravel()
        carried = np.array(ALL if ways == ALL_WAYS else ACROSS)
        motion[np.ix_(unknowns, 6 * side + carried)] = rigid[np.ix_(unknowns, carried)]
        held[unknowns] = True
    free = np.flatnonzero(~held)
    pull, loads = axes.T @ (body.stiffness @ (axes @ motion)), axes.T @ loads
    factor: CyclicFactor | Factor
    if mesh.slices > 1:
        factor = factorise_cyclic(body.stiffness, axes, mesh.nodes, free, mesh.slices)
    else:
        factor = factorise((axes.T @ body.stiffness @ axes)[free][:, free], free)
    solution = factor.solve(np.hstack([pull, loads])[free])
    by_frames, by_loads = solution[:, :12], solution[:, 12:]
    stiffness = _symmetric(motion.T @ pull - pull[free].T @ by_frames)
    on_frames = motion.T @ loads - pull[free].T @ by_loads
    inner = _symmetric(loads[free].T @ by_loads)
    motion[free] -= by_frames
    return stiffness, on_frames, inner, axes @ motion


def _condense_distributing(
    body: ElasticBody, loads: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Held by its averaged motor-side frame, a solid is supported statically determinately."""
    nodes = body.mesh.nodes
    rigid = rigid_motion(nodes)
    motor = _wall_average(body, body.solid.motor_wall)
    platform = _wall_average(body, body.solid.platform_wall)
    all_loads = np.hstack([platform, loads])
    balanced = all_loads - motor @ (rigid.T @ all_loads)
    # Balanced loads need no support: any six unknowns that stop the rigid motion will do.
    _, _, first = qr(rigid.T, mode="economic", pivoting=True)
    free = np.setdiff1d(np.arange(3 * len(nodes)), first[:6])
    displacement = np.zeros_like(all_loads)
    displacement[free] = factorise(body.stiffness[free][:, free], free).solve(balanced[free])
    # Balanced loads do no work on the rigid motion that is left in these displacements.
    work = _symmetric(balanced.T @ displacement)
    flexibility = work[:6, :6]
    on_platform = _inverse(flexibility) @ work[:6, 6:]
    inner = work[6:, 6:] - on_platform.T @ flexibility @ on_platform
    # The motor side's mean motion taken out, what is left follows the platform side.
    bent = displacement[:, :6] - rigid @ (motor.T @ displacement[:, :6])
    by_platform = bent @ _inverse(flexibility)
    shape = np.hstack([rigid - by_platform, by_platform])
    return flexibility, rigid.T @ loads - on_platform, on_platform, inner, shape


def _wall_average(body: ElasticBody, wall: str) -> Array:
    """Nodal forces of the frame's unit wrenches (3 n, 6); its transpose gives the mean screw."""
    integrals = surface_integrals(body.mesh, wall)
    # A screw's displacement field is linear in the place, so these four integrals span it.
    moments = np.zeros((len(integrals), 3, 6))
    moments[:, [0, 1, 2], [0, 1, 2]] = integrals[:, :1]
    x, y, z = integrals[:, 1:].T
    moments[:, 1, 3], moments[:, 2, 3] = -z, y
    moments[:, 0, 4], moments[:, 2, 4] = z, -x
    moments[:, 0, 5], moments[:, 1, 5] = -y, x
    spread = moments.reshape(-1, 6)
    gram = rigid_motion(body.mesh.nodes).T @ spread
    return spread @ np.asarray(np.linalg.inv(gram), dtype=np.float64)


def _inverse(matrix: Array) -> Array:
    return _symmetric(np.asarray(np.linalg.inv(matrix), dtype=np.float64))


def _symmetric(matrix: Array) -> Array:
    return (matrix + matrix.T) / 2.0
