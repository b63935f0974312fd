"""The models on the way: their error on unseen data, an own formula, what to take home."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from nicegui import ui

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
        for number, version in enumerate(tab.rows):
            shown = number == tab.version
            button = ui.button(on_click=lambda number=number: self._look(number))
            button.props(f"no-caps align=left dense {'unelevated' if shown else 'outline'}")
            button.classes("w-full")
            with button, ui.column().classes("w-full gap-0 items-start text-left px-1"):
                ui.label(f"{number}  {version.name}").classes("font-bold")
                ui.label(_sizes(version.held_out)).classes("text-xs")
                for warning in version.warnings:
                    ui.label(warning).classes("text-xs")
        ui.button("Undo the newest", on_click=lambda: page.work(("undo",))).props("outline dense")

    def _look(self, number: int) -> None:
        page = self._page
        if not page.busy:
            page.tab.version, page.tab.seen = number, None
            page.refresh()


def _sizes(held_out: Mapping[str, float]) -> str:
    parts = []
    for key, size in held_out.items():
        name, _, unit = key.rpartition("_")
        parts.append(f"{name} {size:.3g} {'µm' if unit == 'um' else unit}")
    return "unseen data: " + ", ".join(parts)
