"""The models on the way: their error on unseen data, an own formula, what to take home."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from nicegui import events, ui

from wrist_stiffness.report.parts import plus_minus
from wrist_stiffness.web.figures import number

if TYPE_CHECKING:
    from wrist_stiffness.web.page import Workbench


class ModelsPanel:
    """The panel of one tab.

    Parameters
    ----------
    page : Workbench
        Whose it is.
    """

    def __init__(self, page: Workbench) -> None:
        self._page = page
        self._body = ui.column().classes("w-full gap-2")
        self.refresh()

    def refresh(self) -> None:
        """Say anew which models there are."""
        self._body.clear()
        with self._body:
            self._fill()

    def _fill(self) -> None:
        page, tab = self._page, self._page.tab
        if not tab.rows:
            ui.label("Open a recording first.")
            return
        for place, version in enumerate(tab.rows):
            shown = place == tab.version
            button = ui.button(on_click=partial(self._look, place))
            button.props(f"no-caps align=left dense {'unelevated' if shown else 'outline'}")
            button.classes("w-full flex-none")
            with button, ui.column().classes("w-full gap-0 items-start text-left px-1"):
                ui.label(f"{place}  {version.name}").classes("font-bold")
                ui.label(_sizes(version.held_out)).classes("text-xs")
                for key, (value, sigma) in version.parameters.items():
                    ui.label(f"{key} = {plus_minus(value, sigma)}").classes("text-xs")
                for warning in version.warnings:
                    ui.label(warning).classes("text-xs")
        with ui.row().classes("w-full items-center"):
            undo = ui.button("Undo the newest", on_click=lambda: page.work(("undo",), ("compare",)))
            undo.props("outline dense").set_enabled(len(tab.rows) > 1)
            write = ui.button("Export", on_click=lambda: page.work(("export", tab.version)))
            write.props("outline dense")
        others = {n: f"{n} {each.name}" for n, each in enumerate(tab.rows) if n != tab.version}
        if others:
            against = ui.select({-1: "nothing", **others}, label="compare in all pictures with")
            against.set_value(-1 if tab.against is None else tab.against)
            against.classes("w-full").props("dense").on_value_change(self._compare)
        for name in tab.written:
            path = page.workspace.path(name)
            ui.button(f"download {name}", on_click=lambda p=path: ui.download(p)).props(
                "flat dense"
            )
        if tab.written:
            ui.label(".txt: the same as commands; .html: the report").classes("text-xs")

    def _look(self, place: int) -> None:
        page = self._page
        if not page.busy:
            page.tab.version, page.tab.seen, page.tab.against = place, None, None
            page.refresh()

    def _compare(self, event: events.ValueChangeEventArguments) -> None:
        tab = self._page.tab
        tab.against, tab.seen = (None if event.value < 0 else int(event.value)), None
        self._page.views.refresh()


def _sizes(held_out: Mapping[str, float]) -> str:
    parts = []
    for key, size in held_out.items():
        name, _, unit = key.rpartition("_")
        parts.append(f"{name} {number(size)} {'µm' if unit == 'um' else unit}")
    return "unseen data: " + ", ".join(parts)
