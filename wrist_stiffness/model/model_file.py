"""Read and write a model file (YAML): which table, and which effects on top of it."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from wrist_stiffness.atomic_file import writing
from wrist_stiffness.errors import InputError, TableError
from wrist_stiffness.inputs.document import Node, read_yaml
from wrist_stiffness.inputs.opening import open_input
from wrist_stiffness.inputs.schema import (
    list_of,
    mapping_of,
    number,
    record,
    text,
    vector,
    version,
)
from wrist_stiffness.lookup.table import EVALUATIONS, Evaluation
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.joint_uncertainty import KEYS, PLATFORM, JointUncertainty
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.python_laws import require_python_laws
from wrist_stiffness.model.registry import catalogue, find_law, law_from_file

SCHEMA = 1
FORMULA, PYTHON = "formula", "python"
"""Words for `effect:` that announce a user's own law."""


def _estimate(node: Node) -> Estimate:
    if isinstance(node.value, list):
        value, sigma = vector(2)(node)
        return Estimate(float(value), float(sigma))
    return Estimate(number()(node))


def _directions(node: Node) -> Array:
    """Read a screw (6,), or a list of them (r, 6)."""
    many = isinstance(node.value, list) and any(isinstance(each, list) for each in node.plain)
    return np.array(list_of(vector(6))(node)) if many else vector(6)(node)


PLACED = {"effect": text(), "component": text()}
PARAMETERS = {"parameters": mapping_of(_estimate)}
CATALOGUE = record(PLACED, PARAMETERS)
USERS_LAW = record({**PLACED, "class": text()}, PARAMETERS)
USERS_FORMULA = record(
    {**PLACED, "id": text(), "direction": _directions, "expression": text()},
    {**PARAMETERS, "covariates": list_of(text())},
)
MODEL = record(
    {
        "schema": version(SCHEMA),
        "name": text(),
        "effects": list_of(lambda node: node),
        "table": record({"path": text()}, {"checksum": text()}),
    },
    {
        "evaluation": text(*EVALUATIONS),
        "lineage": list_of(
            record(
                dict.fromkeys(("command", "date", "parent_sha256"), text())
                | {"recordings": mapping_of(text())},
                {"measured": mapping_of(text()), "added": text()},
                make=Step,
            )
        ),
        "joint_uncertainty": record(
            {"effects": list_of(text()), **dict.fromkeys(KEYS, number(at_least=0.0))},
            {PLATFORM + key: number(at_least=0.0) for key in KEYS},
            make=JointUncertainty.of_values,
        ),
    },
)


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
        If the file cannot be read, a key is missing, unknown or wrong, an effect, component or
        parameter is unknown or out of bounds, a step of the lineage added what is no effect, or the
        table is another one than the model was made for.
    TableError
        If the table cannot be read.
    """
    path = Path(path)
    # Unlike those of pathlib, these take a name too long for one that is not there.
    if path.suffix == ".mcap" or os.path.isfile(path / "metadata.yaml"):
        raise InputError(f"{path}: is a recording, not a model file")
    root = read_yaml(path, InputError)
    values = MODEL(root)
    effects = tuple(_effect(node, path.parent) for node in values["effects"])
    entry = values["table"]
    table_file = path.parent / entry["path"]
    if not os.path.exists(table_file):
        raise TableError(
            f"{root['table']['path'].place}: there is no table {table_file}; the path is relative "
            "to the model file: if that was moved, write the new path"
        )
    table = load_table(table_file)
    if (wanted := entry.get("checksum", table.checksum)) != table.checksum:
        raise root["table"]["checksum"].refuse(
            f"the model was made for {wanted[:12]}, {entry['path']} is {table.checksum[:12]}"
        )
    evaluation: Evaluation = values.get("evaluation", table.header.evaluation)
    lineage = tuple(values.get("lineage", ()))
    for position, step in enumerate(lineage):
        _check_added(root["lineage"].value[position], step.added, effects)
    try:
        return ErrorModel(
            values["name"],
            table,
            evaluation,
            effects,
            table_file,
            lineage,
            values.get("joint_uncertainty"),
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def save_model(model: ErrorModel, path: str | Path) -> None:
    """Write a model file, complete or not at all.

    Parameters
    ----------
    model : ErrorModel
        Read from a file, perhaps with other effects.
    path : path
        File to write; an older one is replaced, a device or pipe is written to.  Paths in it are
        relative to it.

    Raises
    ------
    InputError
        If the model's table or a user's own law was never in a file, or the file cannot be written.
    """
    path = Path(path)
    if model.table_file is None:
        raise InputError(f"{path}: the table of model {model.name} was not read from a file")
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "name": model.name,
        "table": {
            "path": _relative(model.table_file, path.parent),
            "checksum": model.table.checksum,
        },
        "evaluation": model.evaluation,
        "effects": [_entry(effect, path) for effect in model.effects],
    }
    if model.joint is not None:
        content["joint_uncertainty"] = {
            "effects": list(model.joint.effects),
            **model.joint.as_values(),
        }
    if model.lineage:
        content["lineage"] = [step.as_values() for step in model.lineage]
    text = yaml.safe_dump(
        content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=100
    )
    with writing(path) as written:
        written.write_text(text, encoding="utf-8")


def file_sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file, by which a child names its parent.

    Raises `InputError` if the file cannot be read.
    """
    try:
        with open_input(path, InputError) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def _effect(node: Node, folder: Path) -> Effect:
    # Which keys an effect has depends on one of them.
    word = mapping_of(lambda inner: inner.value)(node).get("effect")
    values = {FORMULA: USERS_FORMULA, PYTHON: USERS_LAW}.get(str(word), CATALOGUE)(node)
    estimates = values.get("parameters", {})
    try:
        law: Law
        if word == FORMULA:
            law = FormulaLaw(
                values["id"],
                values["component"],
                values["direction"],
                values["expression"],
                values.get("covariates", []),
                list(estimates),
            )
        elif word == PYTHON:
            require_python_laws(values["class"])
            law = law_from_file(values["class"], folder)
        else:
            law = find_law(values["effect"])
        return Effect(law, values["component"], estimates)
    except InputError as error:
        raise node.refuse(str(error)) from error


def _entry(effect: Effect, path: Path) -> dict[str, Any]:
    law = effect.law
    own: dict[str, Any] = {"effect": law.id, "component": effect.component}
    if isinstance(law, FormulaLaw):
        own = {"effect": FORMULA, "id": law.id, "component": effect.component}
        own["direction"] = (law.direction if len(law.direction) > 1 else law.direction[0]).tolist()
        own["expression"] = law.formula.text
        if law.covariates:
            own["covariates"] = list(law.covariates)
    elif law.file is not None:
        reference = f"{_relative(law.file, path.parent)}:{type(law).__name__}"
        own = {"effect": PYTHON, "class": reference, "component": effect.component}
    elif type(law) is not type(catalogue().get(law.id)):
        raise InputError(
            f"{path}: {effect.name} cannot be saved: its class {type(law).__name__} has to come "
            "from a file, see docs/python.md"
        )
    own["parameters"] = {
        key: [float(estimate.value), float(estimate.sigma)]
        for key, estimate in effect.estimates.items()
    }
    return own


def _check_added(node: Node, added: str, effects: tuple[Effect, ...]) -> None:
    """Check that a step added an effect of the file, or one of the catalogue taken out since."""
    if added and added not in [effect.name for effect in effects]:
        law, _, component = added.partition("@")
        try:
            Effect(find_law(law), component)
        except InputError as error:
            raise node["added"].refuse(
                f"{added} is neither an effect of this file nor one of the catalogue: {error}"
            ) from error


def _relative(target: Path, folder: Path) -> str:
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()
