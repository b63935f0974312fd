"""The pictures beside the panels; they follow what is selected in any of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import events, ui

from wrist_stiffness.comparing.curve import condition_label
from wrist_stiffness.errors import WristError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.web.figures import (
    AXES,
    SYMBOL,
    Figure,
    contrast,
    error_map,
    number,
    rms,
    time_line,
    unit_of,
    waterfall,
)
from wrist_stiffness.web.wrist_figure import wrist_figure

if TYPE_CHECKING:
    from wrist_stiffness.web.figures import Shown
    from wrist_stiffness.web.page import Workbench

DEPENDS, VERSIONS = "Depends on", "Versions"

EXAGGERATIONS = (1, 20, 50, 100, 200, 500, 1000, 2000, 5000)

POINTS = "(e) => emit(e ? e.points.filter(p => p.curveNumber === 0).map(p => p.pointIndex) : null)"
"""What of a selection goes to the server: numbers of points of the first trace."""


class Views:
    """The pictures of one tab.

    Parameters
    ----------
    page : Workbench
        Whose they are.
    """

    def __init__(self, page: Workbench) -> None:
        self._page = page
        with ui.row().classes("w-full no-wrap gap-2 items-stretch"):
            with ui.column().classes("panel gap-0").style("flex: 1; min-width: 0"):
                self._numbers = ui.row().classes("gap-6 items-end")
                self._scope = ui.label("").classes("text-xs text-gray-600")
            with ui.column().classes("panel gap-1 justify-center"):
                self._quantity = ui.toggle({0: "shift s [µm]", 1: "rotation φ [mdeg]"}, value=1)
                self._quantity.props("dense no-caps").on_value_change(self.refresh)
                with ui.row().classes("items-center gap-2"):
                    ui.label("along").classes("text-xs")
                    self._axis = ui.toggle(
                        {-1: "strongest", **dict(enumerate(AXES))}, value=-1
                    ).props("dense no-caps")
                    self._axis.on_value_change(self._axis_chosen)
                    self._all = ui.button("show all", on_click=self._show_all)
                    self._all.props("dense flat")
        row, column = "w-full no-wrap gap-2 items-stretch", "panel gap-0"
        with ui.row().classes(row).style("height: calc((100vh - 152px) * 0.52)"):
            with ui.column().classes(column).style("flex: 1; min-width: 0"):
                self._map_title = ui.label("Where does it fail?").classes("font-bold")
                self._map = self._plot("map")
            with ui.column().classes(column).style("flex: 1; min-width: 0"):
                with ui.row().classes("items-center gap-2 w-full no-wrap"):
                    self._wrist_title = ui.label("The wrist").classes("font-bold whitespace-nowrap")
                    ui.space()
                    self._drawn = ui.label("").classes("text-xs whitespace-nowrap")
                    choices = {0: "as fits", **{n: f"× {n}" for n in EXAGGERATIONS}}
                    self._factor = ui.select(choices, value=0).props(
                        "dense options-dense borderless"
                    )
                    self._factor.on_value_change(self._draw_wrist)
                self._wrist = self._plot("wrist")
        with ui.row().classes(row).style("height: calc((100vh - 152px) * 0.48)"):
            with ui.column().classes(column).style("flex: 1.5; min-width: 0"):
                ui.label("When: measured and predicted, and what is left").classes("font-bold")
                self._time = self._plot("time")
            with ui.column().classes(column).style("flex: 1; min-width: 0"):
                with ui.row().classes("w-full no-wrap items-center gap-2"):
                    self._lower = ui.toggle([DEPENDS, VERSIONS], value=DEPENDS)
                    self._lower.props("dense no-caps").on_value_change(self._draw_lower)
                    self._condition = ui.select([]).classes("grow").props("dense options-dense")
                    self._condition.on_value_change(self._draw_lower)
                    self._condition.bind_visibility_from(self._lower, "value", value=DEPENDS)
                self._plot_lower = self._plot("lower")
        for plot in (self._map, self._time, self._plot_lower):
            plot.on("plotly_selected", self._selected, js_handler=POINTS)
            plot.on("plotly_click", self._clicked, js_handler=POINTS)

    def _plot(self, name: str) -> ui.plotly:
        plot = ui.plotly({"data": [], "layout": {"xaxis": {"visible": False}}})
        plot.classes("w-full grow").style("min-height: 0").props(f"id=plot-{name}")
        return plot

    def begin(self) -> None:
        """Begin with the quantity that stands farthest above its noise."""
        tab = self._page.tab
        view = tab.views[0]
        over = [
            rms(view.left.values, each) / max(view.noise[each.key], 1e-9) for each in tab.quantities
        ]
        self._quantity.set_value(int(np.argmax(over)))

    @property
    def shown(self) -> Shown | None:
        """What the pictures show; None while nothing is opened."""
        tab = self._page.tab
        if tab.version not in tab.views:
            return None
        number = min(int(self._quantity.value or 0), len(tab.quantities) - 1)
        return tab.shown(tab.quantities[number])

    def refresh(self) -> None:
        """Draw all pictures anew."""
        shown, tab = self.shown, self._page.tab
        if shown is None or tab.table is None:
            return
        self._tell_numbers(shown)
        border = tab.table.workspace.operative_border
        _show(self._map, error_map(shown, border))
        what = tab.rows[tab.version].name
        if tab.seen is not None:
            what = f"if {tab.candidate} were added"
        elif shown.after is not None:
            what = shown.candidate
        self._map_title.text = f"Where does it fail? ({what})"
        _show(self._time, time_line(shown))
        names, curves = list(shown.view.left.covariates), tab.curves
        ordered = {name: f"{name} (the error depends on it)" for name in curves}
        ordered |= {name: condition_label(name) for name in names if name not in curves}
        if self._condition.options != ordered:
            self._condition.set_options(ordered, value=next(iter(ordered)))
        self._draw_lower()
        self._draw_wrist()

    def _noise(self) -> dict[str, float]:
        tab = self._page.tab
        return dict(tab.views[max(tab.views)].noise)

    def _tell_numbers(self, shown: Shown) -> None:
        tab = self._page.tab
        versions = tab.rows
        self._numbers.clear()
        with self._numbers:
            for quantity in tab.quantities:
                key, unit = quantity.key, unit_of(quantity)
                sizes = [each.held_out[key] for each in versions[1:] or versions]
                path = " → ".join(number(size) for size in dict.fromkeys((sizes[0], sizes[-1])))
                with ui.column().classes("gap-0"):
                    ui.label(f"{SYMBOL[quantity.name]} on unseen data").classes("text-xs")
                    ui.label(f"{path} {unit}").classes("text-3xl font-bold whitespace-nowrap")
                    ui.label(f"noise {self._noise()[key]:.2g} {unit}").classes("text-xs")
            with ui.column().classes("gap-0"):
                every, count = shown.chosen is None, shown.view.left.n_units
                if shown.chosen is not None:
                    count = int(shown.chosen.sum())
                ui.label("on all of these data" if every else "on the selection").classes("text-xs")
                left = shown.view.left.values if shown.after is None else shown.after
                size = rms(left, shown.quantity, shown.chosen)
                ui.label(f"{size:.3g} {shown.unit}").classes("text-xl")
                ui.label(f"left, over {count} units").classes("text-xs")

    def _draw_lower(self) -> None:
        shown, tab = self.shown, self._page.tab
        if shown is None:
            return
        if self._lower.value == VERSIONS:
            _show(self._plot_lower, waterfall(tab.rows, self._noise(), shown.quantity))
            return
        told = tab.curves.get(str(self._condition.value))
        name = str(self._condition.value) if told is None else told.names[0]
        if name in shown.view.left.covariates:
            _show(self._plot_lower, contrast(shown, name, told))

    def _draw_wrist(self) -> None:
        shown, tab = self.shown, self._page.tab
        if shown is None or tab.table is None:
            return
        told, at = shown.view.left.covariates, shown.moment
        theta = np.array([told["theta_1"][at], told["theta_2"][at]])
        load = np.array([told[name][at] for name in ("fx", "fy", "fz", "mx", "my", "mz")])
        error: Array = shown.view.measured[at]
        try:
            factor = float(self._factor.value) or None
            drawn, factor = wrist_figure(tab.table, theta, load, error, factor)
        except WristError as reason:
            self._wrist_title.text = f"The wrist: {reason}"
            return
        one, two = np.degrees(theta)
        force = float(np.linalg.norm(load[:3]))
        self._wrist_title.text = f"The wrist at {one:.0f}°, {two:.0f}° under {force:.2f} N"
        self._drawn.text = f"drawn × {factor:g}"
        _show(self._wrist, drawn)

    def _axis_chosen(self) -> None:
        value = int(self._axis.value)
        self._page.tab.axis = None if value < 0 else value
        self.refresh()

    def _show_all(self) -> None:
        self._page.tab.chosen = None
        self.refresh()

    def _selected(self, event: events.GenericEventArguments) -> None:
        shown = self.shown
        if shown is None or not event.args:
            return
        chosen = np.zeros(shown.view.left.n_units, dtype=bool)
        chosen[_places(event.args, len(chosen))] = True
        if chosen.any():
            self._page.tab.chosen = chosen
            self.refresh()

    def _clicked(self, event: events.GenericEventArguments) -> None:
        shown = self.shown
        places = _places(event.args or [], shown.view.left.n_units if shown else 0)
        bars = event.sender is self._plot_lower and self._lower.value == VERSIONS
        if places and not bars:
            self._page.tab.moment = places[0]
            self.refresh()


def _places(told: Any, count: int) -> list[int]:
    return [n for n in told if isinstance(n, int) and 0 <= n < count]


def _show(plot: ui.plotly, figure: Figure) -> None:
    plot.update_figure(_plain(figure))


def _plain(value: Any) -> Any:
    """Return a figure with lists for arrays, whatever their layout in memory."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value
