"""Files that are complete or not there at all."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from socket import gethostname
from tempfile import TemporaryFile
from zlib import crc32

from wrist_stiffness.errors import InputError, WristError


def require_room(path: str | Path) -> None:
    """Refuse a path beside which no file can be written, before the work for it.

    `path`: file that `replacing` will write later; a device or a pipe needs no room.  Raises
    `InputError` if it is a folder, or its folder does not exist or takes no file: permissions alone
    do not tell, of a disk that is read-only.
    """
    target = Path(path)
    if target.is_dir():
        raise InputError(f"{path}: cannot be written: it is a folder")
    if not target.absolute().parent.is_dir():
        raise InputError(f"{path}: folder {target.parent} does not exist")
    if target.exists() and not target.is_file():
        return
    try:
        with TemporaryFile(dir=target.resolve().parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


@contextmanager
def writing(path: str | Path, error: type[WristError] = InputError) -> Iterator[Path]:
    """Give the path to write to as `replacing` does; what the disk refuses is a line for a user."""
    try:
        with replacing(path) as written:
            yield written
    except OSError as fault:
        raise error(f"{path}: cannot be written: {fault.strerror}") from fault


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give the path to write to; what was written there takes its place when all went well.

    A device or a pipe is written to directly: renaming onto /dev/null would put a file in its
    place, for every program of the machine.  A link stays a link to the new file.

    `path`: file to write; an older one stays until the new one is complete.  Gives a temporary file
    in the same folder, or the device itself.  Raises `OSError` if the file cannot be written; the
    temporary file is gone then.
    """
    target = Path(path)
    if target.exists() and not target.is_file():
        yield target
        return
    target = target.resolve()
    temporary = partial_of(target)
    remove_orphans(target)
    try:
        yield temporary
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def partial_of(target: Path) -> Path:
    """Return the hidden neighbour of a file or folder that this process writes in its place."""
    return target.parent / f".{target.name}.{_numbering()}-{os.getpid()}.partial"


def remove_orphans(target: Path) -> None:
    """Remove what processes that live no more left where they wrote a target: they were killed."""
    name = re.compile(rf"\.{re.escape(target.name)}\.{_numbering()}-(\d{{1,7}})\.partial")
    with suppress(OSError):
        for each in target.parent.iterdir():
            found = name.fullmatch(each.name)
            if found and not _lives(int(found[1])):
                remove(each)


def remove(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; there may be none."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _numbering() -> str:
    """Return what tells apart where processes are numbered: other hosts, and containers of one."""
    space = Path("/proc/self/ns/pid")
    number = space.stat().st_ino if space.exists() else 0
    return f"{crc32(f'{gethostname()} {number}'.encode()):08x}"


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # It is somebody else's.
        return True
    return True
