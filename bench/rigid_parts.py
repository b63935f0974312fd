"""What the shipped table leaves out as rigid: the pins, and a platform as it may be drawn.

    python bench/rigid_parts.py

Pins are steel beams, as `pins` in a geometry makes them.  The platform is an aluminium plate with
a lug for joint_2's hub and a boss for joint_3's, by finite elements: its two hubs against a disc of
20 mm diameter that carries the tool.
Prints what each adds to s and phi of random loads in the operative workspace.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from netgen.occ import Axis, Box, Cylinder, Dir, OCCGeometry, Pnt, Z

from wrist_stiffness.commands.uncertainty import STEEL
from wrist_stiffness.fem.components import SHIPPED_SIZES
from wrist_stiffness.fem.elasticity import rigid_motion, stiffness_matrix
from wrist_stiffness.fem.factor import factorise
from wrist_stiffness.fem.mesh import SolidMesh, mesh_solid
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.lookup.verification import random_loads, relative_misses, unseen_poses
from wrist_stiffness.mechanism.components import ELASTIC, LINKS, Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.material import Material
from wrist_stiffness.mechanism.pins import pin_flexibilities
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.shipped import shipped_file

ALUMINIUM = Material(young=70e9, poisson=0.33, density=2700.0, expansion=23e-6)

LUG_MM, BOSS_MM, TOOL_MM = 10.0, 13.0, 20.0
"""Width of joint_2's lug, diameter of joint_3's boss and of what carries the tool."""


def platform_mesh(geometry: Geometry) -> SolidMesh:
    """Mesh a plate with a lug and a boss; surfaces `joint_2`, `joint_3`, `tool`."""
    plate = geometry.platform
    thickness = 1e3 * plate.thickness
    foot = 1e3 * plate.centre[2] - thickness
    tool = Cylinder(Pnt(0, 0, foot + thickness), Z, r=TOOL_MM / 2.0, h=thickness / 3.0)
    tool.faces.Max(Z).name = "tool"
    body = Cylinder(Pnt(0, 0, foot), Z, r=5e2 * plate.diameter, h=thickness) + tool
    bores = []
    for joint in ("joint_2", "joint_3"):
        seat, side = geometry.bushings[joint], geometry.joint_side(joint)
        near, far = (1e3 * (abs(seat.radius) + end * seat.length / 2.0) for end in (-1, 1))
        if joint == "joint_2":
            low = Pnt(near, -LUG_MM / 2.0, foot)
            lug = Box(low, Pnt(far, LUG_MM / 2.0, near * side[2] + LUG_MM / 2.0))
            body += lug.Rotate(Axis((0, 0, 0), Z), np.degrees(np.arctan2(side[1], side[0])))
        else:
            root = (foot + thickness / 3.0) / side[2]
            body += Cylinder(Pnt(*(root * side)), Dir(*side), r=BOSS_MM / 2.0, h=far - root)
        wall = 5e2 * seat.pin_diameter + 1e3 * seat.wall
        # A little deeper on joint_2's two sides than its lug, which stands upright.
        start, depth = (near - 1.0, far - near + 2.0) if joint == "joint_2" else (near, far)
        bore = Cylinder(Pnt(*(start * side)), Dir(*side), r=wall, h=depth)
        bore.faces.name = joint
        bore.faces.maxh = 1e3 * SHIPPED_SIZES.bore
        bores.append(bore)
    for bore in bores:
        body -= bore
    body.solids.maxh = 1e3 * SHIPPED_SIZES.link
    return mesh_solid(OCCGeometry(body))


def frames_flexibility(mesh: SolidMesh, material: Material, walls: tuple[str, ...]) -> Array:
    """Screws of rigid walls by wrenches on them, all at O; the last wall held (6 k, 6 k)."""
    stiffness = stiffness_matrix(mesh, material)
    rigid, free = rigid_motion(mesh.nodes), np.ones(3 * len(mesh.nodes), dtype=bool)
    motion = np.zeros((len(rigid), 6 * len(walls)))
    for side, wall in enumerate(walls):
        held = (3 * mesh.surface_nodes(wall)[:, None] + np.arange(3)).ravel()
        free[held] = False
        motion[held, 6 * side : 6 * side + 6] = rigid[held]
    inside, motion = np.flatnonzero(free), motion[:, :-6]
    pull = stiffness @ motion
    follows = factorise(stiffness[inside][:, inside], inside).solve(pull[inside])
    return np.asarray(np.linalg.inv(motion.T @ pull - pull[inside].T @ follows))


def main() -> None:
    """Print mean and 99 % of what rigid pins and a rigid platform leave out."""
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    geometry, components = table.geometry, table.components
    rng = np.random.default_rng(26)
    poses = unseen_poses(table.workspace, rng)
    poses = poses[table.workspace.operative(poses)]
    loads = random_loads(geometry.limits, len(poses), rng)
    configuration = table.mechanism.forward(poses)

    def twist(flexibility: Array) -> Array:
        parts = replace(components, flexibility=flexibility)
        return respond(contact_operators(configuration, parts, np.zeros(3)), loads).twist

    with_pins = components.flexibility.copy()
    for link in LINKS:
        with_pins[ELASTIC.index(link)] += sum(pin_flexibilities(geometry, link, STEEL))
    rigid = twist(components.flexibility)
    said("pins", relative_misses(twist(with_pins), rigid))

    mesh = platform_mesh(geometry)
    flexibility = frames_flexibility(mesh, ALUMINIUM, ("joint_2", "joint_3", "tool"))
    laws = influence(configuration).of_components()
    carried = [np.kron(np.eye(2), laws[:, ELASTIC.index(j)]) for j in ("joint_2", "joint_3")]
    both = np.concatenate(carried, axis=-1) @ np.kron(np.eye(4), configuration.platform)
    added = (both @ flexibility @ np.swapaxes(both, -1, -2) @ loads[..., None])[..., 0]
    said(f"platform, {len(mesh.elements)} elements", relative_misses(rigid + added, rigid))


def said(name: str, misses: Array) -> None:
    """Print one row."""
    for half, values in zip(("s", "phi"), 100.0 * misses.T, strict=True):
        most = np.quantile(values, 0.99)
        print(f"{name}: {half} mean {values.mean():.0f} %, 99 of 100 {most:.0f} %")


if __name__ == "__main__":
    main()
