"""Build, verify and show a lookup table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wrist_stiffness.commands.uncertainty import with_second_order
from wrist_stiffness.errors import GeometryError, InputError
from wrist_stiffness.inputs.document import read_yaml
from wrist_stiffness.lookup.operators import column_sizes
from wrist_stiffness.lookup.table import MAP_COLUMNS, Evaluation, Table
from wrist_stiffness.lookup.table_file import load_table, save_table
from wrist_stiffness.lookup.verification import COVERED, HALVES, spline_misses, unseen_poses
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.fits import check_fits
from wrist_stiffness.mechanism.geometry_file import geometry_of, load_geometry
from wrist_stiffness.mechanism.own_stiffness import in_millimetres
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

if TYPE_CHECKING:
    from wrist_stiffness.fem.step_part import StepPart

MIN_PER_AXIS, MAX_PER_AXIS = 3, 61
"""The corners alone carry no plane to be judged inside; the splines' matrices grow with n^4."""

FINE = 161
"""Points along each motor angle where the rated load's map is summarised and drawn."""

STATED_ROUNDING = 1e-7
"""Rounding of an interpolation error: 1e-16 times the condition number of the spline's system."""

REBUILT_TOLERANCE = 1e-6
"""Relative difference of a rebuilt table that counts as the same: other BLAS, same mesh."""


def build(
    geometry: str | Path,
    output: str | Path,
    evaluation: Evaluation = "closed_form",
    interface: str = "rigid",
    tolerance: float = 0.02,
    per_axis: int | None = None,
    progress: Progress = silent,
) -> Table:
    """Run the offline sweep and write its table; an interrupted build goes on where it was.

    Condensed parts are kept beside the table until it is written.

    `output`: table file, `.npz`; `evaluation`: what the nodes shall use, `closed_form` or `spline`;
    `interface`: `rigid`, `distributing` or `sliding` walls; `tolerance`: relative error of s and
    phi that mesh, contact rings and grid are refined to; `per_axis`: fixed grid, 5 for the paper's
    25 poses; None refines it too; `progress`: called with steps done and in all.  Raises
    `WristError` if the geometry is wrong, the tolerance is not met or the file cannot be written;
    `KeyboardInterrupt` that says what is kept.
    """
    from wrist_stiffness.fem.condensed_store import CondensedStore
    from wrist_stiffness.fem.sweep import BuildSettings, build_table

    output = Path(output)
    if output.suffix != ".npz":
        raise InputError(f"{output}: a table's name ends in .npz")
    if not output.parent.is_dir():
        raise InputError(f"{output.parent}: no such folder")
    if not tolerance > 0.0:
        raise InputError(f"tolerance {tolerance:g} is not above 0")
    if per_axis is not None and not MIN_PER_AXIS <= per_axis <= MAX_PER_AXIS:
        raise InputError(
            f"a grid of {per_axis} x {per_axis} is outside {MIN_PER_AXIS} x {MIN_PER_AXIS} "
            f"to {MAX_PER_AXIS} x {MAX_PER_AXIS}"
        )
    root = read_yaml(geometry, GeometryError)
    check_fits(root, geometry_of(root))
    settings = BuildSettings(
        evaluation=evaluation,
        interface=interface,  # type: ignore[arg-type]
        tolerance=tolerance,
        per_axis=per_axis,
    )
    store = CondensedStore(output.with_name(f".{output.stem}.parts"))
    try:
        table = with_second_order(build_table(root.plain, settings, progress, store))
        beside = table.header.errors["second_order_relative"]
        if 0.0 < table.header.errors["stated_relative"] - tolerance < beside < tolerance:
            # What finite elements and contact were refined to leaves no room for it.
            settings = replace(settings, tolerance=tolerance - beside)
            table = with_second_order(build_table(root.plain, settings, progress, store))
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(
            f"stopped; condensed parts kept: {store.kept()}; the same command goes on from there"
        ) from stop
    table = save_table(table, output)
    store.remove()
    return table


def part(step: str | Path, geometry: str | Path, link: str) -> StepPart:
    """Condense a link drawn in CAD, its stiffness in the units of a geometry file [N, mm].

    `step`: STEP file, see `fem/step_part.py`.  Raises `GeometryError` if a file is wrong.
    """
    from wrist_stiffness.fem.components import SHIPPED_SIZES
    from wrist_stiffness.fem.step_part import step_part

    found = step_part(Path(step), load_geometry(geometry), link, SHIPPED_SIZES)
    return replace(found, stiffness=in_millimetres(found.stiffness))


def summarise(table: Table) -> dict[str, dict[str, Any]]:
    """Return the statistics of Tables 1 and 2 for a table, on a fine grid over the map.

    Gives as `operative` mean, min and max over the operative workspace, as `domain_max` the maxima
    over the whole map, both by quantity with its unit.
    """
    workspace = table.workspace
    poses = workspace.grid(FINE)
    values = table.map_spline(poses) * np.array([MICROMETRES] * 4 + [MILLIDEGREES])
    inside = values[workspace.operative(poses)]
    names = [f"{name}_um" for name in MAP_COLUMNS[:4]] + ["phi_mdeg"]
    operative = {
        name: {"mean": float(column.mean()), "min": float(column.min()), "max": float(column.max())}
        for name, column in zip(names, inside.T, strict=True)
    }
    domain = {name: float(column.max()) for name, column in zip(names, values.T, strict=True)}
    return {"operative": operative, "domain_max": domain}


@dataclass(frozen=True)
class Finding:
    """One thing that a check looked at."""

    # `name`, `text`: what was checked and what was found, with the limit
    name: str
    text: str
    passed: bool


def check(
    path: str | Path,
    geometry: str | Path | None = None,
    rebuild: bool = False,
    progress: Progress = silent,
) -> Iterator[Finding]:
    """Verify a table and give all checks; the table is good if all passed.

    `geometry`: file that the table must be of; `rebuild`: also condense the parts and sweep again,
    and compare all numbers.  Raises `TableError` or `GeometryError` if a file cannot be read at
    all.
    """
    table = load_table(path)
    yield Finding("file", f"complete, checksum {table.checksum[:12]}", True)
    if geometry is not None:
        wanted = load_geometry(geometry).sha256
        text = f"made for {table.geometry.sha256[:12]}, {geometry} is {wanted[:12]}"
        yield Finding("geometry", text, wanted == table.geometry.sha256)
    yield _definiteness(table)
    misses, operative = spline_misses(table, np.random.default_rng())
    for region, rows in (("operative", misses[operative]), ("domain", misses)):
        for column, name in enumerate(HALVES):
            stated = table.header.errors["predicted"][region][name]
            covered = float(np.mean(rows[:, column] <= stated + STATED_ROUNDING))
            yield Finding(
                f"spline {name} {region}",
                f"within the stated {100 * stated:.3f} % at {100 * covered:.0f} % of fresh "
                f"poses and loads (at least {100 * COVERED:.0f} %)",
                covered >= COVERED,
            )
    if rebuild:
        # Only this needs the mesher.
        from wrist_stiffness.fem.solids import MeshSettings
        from wrist_stiffness.fem.sweep import BuildSettings, build_table

        header = table.header
        sizes = MeshSettings(**{key: 1e-3 * v for key, v in header.mesh["sizes_mm"].items()})
        settings = BuildSettings(
            sizes=sizes,
            interface=header.interface,  # type: ignore[arg-type]
            evaluation=header.evaluation,
            rings=header.mesh["rings"],
            tolerance=np.inf,
            per_axis=header.per_axis,
        )
        again = build_table(header.geometry, settings, progress)
        sectors = len(table.components.sectors.gap)
        for name, sizes_of in (
            ("operators", lambda values: column_sizes(values, sectors)),
            ("map_values", lambda values: np.max(np.abs(values), axis=0)),
        ):
            old, new = getattr(table, name), getattr(again, name)
            same_shape = old.shape == new.shape
            difference = np.max(np.abs(old - new) / sizes_of(old)) if same_shape else np.inf
            yield Finding(
                f"rebuilt {name}",
                f"differs by {difference:.1e} of its size (limit {REBUILT_TOLERANCE:.0e})",
                bool(difference <= REBUILT_TOLERANCE),
            )


def _definiteness(table: Table) -> Finding:
    configuration = table.mechanism.forward(unseen_poses(table.workspace))
    lowest = min(
        float(
            np.min(np.linalg.eigvalsh(_scaled(table.operators_at(configuration, way).compliance)))
        )
        for way in ("closed_form", "spline")
    )
    return Finding(
        "compliance", f"smallest scaled eigenvalue {lowest:.1e}, must be > 0", lowest > 0
    )


def _scaled(matrix: Array) -> Array:
    """Scale a compliance to a unit diagonal, so that metres and radians weigh the same."""
    size = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))
    scaled: Array = matrix / size[..., :, None] / size[..., None, :]
    return scaled
