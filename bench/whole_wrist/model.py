"""The whole wrist as one finite-element model at one pose: its parts, frames and equations.

It shares meshes with the condensed parts and nothing else: no condensed matrix, no influence G.
The unknowns are all inner nodes of all parts, the screws of the seven rigid frames and the slide
and turn of each cylindrical joint, so the mechanism's statics come out of the equations.  Where
bushings slide (see `superelement.py`), the nodes of their sliding walls keep their two unknowns
along the wall, and slides and turns have no equation of their own: nothing holds them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from wrist_stiffness.fem.elasticity import block_axes, cylindrical_axes, rigid_motion
from wrist_stiffness.fem.factor import Factor, factorise
from wrist_stiffness.fem.one_sided import DRIVEN, FRAMES, HUB, PIN, SLIDES_ON
from wrist_stiffness.fem.parts import ElasticBody, Part, Solid, assemble_body, wrist_parts
from wrist_stiffness.fem.solids import FLANGES, MeshSettings
from wrist_stiffness.fem.superelement import ALL_WAYS, RADIALLY
from wrist_stiffness.mechanism.components import CARRIER, LINKS, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.geometry import Geometry

MOTOR_FRAME = {link: f"{link}_root" for link in LINKS} | PIN
"""Frame on the motor side; that of joint_1 and joint_5 is the ground."""

PLATFORM_FRAME = {link: f"{link}_tip" for link in LINKS} | SLIDES_ON
"""Frame on the platform side; a passive joint's wall differs from it by its slide and turn."""

SCREWS = 6 * len(FRAMES) + 2 * len(PASSIVE_JOINTS)
"""Unknowns besides the inner nodes: seven screws at O, then slide and turn of each joint."""


@dataclass(frozen=True)
class WristBodies:
    """The assembled bodies of a wrist at home, made once for all poses; whether bushings slide."""

    geometry: Geometry
    parts: list[Part]
    bodies: dict[Solid, ElasticBody]
    slides: bool


@dataclass(frozen=True)
class PlacedBody:
    """One part's finite elements turned to a pose, everything in F.

    Parameters
    ----------
    name : str
        Its component.
    body : ElasticBody
        Its matrices at home in its own axes.
    turn : sparse.csr_matrix
        (3 n, 3 n) block diagonal rotation from the part's axes to F.
    nodes : (n, 3) float
        Places in F [m].
    stiffness : sparse.csr_matrix
        (3 n, 3 n) in F [N/m].
    axes : sparse.csr_matrix
        (3 n, 3 n) from the axes in which nodes are held or free to F: F itself, or radial,
        tangential and axial ones of a sliding bushing.
    motor_wall, platform_wall : (k,) int
        Directions, in these axes, of nodes on the two walls that follow the frames.
    motor_screw, platform_screw : (6, SCREWS) float
        Screw of each wall as a combination of the frames' screws, slides and turns.
    """

    name: str
    body: ElasticBody
    turn: sparse.csr_matrix
    nodes: Array
    stiffness: sparse.csr_matrix
    axes: sparse.csr_matrix
    motor_wall: NDArray[np.int64]
    platform_wall: NDArray[np.int64]
    motor_screw: Array
    platform_screw: Array


@dataclass(frozen=True)
class WristAtPose:
    """The factored model at a pose.

    Parameters
    ----------
    wrist : WristBodies
        The bodies.
    configuration : Configuration
        One pose.
    placed : list of PlacedBody
        Its parts in F.
    follow : list of sparse.csr_matrix
        Displacement of each part's nodes by the unknowns (3 n, u).
    factor : Factor
        Of the assembled stiffness (u, u).
    openings : sparse.csr_matrix
        Change of each flange gap by the unknowns (m, u).
    gaps : (m,) float
        Gaps of the unloaded wrist [m].
    """

    wrist: WristBodies
    configuration: Configuration
    placed: list[PlacedBody]
    follow: list[sparse.csr_matrix]
    factor: Factor
    openings: sparse.csr_matrix
    gaps: Array

    @property
    def platform_columns(self) -> slice:
        """Place of the platform's screw among the unknowns."""
        start = self.openings.shape[1] - SCREWS + 6 * FRAMES.index("platform")
        return slice(start, start + 6)

    @cached_property
    def by_force(self) -> Array:
        """Unknowns for a unit force of each flange sector (u, m)."""
        return self.factor.solve(self.openings.T.toarray())


def build_wrist(geometry: Geometry, sizes: MeshSettings, slides: bool = False) -> WristBodies:
    """Mesh and assemble all parts of a wrist.

    Parameters
    ----------
    geometry : Geometry
        The wrist.
    sizes : MeshSettings
        Element sizes.
    slides : bool
        Whether bushings slide; all walls are rigid if not.

    Returns
    -------
    WristBodies
        Equal parts share one body.
    """
    parts = wrist_parts(geometry)
    bodies = {solid: assemble_body(solid, sizes) for solid in {part.solid for part in parts}}
    return WristBodies(geometry, parts, bodies, slides)


def factor_pose(wrist: WristBodies, configuration: Configuration) -> WristAtPose:
    """Assemble and factor the whole wrist at one pose.

    Parameters
    ----------
    wrist : WristBodies
        The bodies.
    configuration : Configuration
        One pose (no leading axes); only its axes and rotations are used.

    Returns
    -------
    WristAtPose
        To be solved for any load.
    """
    placed = [_place(wrist, part, configuration) for part in wrist.parts]
    free = [
        np.setdiff1d(np.arange(part.stiffness.shape[0]), np.r_[part.motor_wall, part.platform_wall])
        for part in placed
    ]
    inner = sum(len(unknowns) for unknowns in free)
    follow, start = [], 0
    for part, unknowns in zip(placed, free, strict=True):
        follow.append(_follow(part, unknowns, start, inner))
        start += len(unknowns)
    stiffness = sum(t.T @ part.stiffness @ t for t, part in zip(follow, placed, strict=True))
    openings, gaps = _gap_rows(wrist, placed, follow, inner)
    # What a motor holds, and what a sliding bushing leaves without an equation, has no stiffness.
    stiff = np.flatnonzero(stiffness.diagonal())
    inside = factorise(stiffness[stiff][:, stiff], stiff)
    factor = Factor(stiff[inside.order], inside.lu)
    return WristAtPose(wrist, configuration, placed, follow, factor, openings, gaps)


def platform_weight(model: WristAtPose, gravity: Array) -> Array:
    """Weight of the platform as a wrench at O in F (6,) [N, N m]."""
    platform = model.wrist.geometry.platform
    place = model.configuration.rotations["platform"] @ platform.centre_of_gravity
    force = platform.mass * gravity
    return np.concatenate([force, np.cross(place, force)])


def _frame_screw(wrist: WristBodies, frame: str) -> Array:
    screw = np.zeros((6, SCREWS))
    start = 6 * FRAMES.index(frame)
    if wrist.slides and frame in DRIVEN:
        axis = wrist.geometry.axes[DRIVEN[frame]]
        # Two directions across the axis; along it the motor holds its shaft.
        across = np.linalg.svd(axis[None])[2][1:].T
        screw[:3, start + 1 : start + 3] = screw[3:, start + 4 : start + 6] = across
    else:
        screw[:, start : start + 6] = np.eye(6)
    return screw


def _place(wrist: WristBodies, part: Part, configuration: Configuration) -> PlacedBody:
    body = wrist.bodies[part.solid]
    at = part.home.turned(configuration.rotations[CARRIER[part.name]])
    count = len(body.mesh.nodes)
    turn = block_axes(np.broadcast_to(at.rotation, (count, 3, 3)))
    slides = wrist.slides and body.solid.is_bushing
    axes = sparse.csr_matrix(sparse.eye(3 * count))
    if slides:
        axes = turn @ cylindrical_axes(body.mesh.nodes)
    motor_screw = platform_screw = np.zeros((6, SCREWS))
    if part.name in MOTOR_FRAME:
        motor_screw = _frame_screw(wrist, MOTOR_FRAME[part.name])
    platform_screw = _frame_screw(wrist, PLATFORM_FRAME[part.name])
    if part.name in PASSIVE_JOINTS and not slides:
        column = 6 * len(FRAMES) + 2 * PASSIVE_JOINTS.index(part.name)
        axis = _joint_axis(configuration, part.name)
        platform_screw[:3, column] = -axis
        platform_screw[3:, column + 1] = -axis
    walls = [
        (3 * body.mesh.surface_nodes(wall)[:, None] + np.array(ways)).ravel().astype(np.int64)
        for wall, ways in (
            (part.solid.motor_wall, ALL_WAYS),
            (part.solid.platform_wall, RADIALLY if slides else ALL_WAYS),
        )
    ]
    return PlacedBody(
        name=part.name,
        body=body,
        turn=turn,
        nodes=body.mesh.nodes @ at.rotation.T + at.origin,
        stiffness=turn @ body.stiffness @ turn.T,
        axes=axes,
        motor_wall=walls[0],
        platform_wall=walls[1],
        motor_screw=motor_screw,
        platform_screw=platform_screw,
    )


def _joint_axis(configuration: Configuration, joint: str) -> Array:
    axes = {"joint_2": configuration.b, "joint_3": configuration.c, "joint_4": configuration.d}
    return axes[joint]


def _follow(part: PlacedBody, free: NDArray[np.int64], start: int, inner: int) -> sparse.csr_matrix:
    size = part.stiffness.shape[0]
    motion = part.axes.T @ rigid_motion(part.nodes)
    by_screws = np.zeros((size, SCREWS))
    by_screws[part.motor_wall] = motion[part.motor_wall] @ part.motor_screw
    by_screws[part.platform_wall] = motion[part.platform_wall] @ part.platform_screw
    own = sparse.csr_matrix(
        (np.ones(len(free)), (free, start + np.arange(len(free)))), shape=(size, inner)
    )
    return part.axes @ sparse.csr_matrix(sparse.hstack([own, sparse.csr_matrix(by_screws)]))


def _gap_rows(
    wrist: WristBodies, placed: list[PlacedBody], follow: list[sparse.csr_matrix], inner: int
) -> tuple[sparse.csr_matrix, Array]:
    """Return the opening of every flange gap by the unknowns, and the gaps themselves."""
    rows, gaps = [sparse.csr_matrix((0, inner + SCREWS))], []
    for part, t in zip(placed, follow, strict=True):
        sectors = part.body.solid.sectors
        if not sectors:
            continue
        pressure = part.turn @ part.body.pressure
        on_hub = -rigid_motion(part.nodes).T @ pressure
        by_hub = sparse.hstack(
            [
                sparse.csr_matrix((len(sectors), inner)),
                sparse.csr_matrix(on_hub.T @ _frame_screw(wrist, HUB[part.name])),
            ]
        )
        rows.append(sparse.csr_matrix(by_hub + sparse.csr_matrix(pressure.T) @ t))
        bushing = wrist.geometry.bushings[part.name]
        of_flange = dict(zip(FLANGES, (bushing.inner_gap, bushing.outer_gap), strict=True))
        gaps += [of_flange[sector.split("_")[0]] for sector in sectors]
    return sparse.csr_matrix(sparse.vstack(rows)), np.array(gaps, dtype=float)
