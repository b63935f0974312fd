"""Open recordings and a model, and what is in them at a glance."""

from __future__ import annotations

from functools import partial

import numpy as np
from nicegui import events, run, ui

from wrist_stiffness.errors import InputError
from wrist_stiffness.numerals import number
from wrist_stiffness.sessions.contents import Contents
from wrist_stiffness.web.examples import EXAMPLES
from wrist_stiffness.web.figures import spelled
from wrist_stiffness.web.tab import Tab

SHIPPED = "shipped model"

UPLOAD = """
<div class="row no-wrap items-center q-pa-sm">
  <q-btn type="a" icon="add" flat dense aria-label="choose files"><q-uploader-add-trigger /></q-btn>
  <div class="q-ml-sm">Drop .mcap, .csv, .yaml, .npz here (up to {limit} MB)</div>
</div>
"""
"""Quasar's own button that chooses files has no name."""


class OpenPanel:
    """The panel of one tab; `largest`: of an upload [bytes]."""

    def __init__(self, tab: Tab, largest: int) -> None:
        self._tab = tab
        self._glance = ui.column().classes("w-full gap-1")
        own = tab.workspace
        with ui.expansion("Your own recordings", value=True).classes("w-full dense") as self._own:
            files = ui.upload(
                multiple=True,
                auto_upload=True,
                max_file_size=largest,
                on_upload=self._uploaded,
                on_rejected=lambda: ui.notify("That file is too large", type="warning"),
            )
            files.classes("w-full drop").props("flat bordered")
            files.add_slot("header", UPLOAD.format(limit=largest // 2**20))
            self._names = ui.select(own.recordings(), multiple=True, label="recordings")
            self._names.classes("w-full").props("dense use-chips")
            self._model = ui.select([SHIPPED, *own.models()], value=SHIPPED, label="model")
            self._model.classes("w-full").props("dense")
            ui.button("Open", on_click=self._open).classes("w-full mt-2")
            ui.label(f"workspace: {own.folder}").classes("text-xs text-gray-600 break-all mt-1")
        with ui.expansion("Examples", value=True).classes("w-full dense") as self._examples:
            for example in EXAMPLES:
                card = ui.button(on_click=partial(self._begin, "open_example", example.name))
                card.props("outline align=left").classes("w-full flex-none mb-2")
                with card, ui.column().classes("gap-0 items-start text-left"):
                    ui.label(example.title).classes("font-bold")
                    ui.label(example.story).classes("text-gray-700 text-xs")
        tab.listeners.append(self.draw)

    def _begin(self, *call: object) -> None:
        self._tab.work(call, ("calibrate",))

    def _open(self) -> None:
        model = self._model.value
        names = list(self._names.value or [])
        self._begin("open_named", names, "" if model == SHIPPED else str(model))

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        workspace, name = self._tab.workspace, event.file.name
        try:
            await run.io_bound(workspace.save, name, await event.file.read())
        except InputError as error:
            ui.notify(str(error), type="warning", multi_line=True)
            return
        self._names.set_options(workspace.recordings())
        self._model.set_options([SHIPPED, *workspace.models()])
        if name in workspace.recordings():
            self._names.set_value([*(self._names.value or []), name])
        elif name in workspace.models():
            self._model.set_value(name)

    def draw(self) -> None:
        """Say anew what is opened."""
        tab = self._tab
        if not self._glance.default_slot.children:
            self._own.set_value(False)
            self._examples.set_value(False)
        self._glance.clear()
        with self._glance:
            ui.label("What is in it").classes("font-bold")
            rows = [_told(each) for each in tab.contents]
            columns = f"auto repeat({len(rows)}, minmax(0, 1fr))"
            with ui.grid(columns=columns).classes("w-full gap-x-3 gap-y-0 text-sm"):
                for name in rows[0]:
                    ui.label(name).classes("text-gray-600")
                    for each in rows:
                        ui.label(each[name]).classes("break-words")
            if tab.told is not None:
                idle = ", ".join(tab.told.not_varied)
                text = f"Not varied, so nothing can be said of: {idle}."
                ui.label(text if idle else "Every recorded condition was varied.")
                if tab.told.mistake:
                    ui.label(spelled(tab.told.mistake)).classes("font-bold text-orange-900")
            for remark in tab.remarks:
                ui.label(spelled(remark)).classes("text-xs text-orange-800")


def _told(each: Contents) -> dict[str, str]:
    """Return what a recording holds, in words."""
    (low_1, high_1), (low_2, high_2) = np.degrees(each.angles)
    sizes = [(*key.split("_"), number(size)) for key, size in each.registered.items()]
    return {
        "recording": each.name,
        "duration": f"{each.duration_s / 60.0:.1f} min",
        "pose samples": f"{each.measured:,} at {float(f'{each.rate_hz:.3g}'):,g} Hz",
        "poses held": f"{each.dwells:,}",
        "motor 1": f"{low_1:.0f} to {high_1:.0f}°",
        "motor 2": f"{low_2:.0f} to {high_2:.0f}°",
        "speed": f"up to {np.degrees(each.speed[1]):.0f} deg/s",
        "load": f"{each.force[0]:.2f} to {each.force[1]:.2f} N",
        "instrument": each.instrument,
        "registered to": ", ".join(spelled(f"{name} {size} {unit}") for name, unit, size in sizes),
        "other signals": ", ".join(each.signals) or "none",
    }
