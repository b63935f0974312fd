"""Verify a lookup table: undamaged, definite, as good as stated, and reproducible."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.lookup.operators import column_sizes
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.lookup.verification import COVERED, HALVES, spline_misses, unseen_poses
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.geometry_file import load_geometry
from wrist_stiffness.progress import Progress, silent

STATED_ROUNDING = 1e-7
"""Rounding of an interpolation error: 1e-16 times the condition number of the spline's system."""

REBUILT_TOLERANCE = 1e-6
"""Relative difference of a rebuilt table that counts as the same: other BLAS, same mesh."""


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
) -> list[Finding]:
    """Verify a table: all checks; the table is good if all passed.

    `geometry`: file that the table must be of; `rebuild`: also condense the parts and sweep again,
    and compare all numbers.  Raises `TableError` or `GeometryError` if a file cannot be read at
    all.
    """
    table = load_table(path)
    findings = [Finding("file", f"complete, checksum {table.checksum[:12]}", True)]
    if geometry is not None:
        wanted = load_geometry(geometry).sha256
        same = wanted == table.geometry.sha256
        findings.append(
            Finding(
                "geometry",
                f"made for {table.geometry.sha256[:12]}, {geometry} is {wanted[:12]}",
                same,
            )
        )
    findings.append(_definiteness(table))
    misses, operative = spline_misses(table, np.random.default_rng())
    for region, rows in (("operative", misses[operative]), ("domain", misses)):
        for column, name in enumerate(HALVES):
            stated = table.header.errors["predicted"][region][name]
            covered = float(np.mean(rows[:, column] <= stated + STATED_ROUNDING))
            findings.append(
                Finding(
                    f"spline {name} {region}",
                    f"within the stated {100 * stated:.3f} % at {100 * covered:.0f} % of fresh "
                    f"poses and loads (at least {100 * COVERED:.0f} %)",
                    covered >= COVERED,
                )
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
            findings.append(
                Finding(
                    f"rebuilt {name}",
                    f"differs by {difference:.1e} of its size (limit {REBUILT_TOLERANCE:.0e})",
                    bool(difference <= REBUILT_TOLERANCE),
                )
            )
    return findings


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
