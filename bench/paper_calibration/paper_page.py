"""Bring the page that sets paper and model side by side up to date: its tables and pictures.

The prose of the page is written by hand; what stands between `<!-- begin NAME -->` and
`<!-- end NAME -->` is written here.

    python bench/paper_calibration/paper_page.py -o docs
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import paper_pictures as pictures
from paper_figures import (
    COLUMNS,
    PUBLISHED,
    UNITS,
    Figures,
    PaperExperiment,
)
from paper_predictions import energy_budget, predictions

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.geometry_file import load_geometry
from wrist_stiffness.shipped import shipped_file

if TYPE_CHECKING:
    from wrist_stiffness.fem.solids import MeshSettings

PAGE = "paper-and-model.md"
SHIPPED = "config/palmieri2015.yaml"
SHIPPED_TABLE = "precomputed/palmieri2015.npz"
VARIANTS = {
    "shipped": SHIPPED,
    "variant b": "config/palmieri2015_variant_b.yaml",
    "variant c": "config/palmieri2015_variant_c.yaml",
}
ROWS = (3, 4, 0, 1, 2)
STATISTICS = ("mean", "min", "max")
GRIDS = (5, 9, 13, 17, 25)


def experiment(geometry_file: str | Path, sizes: MeshSettings | None = None) -> PaperExperiment:
    """Set up the paper's experiment on a wrist, its parts condensed by solid FEM.

    Parameters
    ----------
    geometry_file : path
        Geometry file.
    sizes : MeshSettings, optional
        Element sizes where the parts must be condensed; the shipped ones if None.

    Returns
    -------
    PaperExperiment
        With the parts of the shipped table where that was made from the same values.

    Raises
    ------
    GeometryError
        If the geometry is wrong.
    """
    geometry = load_geometry(geometry_file)
    try:
        table = load_table(shipped_file(SHIPPED_TABLE))
    except WristError:
        table = None
    if table is not None and table.geometry.sha256 == geometry.sha256:
        return PaperExperiment(geometry, table.components)
    from wrist_stiffness.fem.components import SHIPPED_SIZES, elastic_components

    return PaperExperiment(geometry, elastic_components(geometry, sizes or SHIPPED_SIZES)[0])


def published_block(found: PaperExperiment) -> str:
    """Tables 1 and 2 and the two maxima: paper, 25-pose spline, 25 poses, solved wrist."""
    ways = (found.by_spline(), found.by_nodes(), found.by_closed_form())
    lines = ["paper", "25-pose spline", "poses of the 25 inside", "solved everywhere"]
    rows = []
    for column in ROWS:
        for i, statistic in enumerate(STATISTICS):
            values = [figures.operative[i, column] for figures in (PUBLISHED, *ways)]
            rows.append(
                [f"{COLUMNS[column]} {statistic} [{UNITS[column]}]", *_numbers(values, column)]
            )
    for i, column in enumerate((3, 4)):
        values = [figures.map_maximum[i] for figures in (PUBLISHED, *ways)]
        name = f"{COLUMNS[column]} whole-map max [{UNITS[column]}]"
        rows.append([name, *_numbers(values, column)])
    return _table(["figure", *lines], rows)


def load_point_block(found: PaperExperiment) -> str:
    """Report the figures with the load at O and at the plate's centre P0."""
    geometry = found.geometry
    rows = []
    for name, point in (("O", np.zeros(3)), ("P0", geometry.platform.centre)):
        figures = PaperExperiment(replace(geometry, load_point=point), found.components).by_spline()
        used = " (calibrated)" if np.allclose(point, geometry.load_point) else ""
        rows.append([name + used, *_means_and_maxima(figures)])
    return _table(["load at", *MEANS_AND_MAXIMA], [["paper", *_means_and_maxima(PUBLISHED)], *rows])


def grid_error_block(found: PaperExperiment) -> str:
    """Error of the paper's interpolation by the size of its grid, against the solved wrist."""
    workspace, poses = found.workspace, found.fine_poses()
    inside, solved = workspace.operative(poses), found.solve(poses)
    rows = []
    for per_axis in GRIDS:
        relative = np.abs(found.paper_spline(per_axis)(poses) - solved) / solved
        largest = [np.max(rows_of[:, 3:], axis=0) for rows_of in (relative[inside], relative)]
        mean = np.mean(relative[inside][:, 3:], axis=0)
        values = 100.0 * np.concatenate([mean, *largest])
        rows.append([f"{per_axis} × {per_axis}", *(f"{value:.2g} %" for value in values)])
    return _table(
        [
            "grid",
            "s mean",
            "phi mean",
            "s max",
            "phi max",
            "s max, whole map",
            "phi max, whole map",
        ],
        rows,
    )


def variants_block(experiments: Mapping[str, PaperExperiment]) -> str:
    """How well each wrist fits: the five calibrated figures, and all seventeen together."""
    rows = [["paper", *_means_and_maxima(PUBLISHED), ""]]
    for name, found in experiments.items():
        figures = found.by_spline()
        rows.append([name, *_means_and_maxima(figures), f"{misfit(figures):.2f}"])
    return _table(["wrist", *MEANS_AND_MAXIMA, "rms misfit of the other 12"], rows)


def misfit(figures: Figures) -> float:
    """Rms misfit of the 12 figures without a band, in units of the mean s or phi."""
    unit = np.where(np.arange(5) == 4, PUBLISHED.operative[0, 4], PUBLISHED.operative[0, 3])
    difference = (figures.operative - PUBLISHED.operative) / unit
    free = np.ones((3, 5), dtype=bool)
    free[0, 2:] = False
    return float(np.sqrt(np.mean(difference[free] ** 2)))


MEANS_AND_MAXIMA = ("mean s", "mean phi", "mean s_z", "map max s", "map max phi")


def _means_and_maxima(figures: Figures) -> list[str]:
    mean, most = figures.operative[0], figures.map_maximum
    columns = ((mean[3], 3), (mean[4], 4), (mean[2], 2), (most[0], 3), (most[1], 4))
    return [cell for value, column in columns for cell in _numbers([value], column)]


def _numbers(values: Sequence[float], column: int) -> list[str]:
    """Print um to two digits behind the point and mdeg to one, as the paper does."""
    return [f"{value:.{1 if UNITS[column] == 'mdeg' else 2}f}" for value in values]


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def insert_blocks(text: str, blocks: Mapping[str, str]) -> str:
    """Replace what stands between the marks of each block.

    Parameters
    ----------
    text : str
        The page.
    blocks : mapping of str to str
        Content by the name of the block.

    Returns
    -------
    str
        The page with new content.

    Raises
    ------
    InputError
        If the page lacks a block's marks.
    """
    for name, content in blocks.items():
        begin, end = f"<!-- begin {name} -->\n", f"\n<!-- end {name} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not (found and closed):
            raise InputError(f"the page has no block '{name}' ({begin.strip()} ... {end.strip()})")
        text = before + begin + content + end + after
    return text


def write_page(folder: Path) -> None:
    """Compute everything that the page shows, and write its blocks and pictures.

    Parameters
    ----------
    folder : Path
        Holds the page; the pictures go to its folder `pictures`.

    Raises
    ------
    InputError
        If the page or one of its blocks is missing.
    """
    page = folder / PAGE
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{page}: cannot be read: {error.strerror}") from error
    experiments = {name: experiment(shipped_file(path)) for name, path in VARIANTS.items()}
    shipped = experiments["shipped"]
    predicted = {name: predictions(found) for name, found in experiments.items()}
    budgets = {name: energy_budget(found) for name, found in experiments.items()}
    text = insert_blocks(
        text,
        {
            "published": published_block(shipped),
            "load point": load_point_block(shipped),
            "grid error": grid_error_block(shipped),
            "variants": variants_block(experiments),
        },
    )
    drawn = folder / "pictures"
    drawn.mkdir(exist_ok=True)
    pictures.draw_paper_map(shipped, pictures.S, drawn / "paper-figure-5.png")
    pictures.draw_paper_map(shipped, pictures.PHI, drawn / "paper-figure-6.png")
    pictures.draw_hull(shipped, drawn / "paper-figure-7.png")
    pictures.draw_spline_error(shipped, drawn / "paper-grid-error.png")
    pictures.draw_variants(predicted, budgets, drawn / "paper-variants.png")
    with replacing(page) as written:
        written.write_text(text, encoding="utf-8")


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Bring docs/paper-and-model.md up to date.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the page")
    try:
        write_page(parser.parse_args().output)
    except WristError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
