"""Condensed solids on disk, so that an interrupted build goes on where it was.

A build keeps each part as soon as it is condensed.  The name of a file is the checksum of all that
decides its numbers: dimensions, element sizes, interface model and versions, this program's too.
"""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from pathlib import Path

import numpy as np

from wrist_stiffness import __version__
from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import TableError
from wrist_stiffness.fem.parts import Solid, assemble_body
from wrist_stiffness.fem.solids import MeshSettings
from wrist_stiffness.fem.superelement import Interface, Superelement, condense

PACKAGES = ("netgen-mesher", "scikit-fem", "scipy", "numpy", "pymetis")
"""Packages whose versions may change the numbers."""


@dataclass(frozen=True)
class CondensedSolid:
    """One solid, condensed."""

    element: Superelement  # as its frames see it
    # `nodes`, `elements`: size of its mesh
    nodes: int
    elements: int


def condense_solid(solid: Solid, sizes: MeshSettings, interface: Interface) -> CondensedSolid:
    """Mesh, assemble and condense one solid.

    `sizes`: element sizes [m]; `interface` ({"rigid", "distributing", "sliding"}): how walls follow
    their frames.
    """
    body = assemble_body(solid, sizes)
    return CondensedSolid(condense(body, interface), len(body.mesh.nodes), len(body.mesh.elements))


class CondensedStore:
    """Condenses a solid once and keeps it in a folder; called as `condense_solid`.

    `folder`: made if missing; `remove` takes it away when the build is done.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def __call__(self, solid: Solid, sizes: MeshSettings, interface: Interface) -> CondensedSolid:
        """Return the condensed solid, from the folder where it is there already.

        Raises `TableError` if the folder cannot be written.
        """
        path = self.folder / f"{_key(solid, sizes, interface)}.npz"
        kept = _load(path)
        if kept is not None:
            return kept
        condensed = condense_solid(solid, sizes, interface)
        try:
            self.folder.mkdir(exist_ok=True)
            with replacing(path) as written, written.open("wb") as stream:
                np.savez(
                    stream,
                    nodes=condensed.nodes,
                    elements=condensed.elements,
                    **asdict(condensed.element),
                )
        except OSError as error:
            raise TableError(f"{self.folder}: cannot be written: {error.strerror}") from error
        return condensed

    def kept(self) -> int:
        """Return the number of solids in the folder."""
        return len(list(self.folder.glob("*.npz")))

    def remove(self) -> None:
        """Take the folder away."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _key(solid: Solid, sizes: MeshSettings, interface: Interface) -> str:
    versions = [__version__, *(version(package) for package in PACKAGES)]
    said = repr((solid, sizes, interface, versions))
    return hashlib.sha256(said.encode()).hexdigest()[:32]


def _load(path: Path) -> CondensedSolid | None:
    """Return what the file holds; None where it is missing or was cut."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            element = Superelement(**{f.name: archive[f.name] for f in fields(Superelement)})
            return CondensedSolid(element, int(archive["nodes"]), int(archive["elements"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
