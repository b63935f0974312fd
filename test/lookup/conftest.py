from pathlib import Path

import pytest

from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file


@pytest.fixture(scope="session")
def shipped_path() -> Path:
    return shipped_file("precomputed/palmieri2015.npz")


@pytest.fixture(scope="session")
def shipped(shipped_path: Path) -> Table:
    return load_table(shipped_path)
