"""Sliding bushings whose walls lift off: the whole wrist as one contact problem at a pose.

The wall of a bushing is cut into patches, each a mode of even normal pressure, and so are its
flanges.  Without any frame, the condensed bushing is a flexibility between these modes, so wall and
flanges are one law at two places: a force that only pushes, and a gap, which on the wall is the
clearance.  Pressed by a motion of what slides on it, a bushing is a contact problem of its own
(`mechanism/contact.py`) with a convex energy; seven frames, three links and five such springs have
the least energy where a wrist under load rests, which Newton's method finds in a few steps.
It tells what the two-sided walls of a table leave out; its answer is not linear in the load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from wrist_stiffness.errors import InputError
from wrist_stiffness.fem.elasticity import cylindrical_axes, rigid_motion, surface_integrals
from wrist_stiffness.fem.factor import factorise_cyclic
from wrist_stiffness.fem.mesh import SolidMesh
from wrist_stiffness.fem.parts import (
    ElasticBody,
    Part,
    assemble_body,
    wrist_parts,
)
from wrist_stiffness.fem.revolve import SECTORS
from wrist_stiffness.fem.solids import FLANGES, MeshSettings
from wrist_stiffness.lookup.verification import relative_misses
from wrist_stiffness.mechanism.components import (
    CARRIER,
    ELASTIC,
    JOINTS,
    LINKS,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import mechanism_of

SUSPENSION = np.repeat([1e-2, 1e-5], 3)
"""Springs that hold each frame to the ground, so that a pin that rattles in its clearance is found
where it comes to rest [N/m, N m/rad]; ten million times softer than a wrist."""

FRAMES = (*(f"{link}_{end}" for link in LINKS for end in ("root", "tip")), "platform")
"""Rigid frames: the pin or hub at each end of each link, and the platform."""

HUB = {"joint_2": "platform", "joint_3": "platform", "joint_4": "link_3_root"}
"""The frame in whose hub a passive joint's bushing slides and turns."""

DRIVEN = {"link_1_root": "joint_1", "link_2_root": "joint_5"}
"""Frames whose slide along and turn about a motor's axis the motor holds if the bushings slide."""

PIN = {"joint_2": "link_1_tip", "joint_3": "link_3_tip", "joint_4": "link_2_tip"}
"""The frame on which a bushing sits; those of the motors sit in the ground."""

SLIDES_ON = {**HUB, "joint_1": "link_1_root", "joint_5": "link_2_root"}
"""The frame that slides or turns on a bushing."""

WALL_RINGS = 4
"""Patches for `lifting_misses`, whose ratio is steadier than what it divides (docs/walls.md)."""

MOST_STEPS = 200

LEAST_FALL = 1e-13
"""Newton's method ends where a step would lower the energy by less of itself."""


@dataclass(frozen=True)
class PatchedBushing:
    """A bushing as its contact patches see it, in its own axes; patches go slice after slice."""

    # (m, m), retreat of each patch for 1 N spread over each, the wall that is glued held [m/N]
    flexibility: Array
    wrench: Array  # (6, m), on what slides in or on the bushing, for 1 N on each patch [N, N m]
    surface: NDArray[np.str_]  # (m,) str, `wall`, `inner` or `outer`: where each patch is
    # `angle`, `height`, `area`: (m,), its middle about z [rad] and along z [m], and its area [m^2]
    angle: Array
    height: Array
    area: Array


def patch_bushing(body: ElasticBody, wall_rings: int) -> PatchedBushing:
    """Condense a bushing onto its contact patches.

    `body`: a bushing; there are as many patches around as its mesh has slices, and over the width
    of a flange as its solid has rings; `wall_rings`: patches along the wall, of equal numbers of
    mesh lines, so finest where the mesh is.
    """
    mesh, solid = body.mesh, body.solid
    axes = cylindrical_axes(mesh.nodes)
    held = (3 * mesh.surface_nodes(solid.motor_wall)[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(3 * len(mesh.nodes)), held)
    presses_outwards = 1.0 if solid.platform_wall == "pin_wall" else -1.0
    surfaces = [
        ("wall", line, 0, presses_outwards)
        for line in _split_along(mesh, mesh.surfaces[solid.platform_wall], wall_rings)
    ]
    for flange, sign in zip(FLANGES, (-1.0, 1.0), strict=True):
        for ring in range(solid.rings) if flange in solid.flanges else ():
            sectors = [mesh.surfaces[f"{flange}_{ring}_{k}"] for k in range(SECTORS)]
            surfaces.append((flange, np.concatenate(sectors), 2, sign))
    turn = 2.0 * np.pi / mesh.slices
    modes, names, places = [], [], []
    for k in range(mesh.slices):
        for name, facets, way, sign in surfaces:
            patch = _slice(mesh, facets, k)
            integrals = surface_integrals(replace(mesh, surfaces={"patch": patch}), "patch")
            area, *moment = integrals.sum(axis=0)
            mode = np.zeros((len(mesh.nodes), 3))
            mode[:, way] = sign * integrals[:, 0] / area
            modes.append(mode.ravel())
            names.append(name)
            places.append([(k + 0.5) * turn, moment[2] / area, area])
    loads, count = np.array(modes).T, len(modes) // mesh.slices
    factor = factorise_cyclic(body.stiffness, axes, mesh.nodes, free, mesh.slices)
    by_first = loads[free].T @ factor.solve(loads[free, :count])
    flexibility = np.hstack([np.roll(by_first, k * count, axis=0) for k in range(mesh.slices)])
    angle, height, area = np.array(places).T
    return PatchedBushing(
        flexibility=(flexibility + flexibility.T) / 2.0,
        wrench=-(axes.T @ rigid_motion(mesh.nodes)).T @ loads,
        surface=np.array(names),
        angle=angle,
        height=height,
        area=area,
    )


@dataclass(frozen=True)
class PatchedWrist:
    """A wrist of patched bushings and condensed links."""

    geometry: Geometry
    parts: list[Part]  # in the order of `ELASTIC`
    components: ElasticComponents  # for the flexibility of the links
    bushings: dict[str, PatchedBushing]


@dataclass(frozen=True)
class Lifted:
    """One pose solved."""

    twist: Array  # (6,), of the platform at O in F [m, rad]
    forces: dict[str, Array]  # dict of str to (m,), of each bushing's patches [N]


def solve_patches(
    wrist: PatchedWrist,
    configuration: Configuration,
    wrench: Array,
    clearance: float = 0.0,
    lifts: bool = True,
) -> Lifted:
    """Solve a pose for a load, without own weight.

    `wrench` (6,): on the platform at O in F [N, N m].  `clearance`: radial clearance of every
    sliding wall [m].  `lifts`: whether walls lift off; if not they pull too, as the two-sided walls
    of a table do.
    """
    springs = [_Spring.placed(wrist, joint, configuration, clearance, lifts) for joint in JOINTS]
    ways = _free_ways(wrist.geometry)
    stiffness = np.diag(np.tile(SUSPENSION, len(FRAMES)))
    for link in LINKS:
        turned = np.kron(np.eye(2), configuration.rotations[link])
        flexibility = turned @ wrist.components.flexibility[ELASTIC.index(link)] @ turned.T
        across = _between(f"{link}_tip", f"{link}_root")
        stiffness += across.T @ np.linalg.solve(flexibility, across)
    load = np.zeros(6 * len(FRAMES))
    load[-6:] = wrench
    moved = np.zeros(len(load))
    # The first step is that of walls and flanges that hold everywhere.
    pressed = [(0.0 * spring.gap, np.ones(len(spring.gap), dtype=bool)) for spring in springs]
    energy = 0.0
    for _ in range(MOST_STEPS):
        whole, push = stiffness.copy(), load - stiffness @ moved
        for spring, (force, held) in zip(springs, pressed, strict=True):
            whole += spring.across.T @ spring.tangent(held) @ spring.across
            push += spring.across.T @ (spring.wrench @ force)
        step = ways @ np.linalg.solve(ways.T @ whole @ ways, ways.T @ push)
        fall = float(push @ step)
        if fall <= LEAST_FALL * abs(energy):
            forces = {j: force for j, (force, _) in zip(JOINTS, pressed, strict=True)}
            return Lifted(moved[-6:], forces)
        share = 1.0
        while True:
            trial = moved + share * step
            tried = [
                spring.press(trial, held)
                for spring, (_, held) in zip(springs, pressed, strict=True)
            ]
            stored = sum(s.energy(force) for s, (force, _) in zip(springs, tried, strict=True))
            after = float(trial @ (stiffness @ trial / 2.0 - load)) + stored
            # Rounding may hide the last falls; Armijo's condition for all others.
            if after <= energy - 1e-4 * share * fall + LEAST_FALL * abs(energy):
                break
            share /= 2.0
        moved, pressed, energy = trial, tried, after
    raise InputError(f"sliding walls: no rest found in {MOST_STEPS} steps")


def lifting_misses(
    geometry: Geometry,
    components: ElasticComponents,
    sizes: MeshSettings,
    poses: Array,
    loads: Array,
) -> Array:
    """Return how far walls that lift off, without clearance, are from two-sided ones.

    `sizes`: element sizes of the bushings in patches; `poses` (n, 2): motor angles [rad]; `loads`
    (n, 6): on the platform at O in F [N, N m].  Gives (n, 2): lengths of the differences of s and
    phi over those of the two-sided walls.
    """
    parts = wrist_parts(geometry, rings=1)
    bushings = {
        part.name: patch_bushing(assemble_body(part.solid, sizes), WALL_RINGS)
        for part in parts
        if part.solid.is_bushing
    }
    wrist, mechanism = PatchedWrist(geometry, parts, components, bushings), mechanism_of(geometry)
    two, one = (
        np.array(
            [
                solve_patches(wrist, mechanism.forward(theta), load, lifts=lifts).twist
                for theta, load in zip(poses, loads, strict=True)
            ]
        )
        for lifts in (False, True)
    )
    return relative_misses(one, two)


@dataclass(frozen=True)
class _Spring:
    """A patched bushing at a pose.

    `gap` (m,) of its patches, `wrench` (6, m) on what slides at O in F, `across` (6, n) the screw
    of what slides against what it sits on by those of all frames, `pulls` patches that pull too.
    """

    flexibility: Array
    wrench: Array
    gap: Array
    across: Array
    pulls: NDArray[np.bool_]

    @classmethod
    def placed(
        cls,
        wrist: PatchedWrist,
        joint: str,
        configuration: Configuration,
        clearance: float,
        lifts: bool,
    ) -> _Spring:
        bushing, part = wrist.bushings[joint], wrist.parts[ELASTIC.index(joint)]
        at = part.home.turned(configuration.rotations[CARRIER[joint]])
        dimensions = wrist.geometry.bushings[joint]
        gap_of = {"wall": clearance, "inner": dimensions.inner_gap, "outer": dimensions.outer_gap}
        return cls(
            flexibility=bushing.flexibility,
            wrench=at.wrench @ bushing.wrench,
            gap=np.array([gap_of[name] for name in bushing.surface], dtype=float),
            across=_between(SLIDES_ON[joint], PIN.get(joint)),
            pulls=(bushing.surface == "wall") & (not lifts),
        )

    def press(self, moved: Array, guess: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Return the forces of the patches for a motion of all frames, and which touch."""
        apart = self.gap + self.wrench.T @ (self.across @ moved)
        if not self.pulls.any():
            return solve_contact(self.flexibility, apart, guess)
        pulls, pushes = self.pulls, ~self.pulls
        own, cross = self.flexibility[np.ix_(pulls, pulls)], self.flexibility[np.ix_(pulls, pushes)]
        by_pulling = np.linalg.solve(own, np.column_stack([cross, apart[pulls]]))
        force, held = np.zeros(len(apart)), pulls.copy()
        force[pushes], held[pushes] = solve_contact(
            self.flexibility[np.ix_(pushes, pushes)] - cross.T @ by_pulling[:, :-1],
            apart[pushes] - cross.T @ by_pulling[:, -1],
            guess[pushes],
        )
        force[pulls] = -by_pulling @ np.append(force[pushes], 1.0)
        return force, held

    def tangent(self, held: NDArray[np.bool_]) -> Array:
        """Stiffness of the patches in contact against what slides (6, 6) [N/m, N, N m]."""
        wrench = self.wrench[:, held]
        by_patch = np.linalg.solve(self.flexibility[np.ix_(held, held)], wrench.T)
        return np.asarray(wrench @ by_patch)

    def energy(self, force: Array) -> float:
        """Strain energy under patch forces [J]."""
        return float(force @ (self.flexibility @ force)) / 2.0


def _between(frame: str, other: str | None) -> Array:
    """Screw of a frame against another one, or against the ground, by those of all (6, n)."""
    rows = np.zeros((6, len(FRAMES), 6))
    rows[:, FRAMES.index(frame)] = np.eye(6)
    if other is not None:
        rows[:, FRAMES.index(other)] = -np.eye(6)
    return rows.reshape(6, -1)


def _free_ways(geometry: Geometry) -> Array:
    """Screws of the frames by their freedoms: a motor holds its shaft along and about its axis."""
    blocks = []
    for frame in FRAMES:
        across = np.eye(3)
        if frame in DRIVEN:
            across = np.linalg.svd(geometry.axes[DRIVEN[frame]][None])[2][1:].T
        blocks += [across, across]
    return np.asarray(block_diag(*blocks))


def _slice(mesh: SolidMesh, facets: NDArray[np.int64], number: int) -> NDArray[np.int64]:
    """Facets of one slice of a swept surface."""
    centre = mesh.tets.p[:, mesh.tets.facets[:, facets]].mean(axis=1)
    angle = np.arctan2(centre[1], centre[0]) % (2.0 * np.pi)
    return facets[(angle * mesh.slices / (2.0 * np.pi)).astype(int) == number]


def _split_along(mesh: SolidMesh, facets: NDArray[np.int64], rings: int) -> list[NDArray[np.int64]]:
    """Split a wall's facets along z into rings of equal numbers of mesh lines, at most one each."""
    height = mesh.tets.p[2, mesh.tets.facets[:, facets]]
    # Both triangles of a mesh line's quadrilateral reach from one of its ends to the other.
    lines, of_facet = np.unique(
        np.round(height.min(axis=0) + height.max(axis=0), 9), return_inverse=True
    )
    rings = min(rings, len(lines))
    return [facets[of_facet * rings // len(lines) == k] for k in range(rings)]
