"""Results as JSON files, for programs."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from wrist_stiffness.errors import InputError


def write_json(path: str | Path, content: Any) -> None:
    """Write a result, complete or not at all.

    Parameters
    ----------
    path : path
        File to write; an older one is replaced, a device or pipe is written to.
    content : any
        Of dicts, lists, texts and numbers.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    text = json.dumps(content, indent=2) + "\n"
    # Renaming onto /dev/null would put a file in its place, for every program of the machine.
    in_place = path.exists() and not path.is_file()
    target = path if in_place else path.resolve()
    written = target if in_place else target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        try:
            written.write_text(text, encoding="utf-8")
            if not in_place:
                os.replace(written, target)
        except BaseException:
            if not in_place:
                written.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
