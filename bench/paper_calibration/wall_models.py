"""How the wall of a bushing is held: judged, refined, and lifted off, on the shipped wrist.

    python bench/paper_calibration/wall_models.py judge | mesh | rings | patches | lifting
        | pressure

Each word writes one block or picture of docs/walls.md; none does all; `patches` only prints.
`judge` needs CalculiX (Debian package calculix-ccx).  Minutes each.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
from paper_page import insert_blocks

from wrist_stiffness.fem import parts, revolve
from wrist_stiffness.fem.components import SHIPPED_SIZES, elastic_components
from wrist_stiffness.fem.condensed_store import condense_solid
from wrist_stiffness.fem.one_sided import PatchedBushing, PatchedWrist, patch_bushing, solve_patches
from wrist_stiffness.fem.parts import assemble_body, wrist_parts
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.lookup.response import rated_map, rated_wrench, respond
from wrist_stiffness.lookup.verification import random_loads, relative_misses
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import load_geometry, mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

sys.path.append(str(Path(__file__).parents[1]))

from whole_wrist.calculix import run_deck, write_deck
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import Disturbance, solve_pose

GEOMETRY = "config/palmieri2015.yaml"
CONDENSE = cache(condense_solid)
HALVES = (slice(0, 3), slice(3, 6))
PATCHED = 1.5
"""Element sizes of the wrists in patches, over the shipped ones."""

UM, MDEG = 1e6, 1e3 * 180.0 / np.pi


def main() -> None:
    """Compute what is asked for and write it into the page."""
    stages: dict[str, Callable[[Geometry], str]] = {
        "judge": judge,
        "mesh": mesh,
        "rings": rings,
        "patches": patches,
        "lifting": lifting,
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stage", nargs="*", choices=[*stages, "pressure", []])
    parser.add_argument("-o", "--output", default="docs", help="folder of the page")
    arguments = parser.parse_args()
    folder, geometry = Path(arguments.output), load_geometry(GEOMETRY)
    for stage in arguments.stage or [*stages, "pressure"]:
        if stage == "pressure":
            draw_pressure(geometry, folder / "pictures" / "wall-pressure.png")
            continue
        block = stages[stage](geometry)
        print(block, flush=True)
        if stage == "patches":
            continue
        page = folder / "walls.md"
        page.write_text(insert_blocks(page.read_text(), {stage: block}))


def poses(geometry: Geometry, count: int, seed: int) -> Array:
    """Return random poses of the operative workspace (n, 2) [rad]."""
    workspace = Workspace(mechanism_of(geometry), geometry.limits)
    lower, upper = workspace.rectangle
    drawn = np.random.default_rng(seed).uniform(lower, upper, (20 * count, 2))
    return drawn[workspace.operative(drawn)][:count]


def judge(geometry: Geometry) -> str:
    """Condensed, solved whole and by CalculiX: the same mesh, 20 random poses and loads."""
    sizes, mechanism = SHIPPED_SIZES.times(5.0), mechanism_of(geometry)
    rng = np.random.default_rng(20)
    limits = (geometry.limits.force, geometry.limits.moment)
    rows = []
    for interface in ("sliding", "rigid"):
        components, made = elastic_components(geometry, sizes, interface)
        wrist = build_wrist(geometry, sizes, interface == "sliding")
        whole, calculix, touching = [], [], 0
        for theta in poses(geometry, 20, 11):
            pose = mechanism.forward(theta)
            load = rng.normal(size=6)
            for half, most in zip(HALVES, limits, strict=True):
                load[half] *= rng.uniform(0.1, 1.0) * most / np.linalg.norm(load[half])
            operators = contact_operators(pose, components, geometry.gravity)
            condensed = respond(operators, load).twist
            model = factor_pose(wrist, pose)
            solution = solve_pose(model, load, Disturbance(gravity=geometry.gravity))
            closed = solution.forces > 0.0
            touching += int(closed.any())
            with tempfile.TemporaryDirectory() as folder:
                deck = Path(folder) / "pose.inp"
                write_deck(model, deck, load, geometry.gravity, closed)
                by_calculix = run_deck(deck)
            whole.append(difference(condensed, solution.twist))
            calculix.append(difference(condensed, by_calculix))
            print(interface, theta, f"{whole[-1]:.1e} {calculix[-1]:.1e}", flush=True)
        rows.append(
            f"| `{interface}` | {sum(made.elements.values())} | {touching} | "
            f"{np.max(whole):.1e} | {np.max(calculix):.1e} |"
        )
    head = "| wall | elements | poses with contact | against the whole wrist | against CalculiX |"
    return "\n".join([head, "| --- | --- | --- | --- | --- |", *rows])


def difference(twist: Array, other: Array) -> float:
    """Largest relative difference of two twists, shift and rotation apart."""
    return max(float(np.linalg.norm((twist - other)[h]) / np.linalg.norm(other[h])) for h in HALVES)


def mesh(geometry: Geometry) -> str:
    """Mean s and phi of the rated load for each wall on a sequence of meshes."""
    configuration = mechanism_of(geometry).forward(poses(geometry, 100, 12))
    rows = []
    for interface in ("rigid", "sliding"):
        values = []
        for factor in (2.25, 1.5, 1.0, 0.64):
            components, _ = elastic_components(geometry, SHIPPED_SIZES.times(factor), interface)
            operators = contact_operators(configuration, components, np.zeros(3))
            values.append(rated_map(configuration, operators, geometry)[:, 3:].mean(axis=0))
        for k, name in enumerate(("s [µm]", "phi [mdeg]")):
            column = np.array(values)[:, k] * (UM, MDEG)[k]
            cells = " | ".join(f"{value:.{3 - k}f}" for value in column)
            more = 100 * (column[-1] / column[-2] - 1)
            rows.append(f"| `{interface}` | {name} | {cells} | {more:+.2f} % |")
    head = "| wall | mean | 2.25 × | 1.5 × | shipped sizes | 0.64 × | last step |"
    return "\n".join([head, "| --- | --- | --- | --- | --- | --- | --- |", *rows])


def rings(geometry: Geometry) -> str:
    """Contact modes over the width of the flanges and around: what 8 rings of 16 change."""
    thetas, rng = poses(geometry, 400, 14), np.random.default_rng(14)
    loads = random_loads(geometry.limits, len(thetas), rng)
    configuration = mechanism_of(geometry).forward(thetas)

    def twist(across: int, around: int) -> Array:
        # The number around is no option of a table.
        revolve.SECTORS = parts.SECTORS = around
        components, _ = elastic_components(geometry, SHIPPED_SIZES.times(PATCHED), rings=across)
        operators = contact_operators(configuration, components, geometry.gravity)
        return respond(operators, loads).twist

    finest, rows = twist(8, 16), []
    for across, around in ((1, 8), (1, 4), (2, 4), (2, 8), (4, 4), (4, 8), (8, 4)):
        misses = 100 * relative_misses(twist(across, around), finest)
        cells = " | ".join(
            f"{half.mean():.2f} / {np.quantile(half, 0.99):.2f} %" for half in misses.T
        )
        rows.append(f"| {around} × {across} | {cells} |")
        print(rows[-1], flush=True)
    head = "| around × over the width | s: mean / 99 of 100 | phi: mean / 99 of 100 |"
    return "\n".join([head, "| --- | --- | --- |", *rows])


def patched(
    geometry: Geometry, sizes: MeshSettings, wall_rings: int, flange_rings: int
) -> PatchedWrist:
    """Return the wrist with its bushings cut into patches."""
    parts = wrist_parts(geometry, flange_rings)
    components, _ = elastic_components(geometry, sizes, "sliding", condenser=CONDENSE)
    bushings = {
        part.name: patch_bushing(assemble_body(part.solid, sizes), wall_rings)
        for part in parts
        if part.solid.is_bushing
    }
    return PatchedWrist(geometry, parts, components, bushings)


def rated(wrist: PatchedWrist, thetas: Array, clearance: float = 0.0, lifts: bool = True) -> Array:
    """Mean |s| [um] and phi [mdeg] of the rated load, walls in patches."""
    mechanism = mechanism_of(wrist.geometry)
    sizes = []
    for theta in thetas:
        pose = mechanism.forward(theta)
        load = rated_wrench(pose, wrist.geometry)
        twist = solve_patches(wrist, pose, load, clearance, lifts).twist
        sizes.append([np.linalg.norm(twist[half]) for half in HALVES])
    return np.mean(sizes, axis=0) * [UM, MDEG]


def patches(geometry: Geometry) -> str:
    """Patches along the wall, over the flange and around: what each step changes."""
    thetas, rows = poses(geometry, 6, 13), []
    coarse = asdict(SHIPPED_SIZES.times(PATCHED))
    for arc, wall, flange in (
        (1.0, 2, 1), (1.0, 4, 1), (1.0, 8, 1), (1.0, 16, 1), (1.0, 4, 2), (1.0, 4, 4), (0.5, 4, 1)
    ):  # fmt: skip
        sizes = MeshSettings(**{**coarse, "bushing_arc": arc * coarse["bushing_arc"]})
        wrist = patched(geometry, sizes, wall, flange)
        around = [len(np.unique(b.angle.round(9))) for b in wrist.bushings.values()]
        two, one = rated(wrist, thetas, lifts=False), rated(wrist, thetas)
        rows.append(
            f"| {min(around)}–{max(around)} | {wall} | {flange} | {two[0]:.2f} / {two[1]:.2f} | "
            f"{one[0]:.2f} / {one[1]:.2f} | {one[0] / two[0]:.3f} |"
        )
        print(rows[-1], flush=True)
    components, _ = elastic_components(
        geometry, SHIPPED_SIZES.times(PATCHED), "sliding", condenser=CONDENSE
    )
    configuration = mechanism_of(geometry).forward(thetas)
    operators = contact_operators(configuration, components, np.zeros(3))
    nodal = rated_map(configuration, operators, geometry)[:, 3:].mean(axis=0) * [UM, MDEG]
    rows.append(f"| every node | | 1 | {nodal[0]:.2f} / {nodal[1]:.2f} | | |")
    head = "| around | along the wall | over the flange | two-sided s / phi | one-sided | ratio |"
    return "\n".join([head, "| --- | --- | --- | --- | --- | --- |", *rows])


def lifting(geometry: Geometry) -> str:
    """Compare a table's two-sided walls with those that lift off, with and without clearance."""
    wrist, thetas = patched(geometry, SHIPPED_SIZES.times(PATCHED), 8, 2), poses(geometry, 24, 14)
    rows = []
    two = rated(wrist, thetas, lifts=False)
    rows.append(f"| two-sided (`sliding`) | {two[0]:.1f} | {two[1]:.1f} | 1 |")
    for clearance in (0.0, 1e-6, 5e-6, 20e-6):
        one = rated(wrist, thetas, clearance)
        name = f"lifts off, clearance {UM * clearance:g} µm"
        rows.append(f"| {name} | {one[0]:.1f} | {one[1]:.1f} | {one[0] / two[0]:.2f} |")
    head = "| wall | mean s [µm] | mean phi [mdeg] | s over two-sided |"
    return "\n".join([head, "| --- | --- | --- | --- |", *rows])


def draw_pressure(geometry: Geometry, path: Path) -> None:
    """Pressure on the wall of joint_2's bushing at home under the rated load, unrolled."""
    from wrist_stiffness.report.pictures.figure import new_figure, save_figure

    joint = "joint_2"
    wrist = patched(geometry, SHIPPED_SIZES.times(1.0), 12, 2)
    pose = mechanism_of(geometry).forward(np.zeros(2))
    load = rated_wrench(pose, geometry)
    figure = new_figure(13.0, 4.2)
    cases = {
        "two-sided: pulls on one side": solve_patches(wrist, pose, load, lifts=False),
        "lifts off, no clearance": solve_patches(wrist, pose, load),
        "lifts off, clearance 2 µm": solve_patches(wrist, pose, load, 2e-6),
    }
    bushing = wrist.bushings[joint]
    on_wall = bushing.surface == "wall"
    fields = {
        name: 1e-6 * solved.forces[joint][on_wall] / bushing.area[on_wall]
        for name, solved in cases.items()
    }
    for axes, (name, field) in zip(
        figure.subplots(1, len(cases), sharey=True), fields.items(), strict=True
    ):
        drawn = draw_patches(axes, bushing, on_wall, field)
        figure.colorbar(drawn, ax=axes, label="pressure [MPa]")
        axes.set_title(f"{name}\n{field.min():.2f} to {field.max():.2f} MPa", fontsize=10)
        axes.set_xlabel("around the pin [deg]")
    figure.axes[0].set_ylabel("along the bushing [mm]")
    save_figure(figure, path)


def draw_patches(axes, bushing: PatchedBushing, which: Array, field: Array):  # type: ignore[no-untyped-def]
    """Draw a pressure over the patches of a wall, one cell each, coloured by its square root.

    Its ends are singular; on an even scale they would hide the rest.
    """
    from matplotlib.colors import FuncNorm

    most, pulls = np.abs(field).max(), field.min() < 0.0
    roots = FuncNorm(
        (lambda p: np.sign(p) * np.sqrt(np.abs(p)), lambda r: r * np.abs(r)),
        vmin=-most if pulls else 0.0,
        vmax=most,
    )
    angles = np.unique(bushing.angle[which].round(9))
    heights = bushing.height[which].reshape(len(angles), -1)[0]
    order = np.argsort(heights)
    radius = bushing.area[which].sum() / (2.0 * np.pi * np.ptp(heights))
    widths = bushing.area[which][: len(heights)][order] * len(angles) / (2.0 * np.pi * radius)
    edges = np.concatenate([[0.0], np.cumsum(widths)])
    edges += heights[order][0] - widths[0] / 2.0
    turn = angles[1] - angles[0]
    around = np.degrees(np.concatenate([angles - turn / 2.0, angles[-1:] + turn / 2.0]))
    cells = field.reshape(len(angles), -1)[:, order].T
    return axes.pcolormesh(
        around, 1e3 * edges, cells, cmap="RdBu_r" if pulls else "Reds", norm=roots
    )


if __name__ == "__main__":
    main()
