"""What condensation buys: cost of a pose, condensed against solved whole, in one run.

    python bench/fem_speed.py [GEOMETRY] [--coarser 2] [--whole-poses 3]

Prints a table.  The condensed model and the whole wrist share one mesh; both solve the rated load
with flange contact.  CalculiX solves the same pose with the active set given, if it is installed.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from whole_wrist.calculix import run_deck, write_deck
from whole_wrist.model import build_wrist, factor_pose
from whole_wrist.solve import solve_pose

from wrist_stiffness.fem.components import SHIPPED_SIZES, elastic_components
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.lookup.response import rated_wrench, respond
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.mechanism.geometry_file import load_geometry, mechanism_of
from wrist_stiffness.mechanism.kinematics import Mechanism
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

BATCHES = (10, 100, 1000, 10000)
REPEATS = 3


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("geometry", nargs="?", default="config/palmieri2015.yaml")
    parser.add_argument("--coarser", type=float, default=2.0, help="times the shipped sizes")
    parser.add_argument("--whole-poses", type=int, default=3, help="poses solved whole")
    arguments = parser.parse_args()

    geometry = load_geometry(arguments.geometry)
    mechanism = mechanism_of(geometry)
    workspace = Workspace(mechanism, geometry.limits)
    print(f"{geometry.name}, {os.cpu_count()} cores, times are of the wall clock")

    start, cpu_start = time.perf_counter(), time.process_time()
    _, shipped = elastic_components(geometry)
    shipped_s, cpu_s = time.perf_counter() - start, time.process_time() - cpu_start
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    count = sum(shipped.elements.values())
    cost = f"{shipped_s:.1f} s ({cpu_s:.1f} s of processors), {peak_gb:.2f} GB"
    row("condensation, shipped mesh", f"{cost}, {count} elements")

    scaled = {name: arguments.coarser * size for name, size in asdict(SHIPPED_SIZES).items()}
    sizes = MeshSettings(**scaled)
    start = time.perf_counter()
    components, provenance = elastic_components(geometry, sizes)
    coarser_s = time.perf_counter() - start
    count = sum(provenance.elements.values())
    row(
        f"condensation, {arguments.coarser:g} x coarser",
        f"{coarser_s:.1f} s, {count} elements",
    )

    rng = np.random.default_rng(1)
    lower, upper = workspace.rectangle
    poses = rng.uniform(lower, upper, (20 * BATCHES[-1], 2))
    poses = poses[workspace.operative(poses)][: BATCHES[-1]]
    condensed_s = 0.0
    for batch in BATCHES:
        condensed_s = min(
            condensed_pose(mechanism, components, geometry, poses[:batch]) for _ in range(REPEATS)
        )
        row(f"condensed, batch of {batch}", f"{1e6 * condensed_s:9.1f} us a pose")

    wrist = build_wrist(geometry, sizes)
    whole, calculix = [], []
    for theta in poses[: arguments.whole_poses]:
        pose = mechanism.forward(theta)
        load = rated_wrench(pose, geometry)
        start = time.perf_counter()
        model = factor_pose(wrist, pose)
        solution = solve_pose(model, load)
        whole.append(time.perf_counter() - start)
        if shutil.which("ccx"):
            with tempfile.TemporaryDirectory() as folder:
                deck = Path(folder) / "pose.inp"
                start = time.perf_counter()
                write_deck(model, deck, load, np.zeros(3), solution.forces > 0.0)
                run_deck(deck)
                calculix.append(time.perf_counter() - start)
    compare("whole wrist, same mesh", whole, condensed_s)
    if calculix:
        compare("CalculiX, same mesh", calculix, condensed_s)
    else:
        row("CalculiX", "not installed (Debian package calculix-ccx)")


def condensed_pose(
    mechanism: Mechanism, components: ElasticComponents, geometry: Geometry, poses: Array
) -> float:
    """Measure the seconds a pose costs from motor angles to platform twist, contact solved."""
    start = time.perf_counter()
    configuration = mechanism.forward(poses)
    operators = contact_operators(configuration, components, np.zeros(3))
    respond(operators, rated_wrench(configuration, geometry))
    return (time.perf_counter() - start) / len(poses)


def compare(name: str, seconds: list[float], condensed_s: float) -> None:
    """Print the median cost of a pose and its ratio to the condensed one."""
    median = float(np.median(seconds))
    row(name, f"{1e6 * median:9.0f} us a pose, {median / condensed_s:,.0f} x the condensed cost")


def row(name: str, value: str) -> None:
    """Print one line of the table."""
    print(f"{name:32s} {value}", flush=True)


if __name__ == "__main__":
    main()
