"""The rivals that a diagnosis left, read from its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.answer import SCHEMA
from wrist_stiffness.inputs.document import Node, read_json
from wrist_stiffness.inputs.schema import (
    list_of,
    mapping_of,
    number,
    record,
    text,
    vector,
    version,
)
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.planning.information import MeasurementNoise
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

LEAST_WHITE = 0.25
"""Share of a rotation's floor that is no hidden encoder count, at least."""


@dataclass(frozen=True, eq=False)
class Rivals:
    """What a diagnosis left open."""

    # effects that its recordings could not tell apart, best first and with the values found: of
    # what was named, and of what was not sure enough
    classes: tuple[tuple[Effect, ...], ...]
    silent: tuple[Effect, ...]  # what its recordings could not have shown
    noise: Mapping[str, float]  # what noise leaves, RMS by the key of the quantity
    # SHA-256 of the models and recordings that were diagnosed; empty where nothing states them
    diagnosed: frozenset[str]


def dwell_noise(table: Table, floor: Mapping[str, float]) -> MeasurementNoise:
    """Return the noise of one dwell: what a diagnosis calls noise, less the hidden encoder count.

    Raises `InputError` if that is not of whole poses.
    """
    if not {"s_um", "phi_mdeg"} <= floor.keys():
        raise InputError(
            "experiments are planned for an instrument that measures position and rotation, "
            f"not {' and '.join(floor)} alone"
        )
    step, mechanism = table.geometry.limits.encoder_step, table.mechanism
    jacobian = mechanism.jacobian(mechanism.forward(np.zeros(2)))
    shift = (floor["s_um"] / MICROMETRES) ** 2
    rotation = (floor["phi_mdeg"] / MILLIDEGREES) ** 2
    hidden = float(np.sum(jacobian**2)) * step**2 / 12.0
    white = np.array([shift, max(rotation - hidden, LEAST_WHITE * rotation)])
    return MeasurementNoise(np.repeat(np.sqrt(white / 3.0), 3), step)


def read_rivals(path: str | Path) -> Rivals:
    """Read the result of `diagnose --json`.

    Raises `InputError` if the file cannot be read, a key is missing or wrong, or an effect is not
    of the catalogue.
    """
    document = read_json(path, InputError)
    if isinstance(document.value, dict) and "findings" not in document.value:
        raise document.refuse(
            "no diagnosis of one wrist; 'diagnose --json FILE' without --each writes one"
        )
    found = DIAGNOSIS(document)
    silent, made_from = found["not_excited"], found.get("provenance", {})
    return Rivals(
        (*found["findings"], *found["suspects"]),
        tuple({effect.name: effect for effect in silent}.values()),
        found["noise"],
        frozenset(sha256 for files in made_from.values() for sha256 in files.values()),
    )


def _effect(node: Node) -> Effect:
    words = record({"effect": text(), "component": text()}, others=True)(node)
    try:
        return Effect(find_law(words["effect"]), words["component"])
    except InputError as error:
        raise node.refuse(str(error)) from error


def _members(node: Node) -> tuple[Effect, ...]:
    finding = record(
        {"class": list_of(_effect, at_least=1), "parameters": mapping_of(lambda inner: inner)},
        others=True,
    )(node)
    effects, parameters = finding["class"], finding["parameters"]
    # What the regression calls otherwise than the law is left at its prior mean.
    values = {
        known.key: float(np.clip(vector(2)(parameters[known.key])[0], known.lower, known.upper))
        for known in effects[0].parameters
        if known.key in parameters
    }
    return (effects[0].with_values(values), *effects[1:])


DIAGNOSIS = record(
    {
        "schema": version(SCHEMA),
        "noise": mapping_of(number(above=0.0)),
        "findings": list_of(_members),
        "suspects": list_of(_members),
        "not_excited": list_of(_effect),
    },
    {
        "provenance": record(
            dict.fromkeys(("models", "recordings"), mapping_of(text())), others=True
        )
    },
    others=True,
)
