"""What is missing: the verdict, every candidate, and what the chosen one would explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from wrist_stiffness.campaign.comparing.sentences import percent
from wrist_stiffness.workflows.verdict import verdict_lines

if TYPE_CHECKING:
    from wrist_stiffness.inference.answer import Diagnosis, Standing
    from wrist_stiffness.web.page import Workbench

FIRST = 12
"""Candidates that are listed at once."""


class MissingPanel:
    """The panel of one tab.

    Parameters
    ----------
    page : Workbench
        Whose it is.
    """

    def __init__(self, page: Workbench) -> None:
        self._page = page
        self._all = False
        self._body = ui.column().classes("w-full gap-2")
        self.refresh()

    def refresh(self) -> None:
        """Say anew what is missing."""
        self._body.clear()
        with self._body:
            self._fill()

    def _fill(self) -> None:
        page, tab = self._page, self._page.tab
        if not tab.rows:
            ui.label("Open a recording first.")
            return
        for line in tab.sentences:
            ui.label(line).classes("text-sm")
        ui.button("What is missing?", on_click=lambda: page.work(("rank",))).classes("w-full")
        if tab.diagnosis is None:
            return
        result = tab.diagnosis
        for line in verdict_lines(result):
            ui.label(line).classes("font-bold")
        self._chosen()
        ui.label(
            "Candidates, most probable first; choose one to see what it would explain"
        ).classes("text-sm text-gray-700")
        listed = result.standings if self._all else result.standings[:FIRST]
        for standing in listed:
            self._candidate(standing, result)
        if not self._all:
            ui.button(f"all {len(result.standings)}", on_click=self._more).props("flat dense")
        if result.not_excited:
            with ui.expansion(f"{len(result.not_excited)} that these data cannot show").classes(
                "w-full"
            ):
                for each in result.not_excited:
                    ui.label(f"{each.effect}@{each.component}: {each.needs}").classes("text-xs")

    def _more(self) -> None:
        self._all = True
        self.refresh()

    def _candidate(self, standing: Standing, result: Diagnosis) -> None:
        page, tab = self._page, self._page.tab
        name = standing.name
        others = [
            other
            for finding in (*result.findings, *result.suspects)
            if name in finding.names
            for other in finding.names
            if other != name
        ]
        chosen = name == tab.candidate
        button = ui.button(on_click=lambda: page.work(("look_at", name)))
        button.props(f"no-caps align=left dense {'unelevated' if chosen else 'outline'}")
        button.classes("w-full")
        with button, ui.column().classes("w-full gap-0 items-start text-left px-1"):
            with ui.row().classes("w-full justify-between no-wrap"):
                ui.label(name).classes("font-bold")
                ui.label(percent(standing.probability))
            ui.linear_progress(standing.probability, show_value=False).props(
                "color=orange-9 track-color=grey-4"
            )
            if standing.why_not:
                ui.label(standing.why_not).classes("text-xs")
            if others:
                ui.label(f"cannot be told from {', '.join(others)}").classes("text-xs")

    def _chosen(self) -> None:
        """Say what the chosen candidate would explain, and how to be sure of it."""
        page, tab = self._page, self._page.tab
        seen = tab.seen
        if seen is None:
            return
        with ui.column().classes("w-full gap-1 p-2 rounded").style("background: #fff7ed"):
            ui.label(f"If {seen.name} were added").classes("font-bold")
            ui.label(seen.sentence).classes("text-sm")
            for key, (before, after) in seen.explains.items():
                quantity, _, unit = key.rpartition("_")
                unit = "µm" if unit == "um" else unit
                ui.label(f"{quantity}: {before:.3g} → {after:.3g} {unit} on these data")
            for name, value in seen.parameters.items():
                ui.label(f"{name} = {value:.3g}").classes("text-sm")
            if seen.check:
                ui.label(f"To be sure: {seen.check}").classes("text-sm")
            calls = ("add", seen.name), ("compare",)
            add = ui.button("Add it", on_click=lambda: page.work(*calls, then="Models"))
            add.classes("w-full").props("color=deep-orange-9")
