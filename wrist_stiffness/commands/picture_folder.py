"""The folder that pictures go to."""

from __future__ import annotations

from pathlib import Path

from wrist_stiffness.errors import InputError


def picture_folder(folder: str | Path) -> Path:
    """Return a folder, made if missing; an `InputError` if it cannot be."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from error
    return folder
