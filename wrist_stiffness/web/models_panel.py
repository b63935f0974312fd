"""The models on the way: their error on held-out data, and what to take home."""

from __future__ import annotations

from functools import partial

from nicegui import events, ui

from wrist_stiffness.numerals import number, plus_minus
from wrist_stiffness.web.figures import spelled
from wrist_stiffness.web.tab import VERSIONS, Tab


class ModelsPanel:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self._versions = ui.column().classes("w-full gap-2")
        with ui.row().classes("w-full items-center"):
            then = "", VERSIONS
            undo = ui.button("Undo the newest", on_click=lambda: tab.work(("undo",), then=then))
            write = ui.button("Export", on_click=lambda: tab.work(("export", tab.version)))
            for button in (undo, write):
                button.props("outline dense")
        undo.bind_enabled_from(tab, "rows", lambda rows: len(rows) > 1)
        write.bind_enabled_from(tab, "rows", bool)
        # It stays where it is: a menu that is made anew while it closes never closes.
        self._against = ui.select({-1: "nothing"}, value=-1, label="compare in all pictures with")
        self._against.classes("w-full").props("dense").on_value_change(self._compare)
        self._against.bind_visibility_from(tab, "rows", lambda rows: len(rows) > 1)
        self._written = ui.column().classes("w-full gap-2")
        tab.listeners.append(self.draw)
        self.draw()

    def draw(self) -> None:
        """Say anew which models there are."""
        tab = self._tab
        for part, fill in ((self._versions, self._list), (self._written, self._files)):
            part.clear()
            with part:
                fill()
        others = {n: each.titled(n) for n, each in enumerate(tab.rows) if n != tab.version}
        chosen = -1 if tab.against is None else tab.against
        self._against.set_options({-1: "nothing", **others}, value=chosen)

    def _list(self) -> None:
        tab = self._tab
        if not tab.rows:
            ui.label("Open a recording first.")
        for place, version in enumerate(tab.rows):
            shown = place == tab.version
            button = ui.button(on_click=partial(tab.look, place))
            button.props(f"align=left dense {'unelevated' if shown else 'outline'}")
            button.props(f"data-focus=version-{place} {'aria-current=true' if shown else ''}")
            button.classes("w-full flex-none")
            with button, ui.column().classes("w-full gap-0 items-start text-left px-1"):
                ui.label(f"{place}  {version.name}").classes("font-bold")
                sizes = ", ".join(
                    spelled(f"{q.name} {number(version.held_out[q.key])} {q.unit}")
                    for q in tab.quantities
                    if q.key in version.held_out
                )
                note = " (instrument not registered)" if place == 0 else ""
                ui.label(f"held-out error: {sizes}{note}").classes("text-xs")
                for key, (value, sigma) in version.parameters.items():
                    ui.label(f"{key} = {spelled(plus_minus(value, sigma))}").classes("text-xs")
                for warning in version.warnings:
                    ui.label(f"Check: {spelled(warning)}").classes("text-xs")

    def _files(self) -> None:
        tab = self._tab
        if tab.written:
            ui.label("Written into the workspace:").classes("text-sm")
        for name, what in tab.written:
            path = tab.workspace.path(name)
            save = ui.button(f"{what}: {name}", on_click=partial(ui.download, path))
            save.props("flat dense icon=download align=left").classes("w-full")

    def _compare(self, event: events.ValueChangeEventArguments) -> None:
        tab, asked = self._tab, None if event.value < 0 else int(event.value)
        if asked != tab.against:
            tab.against, tab.seen = asked, None
            tab.draw()
