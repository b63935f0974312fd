"""Results as JSON files, for programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError


def write_json(path: str | Path, content: Any) -> None:
    """Write a result, complete or not at all.

    `path`: file to write; an older one is replaced, a device or pipe is written to.  Raises
    `InputError` if the file cannot be written.
    """
    text = json.dumps(content, indent=2) + "\n"
    try:
        with replacing(path) as written:
            written.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
