"""Read a model file (YAML): which table, and which effects on top of it."""

from __future__ import annotations

from pathlib import Path

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import EVALUATIONS, Evaluation
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.yaml_block import Block, read_yaml
from wrist_stiffness.model.error_model import ErrorModel

SCHEMA = 1


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
        If the file cannot be read, a key is missing, unknown or wrong, or the table is another one
        than the model was made for.
    TableError
        If the table cannot be read.
    """
    path = Path(path)
    root = Block(read_yaml(path, InputError), str(path), InputError, sources=())
    schema = root.number("schema")
    if schema != SCHEMA:
        raise InputError(f"{path}.schema: {schema:g} is not {SCHEMA}, the version that is read")
    name = root.text("name")
    effects = root.take("effects")
    if effects != []:
        raise InputError(
            f"{path}.effects: this version knows no effects, found {effects!r}; use []"
        )
    entry = root.block("table")
    table = load_table(path.parent / entry.text("path"))
    if "checksum" in entry.values and (wanted := entry.text("checksum")) != table.checksum:
        raise InputError(
            f"{path}.table.checksum: the model was made for {wanted[:12]}, "
            f"{entry.text('path')} is {table.checksum[:12]}"
        )
    entry.no_more_keys()
    evaluation: Evaluation = table.header.evaluation
    if "evaluation" in root.values:
        evaluation = root.text("evaluation", EVALUATIONS)  # type: ignore[assignment]
    root.no_more_keys()
    return ErrorModel(name, table, evaluation)
