"""Read a model file (YAML): which table, and which effects on top of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import EVALUATIONS
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.error_model import ErrorModel

SCHEMA = 1
KEYS = {"schema", "name", "table", "evaluation", "effects", "provenance"}


def load_model(path: str | Path) -> ErrorModel:
    """Read a model and its table.

    Parameters
    ----------
    path : path
        A YAML file; its table's path is relative to it.

    Returns
    -------
    ErrorModel
        Ready to predict.

    Raises
    ------
    InputError
        If the file cannot be read or a key is missing, unknown or wrong.
    TableError
        If the table cannot be read or is another one than the model names.
    """
    path = Path(path)
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a YAML file: {' '.join(str(error).split())}") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: not a model file, expected a mapping")
    if unknown := set(values) - KEYS:
        raise InputError(f"{path}: unknown key {', '.join(sorted(map(str, unknown)))}")
    if values.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema {values.get('schema')!r} is not {SCHEMA}")
    name = values.get("name")
    if not isinstance(name, str):
        raise InputError(f"{path}: name is missing or no text")
    if values.get("effects") != []:
        raise InputError(
            f"{path}: effects: {values.get('effects')!r}: this version knows no effects, use []"
        )
    place, checksum = _table_entry(values.get("table"), path)
    table = load_table(path.parent / place)
    if checksum is not None and table.checksum != checksum:
        raise InputError(
            f"{path}: its table {place} has checksum {table.checksum[:12]}, the model was made for "
            f"{checksum[:12]}"
        )
    evaluation = values.get("evaluation", table.header.evaluation)
    if evaluation not in EVALUATIONS:
        raise InputError(
            f"{path}: evaluation {evaluation!r} is not one of {', '.join(EVALUATIONS)}"
        )
    return ErrorModel(name, table, evaluation, path)


def _table_entry(entry: Any, path: Path) -> tuple[str, str | None]:
    if not isinstance(entry, dict) or not isinstance(entry.get("path"), str):
        raise InputError(f"{path}: table.path is missing")
    if unknown := set(entry) - {"path", "checksum"}:
        raise InputError(f"{path}: table: unknown key {', '.join(sorted(map(str, unknown)))}")
    checksum = entry.get("checksum")
    if checksum is not None and not isinstance(checksum, str):
        raise InputError(f"{path}: table.checksum: {checksum!r} is no text")
    return entry["path"], checksum
