"""An own effect by formula, checked while it is typed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from wrist_stiffness.commands.extend import FormulaEffect, direction_of
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.formula_law import SIGNALS
from wrist_stiffness.model.places import LIMB

if TYPE_CHECKING:
    from wrist_stiffness.comparing.curve import Curve
    from wrist_stiffness.web.page import Workbench


class FormulaForm:
    """The form of one tab.

    Parameters
    ----------
    page : Workbench
        Whose it is.
    """

    def __init__(self, page: Workbench) -> None:
        self._page = page
        props = "dense outlined stack-label"
        with ui.expansion("An effect of your own, by formula").classes("w-full") as self._form:
            self._name = ui.input("name", value="own_effect").props(props)
            self._formula = ui.input("formula", placeholder="lift_um * clamp_bar").props(props)
            self._place = ui.select(list(LIMB), value="frame", label="at which part").props(props)
            self._way = ui.input("direction", value="along +z").props(props)
            self._said = ui.label("").classes("text-xs")
            self._look = ui.button("See what it would explain", on_click=self._looked)
            for field in (self._name, self._formula, self._place, self._way):
                field.classes("w-full").on_value_change(self._check)
            self._look.classes("w-full mt-1")
        self._check()

    def propose(self, condition: str, curve: Curve) -> None:
        """Fill the form with a straight line over a condition, in the direction that was seen."""
        unit = "um" if curve.quantity.name == "s" else "mdeg"
        self._formula.set_value(f"size_{unit} * {condition}")
        self._way.set_value(curve.where)
        self._name.set_value(f"by_{condition}".lower())
        self._form.set_value(True)

    def _effect(self) -> FormulaEffect:
        """Return what is typed; it is read here and in no case run.

        Raises
        ------
        InputError
            If it cannot be an effect.
        """
        way = direction_of(str(self._way.value).split())
        own = str(self._name.value), str(self._place.value), way, str(self._formula.value)
        found = FormulaEffect(*own, {})
        found.effect(self._page.tab.covariates)
        return found

    def _check(self) -> None:
        try:
            if not str(self._formula.value or "").strip():
                names = ", ".join([*self._page.tab.covariates, *sorted(SIGNALS)])
                raise InputError(f"It may use: {names}; any other name is a number to be found")
            self._effect()
        except InputError as error:
            self._said.text, good = str(error), False
        else:
            self._said.text, good = "This can be fitted.", True
        self._look.set_enabled(good)

    def _looked(self) -> None:
        try:
            self._page.work(("look_at", self._effect()))
        except InputError as error:
            ui.notify(str(error), type="warning", multi_line=True)
