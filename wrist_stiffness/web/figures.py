"""Pictures of a view as Plotly takes them, all in µm, mdeg, deg and minutes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrist_stiffness.analysis import View
from wrist_stiffness.comparing.comparison import lengths
from wrist_stiffness.comparing.curve import ANGLES, Curve, condition_label, condition_shown
from wrist_stiffness.inference.observations import Mask, Observations, Quantity
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.numerals import number
from wrist_stiffness.report.page import typeset
from wrist_stiffness.report.pictures.figure import COLOURS, FLOOR
from wrist_stiffness.web.bench import Row

Figure = dict[str, Any]

BLUE, RED, GREEN = COLOURS[:3]
AXES = ("x", "y", "z")
WORDS = {"s": "shift s", "phi": "rotation φ"}
DRAWN = 3000
"""Points from which a picture is drawn by the graphics card: an hour of motion at half a second."""

MAP = "Cividis"
"""Perceptually even, and the same to people of any colour vision."""

UNITS = "units"
"""Marks the traces that are selected by point."""

LEGEND = {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}

REMOVED = ("zoom2d", "zoomIn2d", "zoomOut2d", "autoScale2d")
"""Buttons on a picture of what the wheel and a double click do: Tab would stop at each."""

LOWER = {"yaxis": "y2", "showlegend": False}
"""Of traces in the lower of two plots."""

GAP_S = 1.0
"""Time without a measurement over which no line is drawn: moments of one motion that follow each
other are half as far apart."""

DASH_S = 0.5
"""Before and after a pose that was measured once, between two gaps: it is a short line."""

BREAK_MIN = 0.3
"""Gap between two recordings on one axis of time."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What every picture of a tab shows."""

    view: View  # of the version that is looked at
    # what would be left with the chosen candidate, or what another version leaves; None for neither
    after: Observations | None
    name: str  # of that, empty for none
    quantity: Quantity  # shift or rotation
    axis: int  # component of it for pictures over time and condition
    scale: float  # end of the scale of colours, in the unit of the quantity
    chosen: Mask | None  # (u,), units that are selected
    moment: int  # unit that is looked at

    @property
    def unit(self) -> str:
        """As people write it."""
        return spelled(self.quantity.unit)

    @property
    def label(self) -> str:
        """Of an axis of the length of the quantity."""
        return f"{spelled(self.quantity.name)} [{self.unit}]"

    def fall(self, quantity: Quantity, chosen: Mask | None = None) -> str:
        """Return what is left of a quantity in the chosen units, and after, RMS with the unit."""
        sizes = []
        for left in (self.view.left, self.after):
            if left is not None:
                own = left if chosen is None else left.take(chosen)
                error = own.rms(np.nan_to_num(own.values) ** 2)
                sizes.append(number(error.get(quantity.key, np.nan)))
        return f"{' → '.join(sizes)} {spelled(quantity.unit)}"

    def part(self, values: Array) -> Array:
        """Return the component that is shown of (u, m) values, in the unit of the quantity."""
        return np.asarray(values[:, self.quantity.components[self.axis]] * self.quantity.per_si)

    @property
    def part_label(self) -> str:
        """Of an axis of a picture."""
        if self.quantity.called:
            return f"gauge {self.quantity.called[self.axis]} [{self.unit}]"
        word = "along" if self.quantity.name == "s" else "about"
        return f"{spelled(self.quantity.name)} {word} {AXES[self.axis]} [{self.unit}]"


def spelled(text: str) -> str:
    """Return text for the page, with one spelling of units; names such as `size_um` stay."""
    return re.sub(r"\bphi\b", "φ", typeset(text))


def quantity_label(quantity: Quantity) -> str:
    """Return what a quantity is called where it is chosen."""
    return f"{WORDS.get(quantity.name, quantity.name)} [{spelled(quantity.unit)}]"


def strongest(values: Array, quantity: Quantity) -> int:
    """Return the component of a quantity along which (u, m) values are largest."""
    return int(np.argmax(np.nansum(values[:, list(quantity.components)] ** 2, axis=0)))


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
    """Return the error over both motor angles, with the workspace's border (n, 2) [rad]."""
    table = shown.view.left
    size = lengths(table if shown.after is None else shown.after, shown.quantity)
    one, two = (np.degrees(table.covariate(name)) for name in ANGLES)
    edge = np.degrees(border)
    points = _dots(one, two, "averaged poses", "", shown)
    points["marker"] = {
        "color": size,
        "colorscale": MAP,
        "cmin": 0.0,
        "cmax": shown.scale,
        "size": 8,
        "line": {"width": 0.5, "color": "white"},
        "colorbar": {"title": {"text": shown.label, "side": "right"}, "thickness": 12},
    }
    told = f"motors %{{x:.1f}}°, %{{y:.1f}}°: %{{marker.color:.3g}} {shown.unit}"
    points["hovertemplate"] = f"{told}<extra></extra>"
    outline = _line(edge[:, 0], edge[:, 1], "operative border", FLOOR)
    outline |= {"line": {"color": FLOOR, "width": 1.5, "dash": "dash"}, "hoverinfo": "name"}
    ring = {
        "type": "scatter",
        "mode": "markers",
        "name": "the moment that is looked at",
        "x": one[[shown.moment]],
        "y": two[[shown.moment]],
        "marker": {"symbol": "circle-open", "size": 16, "color": RED, "line": {"width": 3}},
        "hoverinfo": "name",
        "selectedpoints": [0],
    }
    x, y = edge[np.argmax(edge[:, 1])]
    word = {"x": x, "y": y, "text": "operative workspace", "showarrow": False, "yshift": 9}
    figure = _figure([points, outline, ring], "motor angle 1 [deg]", "motor angle 2 [deg]", "map")
    figure["layout"] |= {"dragmode": "lasso", "showlegend": False, "annotations": [word]}
    figure["layout"]["yaxis"] |= {"scaleanchor": "x"}
    return figure


def time_line(shown: Shown) -> Figure:
    """Return measured and predicted error over time, and what is left below."""
    view, table = shown.view, shown.view.left
    time = minutes(table)
    measured, predicted = shown.part(view.measured), shown.part(view.predicted)
    left = shown.part(table.values)
    traces = [
        _dots(time, measured, "measured", FLOOR, shown, 4),
        _line(*over_time(view, predicted), "predicted", BLUE),
        _dots(time, left, "left", BLUE, shown, 4) | LOWER,
    ]
    if shown.after is not None:
        after = shown.part(shown.after.values)
        told = over_time(view, predicted + left - after)
        traces.insert(2, _line(*told, shown.name, RED))
        traces.append(_dots(time, after, "left", RED, shown, 4) | LOWER)
    figure = _figure(traces, "time [min]", shown.label, "time")
    cut = {"color": FLOOR, "width": 1, "dash": "dot"}
    figure["layout"] |= {
        "dragmode": "select",
        "selectdirection": "h",
        "hovermode": "closest",
        "legend": LEGEND,
        "shapes": [_upright(float(time[shown.moment]), cut)],
    }
    figure["layout"]["yaxis"] |= {"domain": [0.5, 1.0]}
    figure["layout"]["yaxis2"] = {**_axis(f"remaining [{shown.unit}]"), "domain": [0.0, 0.4]}
    figure["layout"]["xaxis"] |= {"anchor": "y2"}
    return figure


def contrast(shown: Shown, condition: str, told: Curve | None) -> Figure:
    """Return what is left against one condition, with the law that the comparison found."""
    table, part, label = shown.view.left, shown.part, shown.part_label
    if told is not None and len(told.measured) == table.n_units:
        label = spelled(f"{told.quantity.name} {told.where} [{told.quantity.unit}]")
        part = told.along
    else:
        told = None
    values = condition_shown(table, condition) if told is None else told.values[:, 0]
    traces = [_dots(values, part(table.values), "remaining error", BLUE, shown)]
    if shown.after is not None:
        traces.append(_dots(values, part(shown.after.values), shown.name, RED, shown))
    elif told is not None:
        traces = [_dots(values, told.measured, "remaining error", BLUE, shown)]
        traces.append(_line(told.places[:, 0], told.mean, "fitted law", RED))
    figure = _figure(traces, condition_label(condition), label, condition)
    figure["layout"] |= {"dragmode": "lasso", "showlegend": True, "legend": LEGEND}
    return figure


def waterfall(
    versions: Sequence[Row], noise: Mapping[str, float], called: str, quantity: Quantity
) -> Figure:
    """Return the held-out error of every version, with the noise, so called, as the goal."""
    sizes = [each.held_out.get(quantity.key, np.nan) for each in versions]
    # The first one stands wherever instrument and target were put: it says nothing of the wrist.
    top = 1.25 * max(sizes[1:] or sizes)
    unit = spelled(quantity.unit)
    bars = {
        "type": "bar",
        "meta": UNITS,
        "orientation": "h",
        "x": sizes,
        "y": [
            f"{place} {each.name}<br><b>{number(size)} {unit}</b>"
            for place, (each, size) in enumerate(zip(versions, sizes, strict=True))
        ],
        "marker": {"color": ["#9ca3af"] + [BLUE] * (len(sizes) - 2) + [GREEN]},
        "hoverinfo": "skip",
    }
    label = f"held-out {spelled(quantity.name)} [{unit}]"
    figure = _figure([bars], label, "", f"versions {len(versions)}")
    floor = noise.get(quantity.key, 0.0)
    word = {"x": floor, "y": 1.0, "yref": "paper", "yanchor": "bottom", "showarrow": False}
    word |= {"xanchor": "left" if floor < 0.3 * top else "right"}
    figure["layout"] |= {
        "showlegend": False,
        "shapes": [_upright(floor, {"color": FLOOR, "width": 2, "dash": "dash"})],
        "annotations": [{**word, "text": f"goal: {called} {number(floor)} {unit}"}],
    }
    figure["layout"]["xaxis"] |= {"range": [0.0, top]}
    figure["layout"]["yaxis"] |= {"autorange": "reversed", "automargin": True}
    return figure


def _dots(x: Array, y: Array, name: str, colour: str, shown: Shown, size: int = 6) -> Figure:
    chosen = {} if shown.chosen is None else {"selectedpoints": np.flatnonzero(shown.chosen)}
    return {
        "type": _kind(len(x)),
        "mode": "markers",
        "meta": UNITS,
        "name": name,
        "x": x,
        "y": y,
        "marker": {"color": colour, "size": size, "opacity": 0.75},
        "unselected": {"marker": {"opacity": 0.1}},
        **chosen,
    }


def over_time(view: View, values: Array) -> tuple[Array, Array]:
    """Return a line through values (u,): level over each unit, none where nothing was measured."""
    table, span = view.left, view.span - view.left.times[:, None]
    # Moments of a motion are short: one point each; a pose that was measured once has some width.
    long = np.ptp(span, axis=1) > GAP_S
    apart = view.span[1:, 0] - view.span[:-1, 1] > GAP_S
    apart |= np.diff(table.sessions) != 0
    alone = np.append(True, apart) & np.append(apart, True)
    span = np.where(long[:, None], span, 0.0) + np.outer(alone & ~long, [-DASH_S, DASH_S])
    x = (minutes(table)[:, None] + span / 60.0).ravel()
    breaks = 2 * (1 + np.flatnonzero(apart))
    return np.insert(x, breaks, np.nan), np.insert(np.repeat(values, 2), breaks, np.nan)


def _line(x: Array, y: Array, name: str, colour: str) -> Figure:
    return {
        "type": _kind(len(x)),
        "mode": "lines",
        "name": name,
        "x": x,
        "y": y,
        "line": {"color": colour, "width": 1.5},
    }


def _kind(count: int) -> str:
    return "scatter" if count <= DRAWN else "scattergl"


def _upright(x: float, line: Figure) -> Figure:
    return {"type": "line", "x0": x, "x1": x, "yref": "paper", "y0": 0, "y1": 1, "line": line}


def _axis(title: str) -> Figure:
    return {
        "title": {"text": title, "standoff": 4, "font": {"size": 12}},
        "gridcolor": "#e5e7eb",
        "zeroline": False,
        "linecolor": FLOOR,
        "ticks": "outside",
        "automargin": True,
    }


def _figure(traces: Sequence[Figure], x: str, y: str, kept: str) -> Figure:
    """Return a picture that keeps its zoom while the same thing is shown."""
    layout = {
        "margin": {"l": 8, "r": 8, "t": 26, "b": 8},
        "font": {"size": 12, "color": "#1f2937"},
        "plot_bgcolor": "white",
        "uirevision": kept,
        "xaxis": _axis(x),
        "yaxis": _axis(y),
    }
    config = {"displaylogo": False, "scrollZoom": True, "modeBarButtonsToRemove": REMOVED}
    return {"data": list(traces), "layout": layout, "config": config}
