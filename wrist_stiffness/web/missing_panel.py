"""What is missing: the verdict, every candidate, what the chosen one would explain, own laws."""

from __future__ import annotations

from functools import partial
from itertools import groupby
from typing import Any

from nicegui import ui

from wrist_stiffness.commands.extend import FormulaEffect, direction_of
from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.answer import Standing
from wrist_stiffness.model.formula_law import FORMULA_PLACES, SIGNALS
from wrist_stiffness.numerals import percent
from wrist_stiffness.report.diagnosis_report import chance_of, verdict_lines
from wrist_stiffness.web.bench import Seen
from wrist_stiffness.web.figures import spelled
from wrist_stiffness.web.tab import DEPENDS, VERSIONS, Tab

FIRST = 12
"""Candidates that are listed at once."""


class MissingPanel:
    """The panel of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        self._all = False
        self._last: Seen | None = None
        self._rival, self._grams = "", 50.0
        self._drawn: tuple[object, ...] = ()
        self._opened = tab.contents
        self._body = ui.column().classes("w-full gap-2")
        self._formula = FormulaForm(tab)
        self._list = ui.column().classes("w-full gap-2")
        tab.listeners.append(self.draw)
        self.draw()

    def draw(self) -> None:
        """Say anew what is missing, where it is something else."""
        tab = self._tab
        if tab.contents is not self._opened:
            self._opened = tab.contents
            self._formula.clear()
        told = tab.rows, tab.version, tab.told, tab.diagnosis, tab.seen, tab.planned, self._all
        if told == self._drawn:
            return
        self._drawn = told
        for part, fill in ((self._body, self._fill), (self._list, self._ranking)):
            part.clear()
            with part:
                fill()

    def _fill(self) -> None:
        tab, result = self._tab, self._tab.diagnosis
        if not tab.rows:
            ui.label("Open a recording first.")
            return
        with ui.expansion("What the error depends on", value=result is None).classes("w-full"):
            for line in tab.told.sentences if tab.told else ("Not asked yet.",):
                ui.label(spelled(line)).classes("text-sm mb-1")
        ask = ui.button("What is missing?", on_click=lambda: tab.work(("rank",)))
        ask.classes("w-full").props("data-focus=ask").props("outline" if result else "")
        if result is not None:
            for line in verdict_lines(result):
                ui.label(spelled(line)).classes("font-bold")
            self._proposals()
        self._chosen()

    def _proposals(self) -> None:
        """Offer the laws that are proposed where nothing on the list fits."""
        for role, law in self._tab.offers:
            text = f"{role} ({percent(law['probability'])}): {spelled(law['sentence'])}"
            offer = ui.button(on_click=partial(self._formula.propose, law))
            offer.props("outline dense align=left").classes("w-full")
            with offer:
                ui.label(text).classes("text-left px-1")

    def _ranking(self) -> None:
        result = self._tab.diagnosis
        if result is None:
            return
        ui.label("Candidates, most probable first. Click one to see what it would explain.")
        alike = {
            name: ", ".join(other for other in finding.names if other != name)
            for finding in (*result.findings, *result.suspects)
            for name in finding.names
        }
        listed = result.standings if self._all else result.standings[:FIRST]
        with ui.column().classes("w-full gap-1"):
            for why, group in groupby(listed, key=lambda each: each.why_not):
                ui.label((why or "named") + ":").classes("text-xs text-gray-600 mt-1")
                for standing in group:
                    self._candidate(standing, alike.get(standing.name, ""))
        if len(listed) < len(result.standings):
            more = ui.button(f"Show all {len(result.standings)}", on_click=self._more)
            more.props("flat dense")
        if result.not_excited:
            title = f"{len(result.not_excited)} effects are not excited by these recordings"
            with ui.expansion(title).classes("w-full"):
                ui.label("They are neither found nor ruled out. What would show them:")
                for each in result.not_excited:
                    text = f"{each.effect}@{each.component}: {each.needs}"
                    ui.label(text).classes("text-xs mt-1")

    def _more(self) -> None:
        self._all = True
        self.draw()

    def _candidate(self, standing: Standing, alike: str) -> None:
        tab, name = self._tab, standing.name
        chosen = name == tab.candidate
        button = ui.button(on_click=lambda: tab.work(("look_at", name), then=("", DEPENDS)))
        button.props(f"align=left dense {'unelevated' if chosen else 'outline'}")
        button.props(f"data-focus={name} {'aria-current=true' if chosen else ''}")
        button.classes("w-full")
        with button, ui.column().classes("w-full gap-0 items-start text-left px-1"):
            with ui.row().classes("w-full justify-between no-wrap"):
                ui.label(name).classes("font-bold")
                ui.label(chance_of(standing))
            if (chance := standing.probability or 0.0) >= 0.01:
                ui.linear_progress(chance, show_value=False).props(
                    "color=orange-9 track-color=grey-4 aria-hidden=true"
                )
            if alike:
                ui.label(f"not distinguishable from {alike}").classes("text-xs")

    def _chosen(self) -> None:
        """Say what the chosen candidate would explain, and how to be sure of it."""
        tab, seen, shown = self._tab, self._tab.seen, self._tab.shown
        if seen is None or shown is None or shown.after is None:
            return
        box = ui.column().classes("w-full gap-1 p-2 rounded").style("background: #fff7ed")
        if seen is not self._last:
            self._last = seen
            ui.run_javascript(f"getHtmlElement({box.id}).scrollIntoView({{block: 'nearest'}})")
        with box:
            ui.label(f"If {seen.name} were added").classes("font-bold")
            ui.label(f"{seen.sentence}.").classes("text-sm")
            for quantity in tab.quantities:
                ui.label(f"{spelled(quantity.name)}: {shown.fall(quantity)} on these data")
            for name, value in seen.parameters.items():
                ui.label(f"{name} = {value:.3g}").classes("text-sm")
            if seen.check:
                ui.label(f"Check on the machine: {seen.check}.").classes("text-sm")
            then = "Models", VERSIONS
            add = ui.button("Add it", on_click=lambda: tab.work(("add",), then=then))
            add.classes("w-full").props("color=deep-orange-9 data-focus=add")
            self._deciding(seen)

    def _deciding(self, seen: Seen) -> None:
        """Offer the experiment that tells what is looked at from a rival."""
        tab = self._tab
        names = [each.name for each in tab.diagnosis.standings] if tab.diagnosis else []
        if seen.name not in names or len(names) < 2:
            return
        names.remove(seen.name)
        text, folder = tab.planned
        with ui.expansion("Which experiment would decide?", value=bool(text)).classes("w-full"):
            first = self._rival if self._rival in names else names[0]
            rival = ui.select(names, value=first, label="against").classes("w-full")
            grams = ui.number("weight that you can hang on [g]", value=self._grams)
            grams.classes("w-full").props("dense")

            def plan() -> None:
                self._rival, self._grams = str(rival.value), float(grams.value or 0.0)
                tab.work(("plan", [seen.name, self._rival], self._grams))

            button = ui.button("Plan it", on_click=plan).classes("w-full mt-2")
            button.props("outline dense data-focus=plan")
            if text:
                ui.label(spelled(text)).classes("text-sm whitespace-pre-line")
            if folder:
                ui.label(f"Written into the workspace: {folder}").classes("text-xs")


class FormulaForm:
    """The form of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        props = "dense outlined stack-label"
        with ui.expansion("An effect of your own, by formula").classes("w-full") as self._form:
            self._name = ui.input("name").props(props)
            self._formula = ui.input("formula", placeholder="lift_um * clamp_bar").props(props)
            places = list(FORMULA_PLACES)
            self._place = ui.select(places, label="at which part").props(props)
            self._way = ui.input("direction").props(props)
            self._said = ui.label("").classes("text-xs")
            self._look = ui.button("See what it would explain", on_click=self._looked)
            self._fields = self._name, self._formula, self._place, self._way
            for field in self._fields:
                field.classes("w-full").on_value_change(self._check)
            self._look.classes("w-full mt-1")
        tab.listeners.append(self._check)
        self.clear()

    def clear(self) -> None:
        """Begin anew: what was written of one recording says nothing of another."""
        self._write("own_effect", "", "frame", "along +z")
        self._check()

    def propose(self, law: dict[str, Any]) -> None:
        """Fill the form with a law that was proposed."""
        self._write("proposed", law["formula"], law["component"], law["direction"])
        self._form.set_value(True)
        ui.run_javascript(f"getHtmlElement({self._look.id}).scrollIntoView({{block: 'nearest'}})")

    def _write(self, *values: str) -> None:
        for field, value in zip(self._fields, values, strict=True):
            field.set_value(value)

    def _effect(self) -> FormulaEffect:
        """Return what is typed, read and in no case run (InputError if it is no effect)."""
        way = direction_of(str(self._way.value).split())
        own = str(self._name.value), str(self._place.value), way, str(self._formula.value)
        found = FormulaEffect(*own, {})
        found.effect(self._tab.covariates)
        return found

    def _check(self) -> None:
        """Say whether what is typed can be fitted to what is opened."""
        try:
            if not str(self._formula.value or "").strip():
                names = ", ".join([*self._tab.covariates, *sorted(SIGNALS)])
                raise InputError(
                    f"It may use: {names}; a name that ends in a unit (_um, _mdeg, _N ...) is a "
                    "number to be found"
                )
            self._effect()
        except InputError as error:
            self._said.text, good = str(error), False
        else:
            self._said.text, good = "This can be fitted.", True
        self._look.set_enabled(good)

    def _looked(self) -> None:
        try:
            self._tab.work(("look_at", self._effect()))
        except InputError as error:
            ui.notify(str(error), type="warning", multi_line=True)
