"""Read and write a model file (YAML): which table, and which effects on top of it."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import yaml

from wrist_stiffness.atomic_file import replacing
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import EVALUATIONS, Evaluation
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.yaml_block import Block, read_yaml
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.joint_uncertainty import KEYS, JointUncertainty
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law, law_from_file

SCHEMA = 1
FORMULA, PYTHON = "formula", "python"
"""Words for `effect:` that announce a user's own law."""


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
    root = Block(read_yaml(path, InputError), str(path), InputError, sources=())
    schema = root.number("schema")
    if schema != SCHEMA:
        raise InputError(f"{path}.schema: {schema:g} is not {SCHEMA}, the version that is read")
    name = root.text("name")
    effects = tuple(_effect(block, path.parent) for block in root.blocks("effects"))
    entry = root.block("table")
    table_file = path.parent / entry.text("path")
    table = load_table(table_file)
    if "checksum" in entry.values and (wanted := entry.text("checksum")) != table.checksum:
        raise InputError(
            f"{path}.table.checksum: the model was made for {wanted[:12]}, "
            f"{entry.text('path')} is {table.checksum[:12]}"
        )
    entry.no_more_keys()
    evaluation: Evaluation = table.header.evaluation
    if "evaluation" in root.values:
        evaluation = root.text("evaluation", EVALUATIONS)  # type: ignore[assignment]
    lineage = root.blocks("lineage") if "lineage" in root.values else []
    steps = tuple(_step(block, effects) for block in lineage)
    joint = _joint(root.block("joint_uncertainty")) if "joint_uncertainty" in root.values else None
    root.no_more_keys()
    try:
        return ErrorModel(name, table, evaluation, effects, table_file, steps, joint)
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
        If the model's table was never in a file, or the file cannot be written.
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
        "effects": [_entry(effect, path.parent) for effect in model.effects],
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
    try:
        with replacing(path) as written:
            written.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def file_sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file, by which a child names its parent.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        with Path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def _effect(block: Block, folder: Path) -> Effect:
    estimates = _estimates(block)
    try:
        law = _law(block, folder, list(estimates))
        effect = Effect(law, block.text("component"), estimates)
    except InputError as error:
        if str(error).startswith(block.place):
            raise
        raise InputError(f"{block.place}: {error}") from error
    block.no_more_keys()
    return effect


def _law(block: Block, folder: Path, keys: list[str]) -> Law:
    name = block.text("effect")
    if name == PYTHON:
        return law_from_file(block.text("class"), folder)
    if name != FORMULA:
        return find_law(name)
    covariates = block.take("covariates") if "covariates" in block.values else []
    if not (isinstance(covariates, list) and all(isinstance(c, str) for c in covariates)):
        raise InputError(f"{block.place}.covariates: {covariates!r} is not a list of names")
    return FormulaLaw(
        block.text("id"),
        block.text("component"),
        block.vector("direction", size=6),
        block.text("expression"),
        covariates,
        keys,
    )


def _estimates(block: Block) -> dict[str, Estimate]:
    if "parameters" not in block.values:
        return {}
    inner = block.block("parameters")
    estimates = {}
    for key in map(str, inner.values):
        if isinstance(inner.values.get(key), list):
            value, sigma = inner.vector(key, size=2)
            estimates[key] = Estimate(float(value), float(sigma))
        else:
            estimates[key] = Estimate(inner.number(key))
    return estimates


def _entry(effect: Effect, folder: Path) -> dict[str, Any]:
    law = effect.law
    own: dict[str, Any] = {"effect": law.id, "component": effect.component}
    if isinstance(law, FormulaLaw):
        own = {"effect": FORMULA, "id": law.id, "component": effect.component}
        own["direction"] = law.direction.tolist()
        own["expression"] = law.formula.text
        if law.covariates:
            own["covariates"] = list(law.covariates)
    elif law.file is not None:
        reference = f"{_relative(law.file, folder)}:{type(law).__name__}"
        own = {"effect": PYTHON, "class": reference, "component": effect.component}
    own["parameters"] = {
        key: [float(estimate.value), float(estimate.sigma)]
        for key, estimate in effect.estimates.items()
    }
    return own


def _joint(block: Block) -> JointUncertainty:
    names = block.take("effects")
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise InputError(f"{block.place}.effects: {names!r} is not a list of names")
    values = {key: block.number(key) for key in KEYS}
    for key, value in values.items():
        if value < 0.0:
            raise InputError(f"{block.place}.{key}: {value:g} is below 0")
    block.no_more_keys()
    return JointUncertainty.of_values(tuple(names), values)


def _step(block: Block, effects: tuple[Effect, ...]) -> Step:
    added = block.text("added") if "added" in block.values else ""
    # An effect of the catalogue may have been taken out of the file since.
    if added and added not in [effect.name for effect in effects]:
        law, _, component = added.partition("@")
        try:
            Effect(find_law(law), component)
        except InputError as error:
            raise InputError(
                f"{block.place}.added: {added} is neither an effect of this file nor one of the "
                f"catalogue: {error}"
            ) from error
    step = Step(
        block.text("command"),
        block.text("date"),
        block.text("parent_sha256"),
        _texts(block.block("recordings")),
        _texts(block.block("measured")) if "measured" in block.values else {},
        added,
    )
    block.no_more_keys()
    return step


def _texts(block: Block) -> dict[str, str]:
    return {str(name): block.text(name) for name in block.values}


def _relative(target: Path, folder: Path) -> str:
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()
