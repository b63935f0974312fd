"""Opening a file to read, so that none can stall or exhaust the reader."""

from __future__ import annotations

import os
import stat
from io import BufferedReader
from pathlib import Path

from wrist_stiffness.errors import WristError


def open_input(path: str | Path, error: type[WristError]) -> BufferedReader:
    """Open a regular file, or a link to one, to read bytes.

    Raises `WristError`: of the given type, if there is no such file, it cannot be opened, or it is
    a pipe or a device: those may never end, or never begin.
    """
    try:
        # Without waiting for who writes to a pipe.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as cause:
        raise error(f"{_short(path)}: cannot be read: {cause.strerror}") from cause
    except ValueError as cause:  # a zero byte in the name
        raise error(f"{_short(path)!r}: cannot be read: {cause}") from cause
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        os.close(descriptor)
        what = "a folder" if is_folder else "a pipe or a device"
        raise error(f"{path}: cannot be read: {what}, not a file")
    return os.fdopen(descriptor, "rb")


def read_text(path: str | Path, error: type[WristError], limit: int) -> str:
    """Return the text of a file.

    Raises `WristError`: of the given type, if the file cannot be opened or read, has more than
    `limit` bytes or is not UTF-8.
    """
    try:
        with open_input(path, error) as stream:
            content = stream.read(limit + 1)
    except OSError as cause:
        raise error(f"{path}: cannot be read: {cause.strerror}") from cause
    if len(content) > limit:
        raise error(f"{path}: is larger than {limit} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as cause:
        raise error(f"{path}: not a text in UTF-8: {cause}") from cause


def _short(path: str | Path) -> str:
    text = str(path)
    return text if len(text) <= 100 else f"{text[:60]}...{text[-37:]}"
