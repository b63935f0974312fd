"""Whole fits that a search makes: of the base, alone or along with effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wrist_stiffness.campaign.searching.base_fit import BaseFit, Walls, fit_base
from wrist_stiffness.campaign.unit_session import UnitSession
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel

Tell = Callable[[str], None]


def silent(text: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Fitter:
    """Fits the base of a model, alone or along with effects, and says so.

    Parameters
    ----------
    model : ErrorModel
        What is known of the wrist.
    tell : callable, optional
        Told what is being done.
    """

    model: ErrorModel
    tell: Tell = silent

    def __call__(
        self,
        sessions: tuple[UnitSession, ...],
        extras: Sequence[Effect] = (),
        start: BaseFit | None = None,
        beside: bool = False,
        walls: Walls = "sharp",
    ) -> BaseFit:
        """Fit as `fit_base`."""
        names = ", ".join(each.name for each in extras)
        self.tell(f"fitting the wrist with {names}" if extras else "fitting the wrist as it is")
        return fit_base(self.model, sessions, extras, start, beside, walls)
