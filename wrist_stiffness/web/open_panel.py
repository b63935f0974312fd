"""Open recordings and a model, and what is in them at a glance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import events, run, ui

from wrist_stiffness.errors import InputError
from wrist_stiffness.web.examples import EXAMPLES, Example

if TYPE_CHECKING:
    from wrist_stiffness.web.page import Workbench


class OpenPanel:
    """The panel of one tab.

    Parameters
    ----------
    page : Workbench
        Whose it is.
    largest : int
        Of an upload [bytes].
    """

    def __init__(self, page: Workbench, largest: int) -> None:
        self._page = page
        self._glance = ui.column().classes("w-full gap-1")
        ui.label("Examples").classes("font-bold")
        for example in EXAMPLES:
            self._card(example)
        ui.label("Your own").classes("font-bold mt-2")
        with ui.column().classes("w-full gap-1"):
            own = page.workspace
            self._names = ui.select(
                own.recordings(), multiple=True, label="recordings in the workspace"
            )
            self._names.classes("w-full").props("dense outlined use-chips")
            self._model = ui.select(["", *own.models()], value="", label="model (empty: shipped)")
            self._model.classes("w-full").props("dense outlined")
            ui.button("Open", on_click=self._open).props("dense").classes("w-full")
            ui.upload(
                label=f"or drop .mcap, .csv, .yaml, .npz here (up to {largest // 2**20} MB)",
                multiple=True,
                auto_upload=True,
                max_file_size=largest,
                on_upload=self._uploaded,
                on_rejected=lambda: ui.notify("That file is too large", type="warning"),
            ).classes("w-full").props("flat bordered")
            ui.label(f"workspace: {own.folder}").classes("text-xs text-gray-600 break-all")

    def _card(self, example: Example) -> None:
        page = self._page

        def chosen() -> None:
            page.work(("open_example", example.name), ("calibrate",), ("compare",))

        card = ui.button(on_click=chosen).props("outline no-caps align=left")
        card.classes("w-full flex-none")
        with card, ui.column().classes("gap-0 items-start text-left"):
            ui.label(example.title).classes("font-bold")
            ui.label(example.story).classes("text-gray-700 text-xs normal-case")

    def _open(self) -> None:
        page = self._page
        names, model = list(self._names.value or []), str(self._model.value or "")
        page.work(("open_named", names, model), ("calibrate",), ("compare",))

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        workspace = self._page.workspace
        try:
            content = await event.file.read()
            name = event.file.name
            await run.io_bound(workspace.save, name, content)
        except InputError as error:
            ui.notify(str(error), type="warning", multi_line=True)
            return
        self._names.set_options(workspace.recordings())
        self._model.set_options(["", *workspace.models()])
        if name in workspace.recordings():
            self._names.set_value([*(self._names.value or []), name])
        elif name in workspace.models():
            self._model.set_value(name)

    def refresh(self) -> None:
        """Say anew what is opened."""
        tab = self._page.tab
        self._glance.clear()
        with self._glance:
            if tab.glances:
                ui.label("What is in it").classes("font-bold")
            for rows in tab.glances:
                with ui.grid(columns="auto 1fr").classes("w-full gap-x-3 gap-y-0 text-sm"):
                    for name, value in rows.items():
                        ui.label(name).classes("text-gray-600")
                        ui.label(value)
                ui.separator()
            for remark in tab.remarks:
                ui.label(remark).classes("text-xs text-orange-800")
