"""What is missing: the verdict, every candidate, and what the chosen one would explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from wrist_stiffness.comparing.sentences import percent
from wrist_stiffness.model.formula_law import SIGNALS
from wrist_stiffness.report.diagnosis_lines import verdict_lines
from wrist_stiffness.web.formula_form import FormulaForm

if TYPE_CHECKING:
    from wrist_stiffness.inference.answer import Diagnosis, Standing
    from wrist_stiffness.web.bench import Seen
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
        self._last: Seen | None = None
        self._grams = 50.0
        self._body = ui.column().classes("w-full gap-2")
        self.formula = FormulaForm(page)
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
        with ui.expansion("On what the error depends", value=tab.diagnosis is None).classes(
            "w-full"
        ):
            for line in tab.sentences or ("Not asked yet.",):
                ui.label(line).classes("text-sm")
        ui.button("What is missing?", on_click=lambda: page.work(("rank",))).classes("w-full")
        if tab.diagnosis is None:
            return
        result = tab.diagnosis
        for line in verdict_lines(result):
            ui.label(line).classes("font-bold")
        if result.verdict == "unknown":
            self._proposals()
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

    def _proposals(self) -> None:
        """Offer a formula for every recorded signal on which the error surely depends."""
        known = SIGNALS | set(self._page.tab.covariates)
        for name, curve in self._page.tab.curves.items():
            if (signal := curve.names[0]) in known:
                text = f"Try a straight line over {name}"
                offer = ui.button(
                    text, on_click=lambda s=signal, c=curve: self.formula.propose(s, c)
                )
                offer.props("outline dense").classes("w-full")

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
        box = ui.column().classes("w-full gap-1 p-2 rounded").style("background: #fff7ed")
        if seen is not self._last:
            self._last = seen
            ui.run_javascript(f"getHtmlElement({box.id}).scrollIntoView({{block: 'nearest'}})")
        with box:
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
            calls = ("add",), ("compare",)
            add = ui.button("Add it", on_click=lambda: page.work(*calls, then="Models"))
            add.classes("w-full").props("color=deep-orange-9")
            self._deciding(seen)

    def _deciding(self, seen: Seen) -> None:
        """Offer the experiment that tells what is looked at from a rival."""
        page, tab = self._page, self._page.tab
        if tab.diagnosis is None:
            return
        names = [each.name for each in tab.diagnosis.standings if each.name != seen.name]
        if seen.name not in {each.name for each in tab.diagnosis.standings} or not names:
            return
        with ui.expansion("Which experiment would decide?").classes("w-full"):
            rival = ui.select(names, value=names[0], label="against").props("dense")
            grams = ui.number("weight that you can hang on [g]", value=self._grams).props("dense")

            def plan() -> None:
                self._grams = float(grams.value or 0.0)
                page.work(("plan", [seen.name, str(rival.value)], self._grams))

            ui.button("Plan it", on_click=plan).props("outline dense").classes("w-full")
            text, folder = tab.planned
            if text:
                ui.label(text).classes("text-sm whitespace-pre-line")
            if folder:
                ui.label(f"written into the workspace: {folder}").classes("text-xs")
