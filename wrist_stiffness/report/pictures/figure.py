"""What all pictures share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wrist_stiffness.atomic_file import writing

DPI = 130

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""For series, in their order; more repeat: any colour vision tells them apart (Okabe and Ito)."""

FLOOR = "#444444"
"""For what noise alone does."""


def new_figure(width_in: float, height_in: float) -> Any:
    """Return a figure that needs no screen."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def over_angles(plot: Any) -> None:
    """Make a plot one over the angles of both motors [deg]."""
    plot.set_aspect("equal")
    plot.set_xlabel("motor 1 angle θ₁ [deg]")
    plot.set_ylabel("motor 2 angle θ₂ [deg]")


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure as PNG, complete or not at all (InputError if that fails)."""
    with writing(path) as written:
        figure.savefig(written, dpi=DPI, format="png")


def colour(number: int) -> str:
    """Return the colour of a series."""
    return COLOURS[number % len(COLOURS)]
