"""The page: what is opened, where it fails, what is missing, and the models on the way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nicegui import background_tasks, events, run, ui

from wrist_stiffness.web.missing_panel import MissingPanel
from wrist_stiffness.web.models_panel import ModelsPanel
from wrist_stiffness.web.open_panel import OpenPanel
from wrist_stiffness.web.tab import Tab
from wrist_stiffness.web.views import Views
from wrist_stiffness.web.workspace import Workspace

STYLE = """
body { background: #f3f4f6; }
.panel { background: white; border: 1px solid #d1d5db; border-radius: 6px; padding: 8px; }
.nicegui-content { padding: 0; gap: 0; }
.q-tab__label { text-transform: none; font-weight: 600; }
.q-btn { text-transform: none; }
*:focus-visible { outline: 3px solid #d55e00 !important; outline-offset: 1px; }
"""


class Workbench:
    """The page of one tab.

    Parameters
    ----------
    workspace : Workspace
        Where recordings and models lie.
    largest : int
        Of an upload [bytes].
    """

    def __init__(self, workspace: Workspace, largest: int) -> None:
        self.workspace = workspace
        self.tab = Tab(workspace.folder)
        self.busy = False
        ui.add_css(STYLE)
        ui.colors(primary="#0072b2")
        with ui.row().classes("w-full items-center no-wrap px-3 py-1 gap-4 bg-white shadow-1"):
            ui.label("Wrist workbench").classes("text-lg font-bold whitespace-nowrap")
            self.title = ui.label("nothing opened").classes("text-gray-700 ellipsis")
            ui.space()
            with ui.row().classes("items-center no-wrap gap-2").props("id=busy") as self.status:
                ui.spinner(size="sm")
                self.words = ui.label("").classes("whitespace-nowrap")
                self.bar = ui.linear_progress(0.0, show_value=False).classes("w-24")
                ui.button("Cancel", on_click=self._cancel).props("dense outline color=red")
        self.status.visible = False
        with ui.row().classes("w-full no-wrap gap-2 p-2 items-stretch"):
            with ui.column().classes("panel gap-1").style("width: 400px; flex: none"):
                with ui.tabs().props("dense align=justify").classes("w-full") as self.tabs:
                    for number, name in enumerate(("Open", "Missing", "Models"), 1):
                        ui.tab(name, f"{number} {name}")
                scroll = "height: calc(100vh - 110px); overflow-y: auto"
                with ui.tab_panels(self.tabs, value="Open").classes("w-full").style(scroll):
                    with ui.tab_panel("Open").classes("p-1 gap-2"):
                        self.open = OpenPanel(self, largest)
                    with ui.tab_panel("Missing").classes("p-1 gap-2"):
                        self.missing = MissingPanel(self)
                    with ui.tab_panel("Models").classes("p-1 gap-2"):
                        self.models = ModelsPanel(self)
            with ui.column().classes("grow gap-2").style("min-width: 0"):
                self.views = Views(self)
        self.timer = ui.timer(0.2, self._watch)
        ui.context.client.on_delete(self.tab.worker.end)
        ui.keyboard(on_key=self._key)

    def work(self, *calls: Sequence[Any], then: str = "") -> None:
        """Do things that take long, one after the other, the page drawn anew after each.

        Parameters
        ----------
        calls : tuples
            Name of a method of `bench.Bench`, and its arguments.
        then : str, optional
            Panel to go to when all went well.
        """
        if self.busy:
            ui.notify("Something is being done: wait, or cancel it first", type="warning")
            return
        self.busy = True
        self._watch()
        background_tasks.create(self._work(calls, then))

    async def _work(self, calls: Sequence[Sequence[Any]], then: str) -> None:
        why = ""
        for method, *arguments in calls:
            why = await run.io_bound(self.tab.work, method, *arguments) or ""
            if why:
                break
            if method.startswith("open"):
                self.views.begin()
            self.refresh()
        self.busy = False
        self._watch()
        with self.status:
            if why == "cancelled":
                ui.notify("Cancelled; everything is as it was")
            elif why:
                ui.notify(why, type="warning", multi_line=True, close_button="OK", timeout=0)
            elif then:
                self.tabs.set_value(then)

    def refresh(self) -> None:
        """Draw everything anew."""
        tab = self.tab
        if tab.rows:
            self.title.text = f"{', '.join(tab.names)}; model {tab.model_path.stem}"
        self.open.refresh()
        self.missing.refresh()
        self.models.refresh()
        self.views.refresh()

    def _watch(self) -> None:
        self.status.visible = self.busy
        self.words.text = self.tab.words
        self.bar.value = self.tab.done / self.tab.total if self.tab.total else 0.0

    def _cancel(self) -> None:
        self.tab.worker.cancel()

    def _key(self, event: events.KeyEventArguments) -> None:
        if event.action.keydown and event.key == "Escape" and self.busy:
            self._cancel()
