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
        File to write; an older one is replaced.
    content : any
        Of dicts, lists, texts and numbers.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
