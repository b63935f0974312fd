"""The pictures beside the panels; they follow what is selected in any of them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from nicegui import events, ui

from wrist_stiffness.comparing.curve import condition_label
from wrist_stiffness.errors import WristError
from wrist_stiffness.numerals import number
from wrist_stiffness.web.figures import (
    AXES,
    Figure,
    Shown,
    contrast,
    error_map,
    minutes,
    quantity_label,
    spelled,
    time_line,
    waterfall,
)
from wrist_stiffness.web.tab import DEPENDS, VERSIONS, Tab
from wrist_stiffness.web.wrist_figure import wrist_figure

EXAGGERATIONS = (1, 20, 50, 100, 200, 500, 1000, 2000, 5000)

POINTS = """(e) => emit(e
  ? [...new Set(e.points.filter(p => p.data.meta).map(p => p.pointIndex))] : [])"""
"""What of a selection goes to the server: numbers of the units, whose traces are marked."""


class Views:
    """The pictures of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        row, panel, equal = "w-full no-wrap gap-2 items-stretch", "panel gap-0", "flex: 1 1 0"
        with ui.row().classes(row):
            with ui.column().classes(panel).style(f"{equal}; min-width: 0"):
                self._numbers = ui.row().classes("gap-x-3 gap-y-0 items-end no-wrap")
            with ui.column().classes("panel gap-1 justify-center"):
                self._quantity = ui.toggle([]).props("dense")
                self._quantity.on_value_change(self._quantity_chosen)
                with ui.row().classes("items-center gap-2 no-wrap"):
                    self._along = ui.label("along").classes("text-xs whitespace-nowrap")
                    self._axis = ui.toggle([], on_change=self._axis_chosen)
                    self._axis.props("dense aria-label=along")
                    self._all = ui.button("Show all", on_click=lambda: tab.choose(None))
                    self._all.props("dense flat")
        height = "height: calc((100vh - 156px) * "
        with ui.row().classes(row).style(f"{height}0.52)"):
            with ui.column().classes(panel).style(f"{equal}; min-width: 0"):
                self._map_title = ui.label().classes("font-bold")
                self._map = self._plot(
                    "map", "error over both motor angles; arrow keys go through the poses"
                )
            with ui.column().classes(panel).style(f"{equal}; min-width: 0"):
                with ui.row().classes("items-center gap-2 w-full no-wrap"):
                    self._wrist_title = ui.label().classes("font-bold ellipsis")
                    ui.space()
                    ui.label("displacement").classes("text-xs")
                    self._factor = ui.select({0: "automatic"}, value=0)
                    self._factor.props("dense options-dense borderless")
                    self._factor.props('aria-label="exaggeration of the displacement"')
                    self._factor.on_value_change(self._draw_wrist)
                self._wrist = self._plot("wrist", "the wrist in three dimensions")
        with ui.row().classes(row).style(f"{height}0.48)"):
            with ui.column().classes(panel).style("flex: 1.4 1 0; min-width: 0"):
                self._time_title = ui.label().classes("font-bold")
                self._time = self._plot("time", "error over time; arrow keys go through the poses")
            with ui.column().classes(panel).style(f"{equal}; min-width: 0"):
                with ui.row().classes("w-full no-wrap items-center gap-2"):
                    lower = ui.toggle([DEPENDS, VERSIONS]).props("dense")
                    lower.bind_value(tab, "lower").on_value_change(self._draw_lower)
                    self._condition = ui.select([], on_change=self._draw_lower)
                    self._condition.props('dense options-dense aria-label="condition"')
                    self._condition.classes("ellipsis")
                    self._condition.style("flex: 1 1 0; min-width: 0")
                    self._condition.bind_visibility_from(lower, "value", value=DEPENDS)
                self._lower = self._plot(
                    "lower",
                    "on what the error depends, or the versions; arrow keys go through them",
                )
        for plot in (self._map, self._time, self._lower):
            plot.on("plotly_selected", self._selected, js_handler=POINTS)
            plot.on("plotly_click", self._clicked, js_handler=POINTS)
            plot.props("tabindex=0")
            for key, step in (("left", -1), ("right", 1)):
                plot.on(f"keydown.{key}.prevent", partial(self._stepped, plot, step))
        tab.listeners.append(self.draw)

    def _plot(self, name: str, shows: str) -> ui.plotly:
        plot = ui.plotly({"data": [], "layout": {}}).classes("w-full grow").style("min-height: 0")
        return plot.props(f'id=plot-{name} role=group aria-label="{shows}"')

    def draw(self) -> None:
        """Draw all pictures anew."""
        tab = self._tab
        if tab.table is None:
            return
        self._offer()
        shown = tab.shown
        if shown is None:
            return
        self._tell_numbers(shown)
        self._all.set_enabled(tab.chosen is not None)
        what = shown.name or tab.rows[tab.version].titled(tab.version)
        self._map_title.text = f"Where: remaining error, {what}"
        _show(self._map, error_map(shown, tab.table.workspace.operative_border))
        self._time_title.text = f"When: {shown.part_label.partition(' [')[0]}"
        _show(self._time, time_line(shown))
        curves = tab.told.curves if tab.told else {}
        ordered = {name: f"{name} (found)" for name in curves}
        others = [name for name in shown.view.left.covariates if name not in curves]
        ordered |= {name: condition_label(name) for name in others}
        if self._condition.options != ordered:
            self._condition.set_options(ordered, value=next(iter(ordered)))
        self._draw_lower()
        self._draw_wrist()

    def _offer(self) -> None:
        """Offer what was measured, and its parts."""
        tab = self._tab
        measured = {place: quantity_label(each) for place, each in enumerate(tab.quantities)}
        gauges = tab.quantities[tab.quantity].called
        self._along.text, parts = ("gauge", gauges) if gauges else ("along", AXES)
        axes = {-1: "strongest", **dict(enumerate(parts))}
        if self._axis.options != axes:
            tab.axis = None
        for toggle, options, value in (
            (self._quantity, measured, tab.quantity),
            (self._axis, axes, -1 if tab.axis is None else tab.axis),
        ):
            if (toggle.options, toggle.value) != (options, value):
                toggle.set_options(options, value=value)

    def _tell_numbers(self, shown: Shown) -> None:
        """Write the held-out error largest; it is what a version is judged by."""
        tab, versions = self._tab, self._tab.rows
        self._numbers.clear()
        with self._numbers:
            for quantity in tab.quantities:
                key, unit = quantity.key, spelled(quantity.unit)
                sizes = [each.held_out.get(key, np.nan) for each in versions[1:] or versions]
                path = " → ".join(number(size) for size in dict.fromkeys((sizes[0], sizes[-1])))
                with ui.column().classes("gap-0"):
                    ui.label(f"Held-out error of {spelled(quantity.name)}").classes("text-xs")
                    ui.label(f"{path} {unit}").classes("text-3xl font-bold whitespace-nowrap")
                    floor = f"{tab.noise_floor} {number(tab.noise[key])} {unit}"
                    ui.label(floor).classes("text-xs")
            with ui.column().classes("gap-0"):
                units, chosen = shown.view.left.n_units, shown.chosen
                every = f"all {units} poses"
                if chosen is not None:
                    every = f"selected {int(chosen.sum())} of {units} poses"
                what = f"Remaining {spelled(shown.quantity.name)}, {every}"
                ui.label(what).classes("text-xs whitespace-nowrap")
                fall = shown.fall(shown.quantity, chosen)
                ui.label(fall).classes("text-xl whitespace-nowrap")
                ui.label(shown.name or "\u00a0").classes("text-xs")

    def _draw_lower(self) -> None:
        tab, shown = self._tab, self._tab.shown
        if shown is None:
            return
        if tab.lower == VERSIONS:
            _show(self._lower, waterfall(tab.rows, tab.noise, tab.noise_floor, shown.quantity))
            return
        told = tab.told.curves.get(str(self._condition.value)) if tab.told else None
        name = str(self._condition.value) if told is None else told.names[0]
        if name in shown.view.left.covariates:
            _show(self._lower, contrast(shown, name, told))

    def _draw_wrist(self) -> None:
        tab, shown = self._tab, self._tab.shown
        if shown is None or tab.table is None:
            return
        told, at = shown.view.left.covariates, shown.moment
        theta = np.array([told["theta_1"][at], told["theta_2"][at]])
        load = np.array([told[name][at] for name in ("fx", "fy", "fz", "mx", "my", "mz")])
        asked = float(self._factor.value or 0.0) or None
        # What gauges read is no pose.
        seen = np.full(6, np.nan) if shown.quantity.called else shown.view.measured[at]
        try:
            drawn, factor = wrist_figure(tab.table, theta, load, seen, asked)
        except WristError as reason:
            self._wrist_title.text = f"The wrist: {reason}"
            return
        one, two = np.degrees(theta)
        time, force = minutes(shown.view.left)[at], float(np.linalg.norm(load[:3]))
        self._wrist_title.text = f"At {time:.2f} min: {one:.0f}°, {two:.0f}°, {force:.2f} N"
        if asked is None:
            usual = {n: f"× {n}" for n in EXAGGERATIONS}
            self._factor.set_options({0: f"× {factor:g} (automatic)", **usual})
        _show(self._wrist, drawn)

    def _quantity_chosen(self, event: events.ValueChangeEventArguments) -> None:
        if event.value not in (None, self._tab.quantity):
            self._tab.quantity = int(event.value)
            self.draw()

    def _axis_chosen(self, event: events.ValueChangeEventArguments) -> None:
        axis = None if event.value in (None, -1) else int(event.value)
        if axis != self._tab.axis:
            self._tab.axis = axis
            self.draw()

    def _selected(self, event: events.GenericEventArguments) -> None:
        shown = self._tab.shown
        if shown is None or not event.args:
            return
        chosen = np.zeros(shown.view.left.n_units, dtype=bool)
        chosen[_places(event.args, len(chosen))] = True
        if chosen.any():
            self._tab.choose(chosen)

    def _stepped(self, plot: ui.plotly, step: int) -> None:
        """Go to the next moment, of those that are selected, or to the next version."""
        tab, shown = self._tab, self._tab.shown
        if shown is None:
            return
        if plot is self._lower and tab.lower == VERSIONS:
            tab.look((tab.version + step) % len(tab.rows))
            return
        units = np.arange(shown.view.left.n_units)
        units = units if shown.chosen is None else units[shown.chosen]
        place = int(np.searchsorted(units, tab.moment))
        tab.moment = int(units[(place + step) % len(units)])
        self.draw()

    def _clicked(self, event: events.GenericEventArguments) -> None:
        tab, shown = self._tab, self._tab.shown
        if shown is None:
            return
        if event.sender is self._lower and tab.lower == VERSIONS:
            if places := _places(event.args, len(tab.rows)):
                tab.look(places[0])
        elif places := _places(event.args, shown.view.left.n_units):
            tab.moment = places[0]
            self.draw()


def _places(told: Any, count: int) -> list[int]:
    return [n for n in told or [] if isinstance(n, int) and 0 <= n < count]


def _show(plot: ui.plotly, figure: Figure) -> None:
    """Draw a figure where it is another one: the wrist takes longer to draw than to compute."""
    plain = _plain(figure)
    if repr(plain) != repr(plot.figure):
        plot.update_figure(plain)


def _plain(value: Any) -> Any:
    """Return a figure with lists for arrays, whatever their layout in memory."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value
