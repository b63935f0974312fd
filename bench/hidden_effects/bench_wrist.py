"""What all parts of the benchmark share: the table, the rate, and which code gave a result."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

RATE_HZ = 10.0

TRUTH = ("mechanism", "lookup", "simulation")
"""Rooms of the package that make a riddle."""

PROJECT = (*TRUTH, "recording", "model", "compensation", "diagnosis", "campaign")
"""Rooms that the project's own diagnosis is made of as well."""

PACKAGE = Path(shipped_file("precomputed/palmieri2015.npz")).parents[1] / "wrist_stiffness"


@cache
def wrist() -> Table:
    """Return the shipped table."""
    return load_table(shipped_file("precomputed/palmieri2015.npz"))


@cache
def code_version(rooms: tuple[str, ...], files: tuple[str, ...]) -> str:
    """Return a short digest of the table and of the code in rooms and in files of this folder."""
    digest = hashlib.sha256(Path(shipped_file("precomputed/palmieri2015.npz")).read_bytes())
    here = Path(__file__).parent
    paths = [path for room in rooms for path in sorted((PACKAGE / room).rglob("*.py"))]
    for path in [*paths, *(here / name for name in files)]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
