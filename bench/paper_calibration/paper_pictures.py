"""Pictures of the page that sets paper and model side by side.  Each writes one PNG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from paper_figures import PUBLISHED, UNITS, PaperExperiment
from scipy.spatial import ConvexHull

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.pictures.figure import new_figure, save_figure

S, PHI = 3, 4
NAMES = {S: "shift s", PHI: "rotation phi"}
INSIDE_LEVELS = {
    S: (6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 30.0, 50.0),
    PHI: (5, 10, 15, 20, 30, 40, 50),
}
"""Lines of equal error: the colours alone, fixed by the border, would hide the inside."""

BANDS = {S: np.arange(0.0, 80.0, 5.0), PHI: np.arange(0.0, 65.0, 5.0)}


def draw_paper_map(experiment: PaperExperiment, column: int, path: Path) -> None:
    """Draw the paper's Fig. 5 or 6: the 25-pose spline, and beside it the solved wrist.

    Parameters
    ----------
    experiment : PaperExperiment
        The wrist.
    column : int
        `S` or `PHI`.
    path : Path
        PNG to write.
    """
    axes, poses = _grid(experiment)
    spline, solved = experiment.paper_spline()(poses), _solved(experiment, poses)
    figure = new_figure(10.4, 5.0)
    for plot, values, title in zip(
        figure.subplots(1, 2, sharey=True),
        (spline, solved),
        ("biharmonic spline through 25 poses (the paper's way)", "the wrist solved at every pose"),
        strict=True,
    ):
        filled = plot.contourf(
            *axes, values[..., column].T, levels=BANDS[column], cmap="viridis", extend="max"
        )
        lines = plot.contour(
            *axes,
            values[..., column].T,
            levels=INSIDE_LEVELS[column],
            colors="white",
            linewidths=0.6,
        )
        plot.clabel(lines, fontsize=7, fmt="%g")
        _frame(plot, experiment, title)
    figure.colorbar(filled, ax=figure.axes, label=f"{NAMES[column]} [{UNITS[column]}]")
    save_figure(figure, path)


def draw_spline_error(experiment: PaperExperiment, path: Path) -> None:
    """Draw how far the 25-pose spline is off the solved wrist, in percent of the local value.

    Parameters
    ----------
    experiment : PaperExperiment
        The wrist.
    path : Path
        PNG to write.
    """
    axes, poses = _grid(experiment)
    solved = _solved(experiment, poses)
    percent = 100.0 * (experiment.paper_spline()(poses) - solved) / solved
    figure = new_figure(10.4, 5.0)
    for plot, column in zip(figure.subplots(1, 2, sharey=True), (S, PHI), strict=True):
        filled = plot.pcolormesh(
            *axes, percent[..., column].T, vmin=-30.0, vmax=30.0, cmap="RdBu_r", shading="gouraud"
        )
        lines = plot.contour(
            *axes,
            percent[..., column].T,
            levels=(-20, -10, -5, 5, 10, 20),
            colors="black",
            linewidths=0.5,
        )
        plot.clabel(lines, fontsize=7, fmt="%g")
        _frame(plot, experiment, f"{NAMES[column]}: spline minus solved")
    figure.colorbar(filled, ax=figure.axes, label="percent of the local value", extend="both")
    save_figure(figure, path)


def draw_hull(experiment: PaperExperiment, path: Path) -> None:
    """Draw the paper's Fig. 7: convex hull of the platform centre's positions.

    The box is the one that the paper's Table 2 spans.

    Parameters
    ----------
    experiment : PaperExperiment
        The wrist.
    path : Path
        PNG to write.
    """
    workspace = experiment.workspace
    fine, nodes = experiment.fine_poses(), experiment.nodes()
    cloud, analysed = (
        experiment.solve(poses[workspace.operative(poses)])[:, :3] for poses in (fine, nodes)
    )
    figure = new_figure(10.4, 5.0)
    for place, (points, title) in enumerate(
        ((analysed, "the poses of the 25 inside the border"), (cloud, "all poses inside"))
    ):
        plot = figure.add_subplot(1, 2, place + 1, projection="3d")
        plot.plot_trisurf(
            *points[:, :2].T,
            points[:, 2],
            triangles=ConvexHull(points).simplices,
            color=(0.1, 0.4, 0.8, 0.25),
            edgecolor=(0.1, 0.1, 0.1, 0.3),
            linewidth=0.2,
        )
        plot.scatter(*points.T, s=1 if len(points) > 100 else 18, color="tab:blue")
        plot.scatter(0.0, 0.0, 0.0, marker="+", s=60, color="black")
        for start, end in _box_edges(PUBLISHED.operative[1:, :3]):
            plot.plot(*np.stack([start, end], axis=1), color="tab:red", linewidth=0.8)
        plot.set_xlabel("$s_x$ [µm]")
        plot.set_ylabel("$s_y$ [µm]")
        plot.set_zlabel("$s_z$ [µm]")
        plot.set_title(title, fontsize=9)
        plot.set_box_aspect((1.0, 1.0, 1.2), zoom=0.95)
    save_figure(figure, path)


def draw_variants(
    predicted: Mapping[str, Mapping[str, tuple[float, float]]],
    budgets: Mapping[str, Mapping[str, float]],
    path: Path,
) -> None:
    """Draw where wrists that fit equally well part: relative predictions and energy shares.

    Parameters
    ----------
    predicted : mapping
        Mean s and phi by load, by wrist; the first wrist is the unit.
    budgets : mapping
        Energy share of each component, by wrist.
    path : Path
        PNG to write.
    """
    wrists = list(predicted)
    loads, parts = list(predicted[wrists[0]]), list(budgets[wrists[0]])
    figure = new_figure(11.0, 6.6)
    shifts, turns, shares = figure.subplots(1, 3)
    height = 0.8 / len(wrists)
    for i, wrist in enumerate(wrists):
        for plot, column in ((shifts, 0), (turns, 1)):
            ratio = [
                predicted[wrist][load][column] / predicted[wrists[0]][load][column]
                for load in loads
            ]
            plot.barh(np.arange(len(loads)) + i * height, ratio, height, label=wrist)
        shares.barh(
            np.arange(len(parts)) + i * height, [100.0 * budgets[wrist][p] for p in parts], height
        )
    for plot, labels, title in (
        (shifts, loads, f"mean s / that of {wrists[0]}"),
        (turns, loads, f"mean phi / that of {wrists[0]}"),
        (shares, parts, "share of strain energy [%]"),
    ):
        plot.set_yticks(np.arange(len(labels)) + height, labels, fontsize=8)
        plot.invert_yaxis()
        plot.set_title(title, fontsize=9)
    turns.set_yticklabels([])
    shifts.legend(fontsize=7)
    save_figure(figure, path)


def _grid(experiment: PaperExperiment) -> tuple[list[Array], Array]:
    """Axes in degrees, and the poses of the whole rectangle (n, n, 2) [rad]."""
    lower, upper = experiment.workspace.rectangle
    axes = [np.linspace(lower[i], upper[i], 81) for i in range(2)]
    poses = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return [np.degrees(axis) for axis in axes], poses


def _solved(experiment: PaperExperiment, poses: Array) -> Array:
    """Solve the wrist where the map domain allows it; NaN elsewhere, (..., 5)."""
    values = np.full((*poses.shape[:-1], 5), np.nan)
    inside = experiment.workspace.domain(poses)
    values[inside] = experiment.solve(poses[inside])
    return values


def _frame(plot: Any, experiment: PaperExperiment, title: str) -> None:
    plot.plot(*np.degrees(experiment.workspace.operative_border).T, color="black", linewidth=1.8)
    plot.plot(*np.degrees(experiment.nodes()).T, ".", color="black", markersize=5)
    plot.set_xlabel("motor 1 angle θ₁ [deg]")
    plot.set_ylabel("motor 2 angle θ₂ [deg]")
    plot.set_aspect("equal")
    plot.set_title(title, fontsize=9)


def _box_edges(corners: Array) -> list[tuple[Array, Array]]:
    """Return the 12 edges of the box between two corners (2, 3)."""
    index = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    points = corners[index, np.arange(3)]
    return [
        (points[i], points[j])
        for i in range(8)
        for j in range(i)
        if np.abs(index[i] - index[j]).sum() == 1
    ]
