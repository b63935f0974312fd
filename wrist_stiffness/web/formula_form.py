"""An own effect by formula, checked while it is typed."""

from __future__ import annotations

from nicegui import ui

from wrist_stiffness.commands.extend import FormulaEffect, direction_of
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.formula_law import FORMULA_PLACES, SIGNALS
from wrist_stiffness.web.bench import Offer
from wrist_stiffness.web.tab import Tab


class FormulaForm:
    """The form of one tab."""

    def __init__(self, tab: Tab) -> None:
        self._tab = tab
        props = "dense outlined stack-label"
        with ui.expansion("An effect of your own, by formula").classes("w-full") as self._form:
            self._name = ui.input("name", value="own_effect").props(props)
            self._formula = ui.input("formula", placeholder="lift_um * clamp_bar").props(props)
            places = list(FORMULA_PLACES)
            self._place = ui.select(places, value="frame", label="at which part").props(props)
            self._way = ui.input("direction", value="along +z").props(props)
            self._said = ui.label("").classes("text-xs")
            self._look = ui.button("See what it would explain", on_click=self._looked)
            for field in (self._name, self._formula, self._place, self._way):
                field.classes("w-full").on_value_change(self._check)
            self._look.classes("w-full mt-1")
        self._check()

    def propose(self, law: Offer) -> None:
        """Fill the form with a law that was proposed."""
        self._formula.set_value(law.formula)
        self._place.set_value(law.component)
        self._way.set_value(law.way)
        self._name.set_value("proposed")
        self._form.set_value(True)
        ui.run_javascript(f"getHtmlElement({self._look.id}).scrollIntoView({{block: 'nearest'}})")

    def _effect(self) -> FormulaEffect:
        """Return what is typed; it is read here and in no case run.

        Raises `InputError` if it cannot be an effect.
        """
        way = direction_of(str(self._way.value).split())
        own = str(self._name.value), str(self._place.value), way, str(self._formula.value)
        found = FormulaEffect(*own, {})
        found.effect(self._tab.covariates)
        return found

    def _check(self) -> None:
        try:
            if not str(self._formula.value or "").strip():
                names = ", ".join([*self._tab.covariates, *sorted(SIGNALS)])
                raise InputError(f"It may use: {names}; any other name is a number to be found")
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
