"""Pictures of a view as Plotly takes them, all in um, mdeg, deg and minutes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.analysis import View
from wrist_stiffness.comparing.curve import Curve, condition_label, condition_shown
from wrist_stiffness.inference.observations import Mask, Observations, Quantity
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.report.pictures.palette import COLOURS, FLOOR
from wrist_stiffness.web.bench import Row

Figure = dict[str, Any]

BLUE, RED, GREEN = COLOURS[:3]
AXES = ("x", "y", "z")
DRAWN = 3000
"""Points that a picture shows at most; the numbers beside it are of all."""

SYMBOL = {"s": "s", "phi": "φ"}
MAP = "Cividis"
"""Perceptually even, and the same to people of any colour vision."""

UNNAMED = {"showlegend": False}

BREAK_MIN = 0.3
"""Gap between two recordings on one axis of time."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What every picture of a tab shows.

    Parameters
    ----------
    view : View
        Of the version that is looked at.
    after : (u, 6) float or None
        What would be left with the chosen candidate [m, rad].
    candidate : str
        Its name, empty for none.
    quantity : Quantity
        Shift or rotation.
    axis : int
        Component of it for pictures over time and condition.
    scale : float
        End of the scale of colours, in the unit of the quantity.
    chosen : (u,) bool or None
        Units that are selected.
    moment : int
        Unit that is looked at.
    """

    view: View
    after: Array | None
    candidate: str
    quantity: Quantity
    axis: int
    scale: float
    chosen: Mask | None
    moment: int

    @property
    def unit(self) -> str:
        """As people write it."""
        return unit_of(self.quantity)

    def part(self, values: Array) -> Array:
        """Return the component that is shown of (u, 6) values, in the unit of the quantity."""
        return np.asarray(values[:, self.quantity.components[self.axis]] * self.quantity.per_si)

    @property
    def part_label(self) -> str:
        """Of an axis of a picture."""
        word = "along" if self.quantity.name == "s" else "about"
        return f"{SYMBOL[self.quantity.name]} {word} {AXES[self.axis]} [{self.unit}]"


def unit_of(quantity: Quantity) -> str:
    """Return the unit of a quantity as people write it."""
    return "µm" if quantity.unit == "um" else quantity.unit


def length(values: Array, quantity: Quantity) -> Array:
    """Return the length of a quantity of (u, 6) values, (u,) in its unit."""
    return (
        np.asarray(np.linalg.norm(values[:, list(quantity.components)], axis=1)) * quantity.per_si
    )


def rms(values: Array, quantity: Quantity, chosen: Mask | None = None) -> float:
    """Return the root mean square of a quantity over the chosen units, or all."""
    sizes = length(values if chosen is None else values[chosen], quantity)
    return float(np.sqrt(np.nanmean(sizes**2))) if np.isfinite(sizes).any() else float("nan")


def strongest(values: Array, quantity: Quantity) -> int:
    """Return the component of a quantity along which (u, 6) values are largest."""
    return int(np.argmax(np.nanmean(values[:, list(quantity.components)] ** 2, axis=0)))


def minutes(table: Observations) -> Array:
    """Return times of units from the start of the first session, gaps between sessions closed."""
    times, begins = np.empty(table.n_units), 0.0
    for session in dict.fromkeys(table.sessions.tolist()):
        own = table.sessions == session
        since = (table.times[own] - table.times[own].min()) / 60.0
        times[own] = begins + since
        begins += float(since.max()) + BREAK_MIN
    return times


def error_map(shown: Shown, border: Array) -> Figure:
    """Return the error over both motor angles.

    Parameters
    ----------
    shown : Shown
        What to show.
    border : (n, 2) float
        Border of the operative workspace [rad].
    """
    table = shown.view.left
    left = table.values if shown.after is None else shown.after
    size = length(left, shown.quantity)
    angles = np.degrees(_angles(table))
    edge = np.degrees(border)
    text = f"{SYMBOL[shown.quantity.name]} [{shown.unit}]"
    points = {
        "type": "scatter",
        "mode": "markers",
        "name": "measured units",
        "x": angles[:, 0],
        "y": angles[:, 1],
        "marker": {
            "color": size,
            "colorscale": MAP,
            "cmin": 0.0,
            "cmax": shown.scale,
            "size": 8,
            "line": {"width": 0.5, "color": "white"},
            "colorbar": {"title": {"text": text, "side": "right"}, "thickness": 12},
        },
        "hovertemplate": f"motors %{{x:.1f}}°, %{{y:.1f}}°: %{{marker.color:.3g}} {shown.unit}"
        "<extra></extra>",
        "unselected": {"marker": {"opacity": 0.12}},
        **_selected(shown),
    }
    outline = {
        "type": "scatter",
        "mode": "lines",
        "name": "operative border",
        "x": edge[:, 0],
        "y": edge[:, 1],
        "line": {"color": FLOOR, "width": 1.5, "dash": "dash"},
        "hoverinfo": "name",
    }
    ring = _ring(angles[shown.moment, 0], angles[shown.moment, 1])
    figure = _figure([points, outline, ring], "motor angle 1 [deg]", "motor angle 2 [deg]")
    figure["layout"] |= {"dragmode": "lasso", "showlegend": False}
    figure["layout"]["yaxis"] |= {"scaleanchor": "x"}
    return figure


def time_line(shown: Shown) -> Figure:
    """Return measured and predicted error over time, and what is left below."""
    view, table = shown.view, shown.view.left
    time, rows = minutes(table), _drawn(table.n_units)
    measured, predicted = shown.part(view.measured), shown.part(view.predicted)
    left = shown.part(table.values)
    traces = [
        _dots(time, measured, "measured", FLOOR, rows, shown, size=4),
        _line(time, predicted, "predicted", BLUE, rows),
        _dots(time, left, "left", BLUE, rows, shown, yaxis="y2", size=4) | UNNAMED,
    ]
    if shown.after is not None:
        after = shown.part(shown.after)
        with_it = predicted + left - after
        traces.insert(2, _line(time, with_it, f"with {shown.candidate}", RED, rows))
        traces.append(_dots(time, after, "left", RED, rows, shown, "y2", 4) | UNNAMED)
    figure = _figure(traces, "time [min]", f"{SYMBOL[shown.quantity.name]} [{shown.unit}]")
    at = float(time[shown.moment])
    cut = {"type": "line", "x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1}
    figure["layout"] |= {
        "dragmode": "select",
        "selectdirection": "h",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "shapes": [{**cut, "line": {"color": FLOOR, "width": 1, "dash": "dot"}}],
    }
    figure["layout"]["yaxis"] |= {"domain": [0.5, 1.0]}
    figure["layout"]["yaxis2"] = {**_axis(f"left [{shown.unit}]"), "domain": [0.0, 0.4]}
    figure["layout"]["xaxis"] |= {"anchor": "y2"}
    return figure


def contrast(shown: Shown, condition: str, told: Curve | None) -> Figure:
    """Return what is left against one condition, with the law that the comparison found.

    Parameters
    ----------
    shown : Shown
        What to show.
    condition : str
        Of the units.
    told : Curve, optional
        Of the comparison, where it is of this condition and version.
    """
    table = shown.view.left
    values, rows = condition_shown(table, condition), _drawn(table.n_units)
    if told is not None and shown.after is None and len(told.measured) == table.n_units:
        values, label = told.values[:, 0], f"{SYMBOL[told.quantity.name]} {told.where}"
        known = [_dots(values, told.measured, "what is left", BLUE, rows, shown, size=6)]
        law = _line(told.places[:, 0], told.mean, "its law", RED, slice(None))
        figure = _figure([*known, law], told.labels[0], f"{label} [{unit_of(told.quantity)}]")
    else:
        traces = [_dots(values, shown.part(table.values), "left", BLUE, rows, shown, size=6)]
        if shown.after is not None:
            after = shown.part(shown.after)
            traces.append(_dots(values, after, f"with {shown.candidate}", RED, rows, shown, size=6))
        figure = _figure(traces, condition_label(condition), shown.part_label)
    figure["layout"] |= {
        "dragmode": "lasso",
        "showlegend": True,
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    }
    return figure


def waterfall(versions: Sequence[Row], noise: Mapping[str, float], quantity: Quantity) -> Figure:
    """Return the held-out error of every version, with the noise as the line to reach."""
    sizes = [each.held_out.get(quantity.key, np.nan) for each in versions]
    # The first one stands wherever instrument and target were put: it says nothing of the wrist.
    top = 1.25 * max(sizes[1:] or sizes)
    bars = {
        "type": "bar",
        "orientation": "h",
        "x": sizes,
        "y": [f"{number}  {each.name}" for number, each in enumerate(versions)],
        "text": [f"<b>{number(size)}</b> {unit_of(quantity)}" for size in sizes],
        "textposition": ["inside" if size > 0.4 * top else "outside" for size in sizes],
        "insidetextanchor": "start",
        "marker": {"color": [BLUE] * (len(sizes) - 1) + [GREEN]},
        "hoverinfo": "skip",
        "cliponaxis": True,
    }
    figure = _figure([bars], f"{SYMBOL[quantity.name]} on unseen data [{unit_of(quantity)}]", "")
    floor = noise.get(quantity.key, 0.0)
    line = {"type": "line", "x0": floor, "x1": floor, "yref": "paper", "y0": 0, "y1": 1}
    word = {"x": floor, "y": 1.0, "yref": "paper", "yanchor": "bottom", "showarrow": False}
    figure["layout"] |= {
        "showlegend": False,
        "shapes": [{**line, "line": {"color": FLOOR, "width": 2, "dash": "dash"}}],
        "annotations": [{**word, "text": f"noise {number(floor)}"}],
    }
    figure["layout"]["xaxis"] |= {"range": [0.0, top]}
    figure["layout"]["yaxis"] |= {"autorange": "reversed", "automargin": True}
    return figure


def _angles(table: Observations) -> Array:
    return np.stack([table.covariate("theta_1"), table.covariate("theta_2")], axis=1)


def number(value: float) -> str:
    """Return three digits, thousands without a power of ten."""
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def _drawn(count: int) -> slice:
    return slice(None, None, max(1, -(-count // DRAWN)))


def _selected(shown: Shown) -> Figure:
    if shown.chosen is None:
        return {}
    return {"selectedpoints": np.flatnonzero(shown.chosen).tolist()}


def _dots(
    x: Array,
    y: Array,
    name: str,
    colour: str,
    rows: slice,
    shown: Shown,
    yaxis: str = "y",
    size: int = 5,
) -> Figure:
    chosen = {}
    if shown.chosen is not None:
        chosen = {"selectedpoints": np.flatnonzero(shown.chosen[rows]).tolist()}
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": x[rows],
        "y": y[rows],
        "yaxis": yaxis,
        "marker": {"color": colour, "size": size, "opacity": 0.75},
        "unselected": {"marker": {"opacity": 0.1}},
        **chosen,
    }


def _line(x: Array, y: Array, name: str, colour: str, rows: slice) -> Figure:
    line = {"color": colour, "width": 1.5}
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": x[rows],
        "y": y[rows],
        "line": line,
    }


def _ring(x: float, y: float) -> Figure:
    marker = {"symbol": "circle-open", "size": 16, "color": RED, "line": {"width": 3}}
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "the moment that is looked at",
        "x": [x],
        "y": [y],
        "marker": marker,
        "hoverinfo": "name",
        "selectedpoints": [0],
    }


def _axis(title: str) -> Figure:
    return {
        "title": {"text": title, "standoff": 4, "font": {"size": 12}},
        "gridcolor": "#e5e7eb",
        "zeroline": False,
        "linecolor": FLOOR,
        "ticks": "outside",
        "automargin": True,
    }


def _figure(traces: Sequence[Figure], x: str, y: str) -> Figure:
    layout = {
        "margin": {"l": 8, "r": 8, "t": 26, "b": 8},
        "font": {"size": 12, "color": "#1f2937"},
        "plot_bgcolor": "white",
        "uirevision": "kept",
        "xaxis": _axis(x),
        "yaxis": _axis(y),
    }
    config = {"displaylogo": False, "scrollZoom": True}
    return {"data": list(traces), "layout": layout, "config": config}
