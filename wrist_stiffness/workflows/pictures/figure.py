"""What all pictures share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from wrist_stiffness.errors import InputError

DPI = 130


def new_figure(width_in: float, height_in: float) -> Any:
    """Return a figure that needs no screen."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def save_figure(figure: Any, path: Path) -> None:
    """Write a picture, complete or not at all.

    Parameters
    ----------
    figure : Figure
        Of `new_figure`.
    path : Path
        PNG file; an older one is replaced.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            figure.savefig(partial, dpi=DPI, format="png")
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
