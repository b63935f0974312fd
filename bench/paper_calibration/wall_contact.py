"""A wall that lifts off, against CalculiX's own contact: the bushing of joint_2 in a rigid hub.

    python bench/paper_calibration/wall_contact.py [-o docs]

The hub is moved; forces on the pin answer.  CalculiX presses every node of the wall against a ring
of rigid elements (`*CONTACT PAIR`, node to surface).  `mechanism/contact.py` solves contact of the
same nodes, and of the patches of `fem/one_sided.py`: the first must agree, the second shows
what patches leave.  Writes the block "contact" of docs/walls.md.  Needs CalculiX; three minutes.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from paper_page import insert_blocks

from wrist_stiffness.fem.components import SHIPPED_SIZES
from wrist_stiffness.fem.elasticity import rigid_motion
from wrist_stiffness.fem.factor import factorise
from wrist_stiffness.fem.one_sided import patch_bushing
from wrist_stiffness.fem.parts import ElasticBody, assemble_body, wrist_parts
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.geometry_file import load_geometry

JOINT, RINGS, LEVELS = "joint_2", 16, 6
FINER_AROUND = 0.3
"""Of the shipped arcs: a node that slides off a corner of the ring must hardly notice."""

PENALTY_N_MM = 1e6
"""A thousand times the sleeve's own stiffness at a node."""

MOTIONS = {
    "2 µm sideways": (2e-6, 0.0, 0.0, 0.0, 0.0, 0.0),
    "1 mrad of tilt": (0.0, 0.0, 0.0, 0.0, 1e-3, 0.0),
    "both, askew": (1e-6, 0.5e-6, 0.0, 3e-4, 6e-4, 0.0),
}


def main() -> None:
    """Compare and write the block."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default="docs", help="folder of the page")
    arguments = parser.parse_args()
    parts = wrist_parts(load_geometry("config/palmieri2015.yaml"))
    solid = next(part.solid for part in parts if part.name == JOINT)
    arc = FINER_AROUND * asdict(SHIPPED_SIZES)["bushing_arc"]
    body = assemble_body(solid, replace(SHIPPED_SIZES.times(3.0), bushing_arc=arc))
    bushing = patch_bushing(body, RINGS)
    wall = bushing.surface == "wall"
    patches = bushing.flexibility[np.ix_(wall, wall)], bushing.wrench[:, wall]
    nodes = node_flexibility(body)
    rows = []
    for name, motion in MOTIONS.items():
        screw = np.array(motion)
        by_patches, by_nodes = (
            -screw @ wrench @ solve_contact(flexibility, wrench.T @ screw, None)[0]
            for flexibility, wrench in (patches, nodes)
        )
        judged = -screw @ by_calculix(body, screw)
        rows.append(
            f"| {name} | {1e6 * judged:.2f} | {1e6 * by_nodes:.2f} | "
            f"{100 * (by_nodes / judged - 1):+.1f} % | {1e6 * by_patches:.2f} | "
            f"{100 * (by_patches / judged - 1):+.1f} % |"
        )
        print(rows[-1], flush=True)
    head = "| hub moved by | CalculiX contact [µJ] | nodes | | patches | |"
    block = "\n".join([head, "| --- | --- | --- | --- | --- | --- |", *rows])
    page = Path(arguments.output) / "walls.md"
    page.write_text(insert_blocks(page.read_text(), {"contact": block}))


def node_flexibility(body: ElasticBody) -> tuple[Array, Array]:
    """Retreat of each node of the wall for radial forces of 1 N, and their wrenches on the hub."""
    mesh, solid = body.mesh, body.solid
    held = (3 * mesh.surface_nodes(solid.motor_wall)[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(3 * len(mesh.nodes)), held)
    on_wall = mesh.surface_nodes(solid.platform_wall)
    outwards = mesh.nodes[on_wall] * [1.0, 1.0, 0.0]
    outwards /= np.linalg.norm(outwards, axis=1)[:, None]
    loads = np.zeros((len(mesh.nodes), 3, len(on_wall)))
    loads[on_wall, :, np.arange(len(on_wall))] = -outwards
    loads = loads.reshape(-1, len(on_wall))
    moved = factorise(body.stiffness[free][:, free], free).solve(loads[free])
    flexibility = loads[free].T @ moved
    wrench = -rigid_motion(mesh.nodes).T @ loads
    return (flexibility + flexibility.T) / 2.0, wrench


def by_calculix(body: ElasticBody, screw: Array) -> Array:
    """Wrench (6,) [N, N m] of the pin's wall on the bushing, the hub moved by a screw."""
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "hub.inp"
        deck.write_text("\n".join(lines(body, screw)) + "\n")
        subprocess.run(["ccx", "-i", "hub"], cwd=folder, capture_output=True, check=True)
        printed = [row.split() for row in deck.with_suffix(".dat").read_text().splitlines()]
    forces = np.zeros((len(body.mesh.nodes), 3))
    for row in printed:
        if len(row) == 4 and row[0].isdigit():
            forces[int(row[0]) - 1] = [float(value) for value in row[1:]]
    return np.asarray(rigid_motion(body.mesh.nodes).T @ forces.ravel())


def lines(body: ElasticBody, screw: Array) -> list[str]:
    """Deck in N and mm: the bushing, the ring around its wall, contact, the hub's motion."""
    mesh, solid = body.mesh, body.solid
    nodes = 1e3 * mesh.nodes
    on_wall = mesh.surface_nodes(solid.platform_wall)
    radius = np.hypot(*nodes[on_wall, :2].T).max()
    low, high = nodes[on_wall, 2].min(), nodes[on_wall, 2].max()
    # Corners of the ring where the wall has nodes, so that neither cuts into the other at rest.
    count = 2 * mesh.slices
    around = 2.0 * np.pi / count * np.arange(count)
    ring = np.array(
        [
            (r * np.cos(a), r * np.sin(a), z)
            for r in (radius, radius + 0.5)
            for z in np.linspace(low, high, LEVELS + 1)
            for a in around
        ]
    )

    def corner(layer: int, level: int, step: int) -> int:
        return len(nodes) + 1 + (layer * (LEVELS + 1) + level) * count + step % count

    def numbered(rows: Array, first: int = 1) -> list[str]:
        return [f"{k}," + ",".join(f"{v:.12e}" for v in row) for k, row in enumerate(rows, first)]

    deck = ["*NODE", *numbered(np.vstack([nodes, ring])), "*ELEMENT, TYPE=C3D10, ELSET=BUSH"]
    # CalculiX wants right-handed tetrahedra; those of the sweep come in both hands.
    edges = mesh.nodes[mesh.elements[:, 1:4]] - mesh.nodes[mesh.elements[:, :1]]
    mirrored = mesh.elements[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    handed = np.where((np.linalg.det(edges) < 0.0)[:, None], mirrored, mesh.elements) + 1
    deck += [f"{k}," + ",".join(map(str, row)) for k, row in enumerate(handed, 1)]
    deck.append("*ELEMENT, TYPE=C3D8, ELSET=HUB")
    number = len(handed)
    for level in range(LEVELS):
        for step in range(count):
            number += 1
            quad = [(level, step), (level, step + 1), (level + 1, step + 1), (level + 1, step)]
            brick = [corner(layer, *place) for layer in (0, 1) for place in quad]
            deck.append(f"{number}," + ",".join(map(str, brick)))
    material = solid.material
    for name, young in (("BUSH", material.young * 1e-6), ("HUB", 2e5)):
        deck += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{young:.6e},{material.poisson}"]
        deck.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}")
    deck += ["*SURFACE, NAME=BORE", "HUB,S1", "*SURFACE, NAME=WALL, TYPE=NODE"]
    deck += [f"{node + 1}," for node in on_wall]
    deck += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    deck += [f"{PENALTY_N_MM:.3e},1e-6"]
    deck += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=NODE TO SURFACE", "WALL,BORE"]
    deck.append("*NSET, NSET=PIN")
    deck += [f"{node + 1}," for node in mesh.surface_nodes(solid.motor_wall)]
    deck += ["*BOUNDARY", "PIN,1,3", "*STEP", "*STATIC", "1.,1.", "*BOUNDARY"]
    moved = 1e3 * (rigid_motion(1e-3 * ring) @ screw).reshape(-1, 3)
    for k, shift in enumerate(moved, len(nodes) + 1):
        deck += [f"{k},{way},{way},{value:.9e}" for way, value in enumerate(shift, 1)]
    return [*deck, "*NODE PRINT, NSET=PIN", "RF", "*END STEP"]


if __name__ == "__main__":
    main()
