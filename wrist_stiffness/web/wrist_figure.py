"""The wrist in three dimensions at one moment, bent under its load."""

from __future__ import annotations

from typing import Any

import numpy as np

from wrist_stiffness.commands.budget import Push, load_alone
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.report.pictures.bent_wrist import Shape, bent_shapes, raised, round_down
from wrist_stiffness.web.figures import MAP, RED, Figure

MM = 1e3
SEEN_M, LEAST_M = 0.008, 1e-6
"""How far the largest displacement is drawn where nobody says otherwise, if it is not less."""

BENT, MEASURED = "platform under the load", "platform measured"
EYE = np.array([1.0, 0.75, 0.85])
REMOVED = ("zoom3d", "pan3d", "orbitRotation", "tableRotation", "resetCameraLastSave3d")
"""Buttons of what the mouse does without them."""

LEADER_PX = 18.0
"""Of the line from a part to its name."""

NAME_PX, VIEW_PX = (90.0, 16.0), 220.0
"""Width and height of a name, and of the wrist on a small screen."""


def wrist_figure(
    table: Table, theta: Array, load: Array, measured: Array, exaggeration: float | None
) -> tuple[Figure, float]:
    """Return the bodies at a pose: bent by the load, coloured by their share of what bends.

    `theta` (2,): motor angles [rad].  `load` (6,): wrench at O in F [N, N m].  `measured` (6,):
    error of the platform that was measured [m, rad]; NaN = not.  `exaggeration`: factor on every
    displacement [-]; None for one that is seen well.  Raises `UnreachablePoseError`,
    `SingularPoseError` or `LoadRangeError` if the pose or the load is out of range.
    """
    push = Push(load[:3], load[3:], np.zeros(3))
    shapes = bent_shapes(table, theta, push)
    share = 100.0 * load_alone(table, table.workspace.configuration(theta), load)[1]
    platform = shapes[-1]
    moved = [np.linalg.norm(shape.shift, axis=-1).max() for shape in shapes]
    reach = float(np.linalg.norm(platform.points, axis=-1).max())
    error = np.nan_to_num(measured)
    moved.append(np.linalg.norm(error[:3]) + reach * np.linalg.norm(error[3:]))
    if exaggeration is None:
        exaggeration = round_down(SEEN_M / max(float(max(moved)), LEAST_M))
    bent = [shape.points + exaggeration * shape.shift for shape in shapes]
    told = [
        f"{name.replace('_', ' ')}: {part:.0f} %" for name, part in zip(ELASTIC, share, strict=True)
    ]
    counts = [each[..., 0].size for each in bent[:-1]]
    bodies = {
        **_mesh(bent[:-1]),
        "intensity": np.repeat(share, counts),
        "colorscale": MAP,
        "cmin": 0.0,
        "cmax": max(float(share.max()), 1.0),
        "colorbar": {
            "title": {"text": "share of strain energy [%]", "side": "right"},
            "thickness": 12,
            "len": 0.8,
        },
        "text": np.repeat(told, counts),
        "hovertemplate": "%{text}<extra></extra>",
    }
    traces = [bodies, _rigid(shapes), _disc(bent[-1], BENT, "#9ca3af")]
    if np.isfinite(measured).all():
        turn, shift = exp_twist(exaggeration * measured)
        traces.append(_disc(platform.points @ turn.T + shift, MEASURED, RED))
    scene = {f"{axis}axis": {"visible": False} for axis in "xyz"}
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "font": {"size": 12, "color": "#1f2937"},
        "scene": {
            **scene,
            "domain": {"x": [0.0, 1.0], "y": [0.1, 1.0]},
            "aspectmode": "data",
            "camera": {"eye": dict(zip("xyz", EYE, strict=True))},
            "annotations": _names(bent[:-1], told),
        },
        "uirevision": "kept",
        "legend": {"orientation": "h", "x": 0, "y": 0, "font": {"size": 11}},
    }
    config = {"displaylogo": False, "modeBarButtonsToRemove": REMOVED}
    return {"data": traces, "layout": layout, "config": config}, exaggeration


def _mesh(bodies: list[Array]) -> Figure:
    """Return grids of points (p, q, 3) as one net: without a graphics card too it is drawn soon."""
    points = [MM * each.reshape(-1, 3) for each in bodies]
    firsts = np.cumsum([0, *(len(each) for each in points[:-1])])
    nets = [_triangles(*each.shape[:2]) for each in bodies]
    faces = np.concatenate([first + net for first, net in zip(firsts, nets, strict=True)])
    corners = dict(zip("xyzijk", (*np.concatenate(points).T, *faces.T), strict=True))
    return {"type": "mesh3d", **corners}


def _triangles(rows: int, columns: int) -> Array:
    """Return corners of the triangles of a grid of points, (t, 3)."""
    at = np.arange(rows * columns).reshape(rows, columns)
    corners = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    one, two, three, four = (each.ravel() for each in corners)
    halves = np.stack([one, two, three], axis=1), np.stack([one, three, four], axis=1)
    return np.concatenate(halves)


def _rigid(shapes: list[Shape]) -> Figure:
    """Return outlines of the bodies as they would stand rigid."""
    lines: list[Any] = []
    for shape in shapes:
        for line in (*np.moveaxis(shape.points, 1, 0)[:4], *shape.points[-1:]):
            lines += [*(MM * line).tolist(), [None, None, None]]
    return {
        "type": "scatter3d",
        "mode": "lines",
        "showlegend": False,
        **dict(zip("xyz", zip(*lines, strict=True), strict=True)),
        "line": {"color": "#9ca3af", "width": 1},
        "hoverinfo": "skip",
    }


def _disc(points: Array, name: str, colour: str) -> Figure:
    return {
        **_mesh([points]),
        "color": colour,
        "opacity": 0.55,
        "name": name,
        "showlegend": True,
        "hovertemplate": f"{name}<extra></extra>",
    }


def _names(bodies: list[Array], told: list[str]) -> list[Figure]:
    """Return names and shares of the bodies, each led away from the middle as first seen."""
    right = np.cross([0.0, 0.0, 1.0], EYE)
    right /= np.linalg.norm(right)
    up = np.cross(EYE, right) / np.linalg.norm(EYE)
    middles = np.array([points.mean(axis=(0, 1)) for points in bodies])
    seen = (middles - middles.mean(axis=0)) @ np.stack([right, up], axis=1)
    away = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    # Neighbours take turns in the length of their leaders.
    turn = np.argsort(np.argsort(np.arctan2(away[:, 1], away[:, 0]))) % 2
    leaders = LEADER_PX * (1.0 + turn[:, None]) * away
    leaders[:, 1] += raised(VIEW_PX / np.ptp(seen) * seen + leaders, *NAME_PX)
    return [
        {
            **dict(zip("xyz", (MM * middle).tolist(), strict=True)),
            "text": text,
            "ax": float(way[0]),
            "ay": -float(way[1]),
            "xanchor": "left" if way[0] > 0.0 else "right",
            "arrowwidth": 1,
            "arrowhead": 0,
            "bgcolor": "rgba(255, 255, 255, 0.8)",
            "font": {"size": 11, "color": "#111827"},
        }
        for text, middle, way in zip(told, middles, leaders, strict=True)
    ]
