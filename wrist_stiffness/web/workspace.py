"""The workspace folder: the only place that the page reads from and writes to."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.document import read_yaml
from wrist_stiffness.sessions.reading.folder import is_recording
from wrist_stiffness.shipped import shipped_file

RECORDING, MODEL, TABLE = (".mcap", ".csv"), (".yaml", ".yml"), (".npz",)
"""Ends of names, in letters of any size."""

SHIPPED_TABLE = "precomputed/palmieri2015.npz"

NAME = re.compile(r"[\w][\w .+()-]{0,99}")
"""Browsers add the parentheses, `monday (1).mcap`."""


class Workspace:
    """A folder, made where it is not there, beyond which no name from a page leads."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).resolve()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be made: {error.strerror}") from error

    def path(self, name: str) -> Path:
        """Return the path of a plain file name in the folder (InputError if it is none)."""
        path = self.folder / name
        if not NAME.fullmatch(name) or path.resolve().parent != self.folder:
            raise InputError(
                f"{name!r} is no plain file name within the workspace: up to 100 letters, digits, "
                "spaces and . _ + - ( ), the first a letter, a digit or _"
            )
        return path

    def model(self, name: str) -> Path:
        """Return the path of a model file that refers to nothing beyond the folder.

        Raises `InputError` as for `path`, or if its table or a law lies elsewhere; a table of the
        package may.
        """
        path = self.path(name)
        told = read_yaml(path, InputError).plain
        told = told if isinstance(told, dict) else {}
        table, effects = told.get("table"), told.get("effects")
        names = [table.get("path")] if isinstance(table, dict) else []
        for effect in effects if isinstance(effects, list) else ():
            if isinstance(effect, dict) and "class" in effect:
                names.append(str(effect["class"]).partition(":")[0])
        own = shipped_file(SHIPPED_TABLE).resolve()
        for each in filter(None, names):
            target = (self.folder / str(each)).resolve()
            if target != own and target.parent != self.folder:
                raise InputError(f"{name}: {each} lies outside the workspace")
        return path

    def free(self, name: str) -> str:
        """Return a name with a number that no file of the folder has."""
        taken = {path.stem for path in self.folder.iterdir()}
        return next(own for n in count(1) if (own := f"{name}_{n}") not in taken)

    def save(self, name: str, content: bytes) -> Path:
        """Write an uploaded file in place of an older one (InputError if its name is refused)."""
        path = self.path(name)
        if path.suffix.lower() not in (*RECORDING, *MODEL, *TABLE):
            raise InputError(
                f"{name}: the workbench takes recordings (.mcap), tables of poses (.csv), models "
                "(.yaml) and their tables (.npz)"
            )
        if path.is_dir():
            raise InputError(f"{name}: there is a folder of that name")
        with replacing(path) as partial:
            partial.write_bytes(content)
        return path

    def recordings(self) -> list[str]:
        """Return the names of recordings and tables of poses."""
        return [p.name for p in self._files() if _ends(p, RECORDING) or is_recording(p)]

    def models(self) -> list[str]:
        """Return the names of model files."""
        return [p.name for p in self._files() if _ends(p, MODEL)]

    def _files(self) -> Sequence[Path]:
        return sorted(
            p for p in self.folder.iterdir() if NAME.fullmatch(p.name) and not p.is_symlink()
        )


def _ends(path: Path, ends: Sequence[str]) -> bool:
    return path.suffix.lower() in ends and not path.is_dir()
