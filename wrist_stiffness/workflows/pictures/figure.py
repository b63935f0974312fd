"""What all pictures share."""

from __future__ import annotations

from typing import Any

DPI = 130


def new_figure(width_in: float, height_in: float) -> Any:
    """Return a figure that needs no screen."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")
