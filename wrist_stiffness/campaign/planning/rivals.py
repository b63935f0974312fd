"""The rivals that a diagnosis left, read from its result."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.campaign.planning.information import MeasurementNoise
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.yaml_block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law

SCHEMA = 1

LEAST_WHITE = 0.25
"""Share of a rotation's floor that is no hidden encoder count, at least."""


@dataclass(frozen=True, eq=False)
class Rivals:
    """What a diagnosis left open.

    Parameters
    ----------
    classes : tuple of tuples of Effect
        Effects that its recordings could not tell apart, best first and with the values found.
    silent : tuple of Effect
        What its recordings could not have shown.
    floor : (2,) float
        Root mean square of shift and rotation that noise leaves [m, rad].
    """

    classes: tuple[tuple[Effect, ...], ...]
    silent: tuple[Effect, ...]
    floor: tuple[float, float]

    def noise(self, table: Table) -> MeasurementNoise:
        """Return the noise of one dwell: the floor without the hidden encoder count."""
        step = table.geometry.limits.encoder_step
        mechanism = table.mechanism
        jacobian = mechanism.jacobian(mechanism.forward(np.zeros(2)))
        shift, rotation = (value**2 for value in self.floor)
        hidden = float(np.sum(jacobian**2)) * step**2 / 12.0
        white = np.array([shift, max(rotation - hidden, LEAST_WHITE * rotation)])
        return MeasurementNoise(np.repeat(np.sqrt(white / 3.0), 3), step)


def read_rivals(path: str | Path) -> Rivals:
    """Read the result of `diagnose --json`.

    Parameters
    ----------
    path : path
        JSON file.

    Returns
    -------
    Rivals
        Classes, silent effects and noise floor.

    Raises
    ------
    InputError
        If the file cannot be read, a key is missing or wrong, or an effect is not of the catalogue.
    """
    try:
        values = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: not a JSON file: {error}") from error
    root = Block(values, str(path), InputError, sources=())
    schema = root.number("schema")
    if schema != SCHEMA:
        raise InputError(f"{path}.schema: {schema:g} is not {SCHEMA}, the version that is read")
    floor = root.block("noise_floor")
    sizes = (
        floor.number("s_um", 1e-6, above=0.0),
        floor.number("phi_mdeg", np.pi / 180e3, above=0.0),
    )
    classes = tuple(_members(block) for block in root.blocks("findings"))
    silent = (_effect(block) for block in root.blocks("not_excited"))
    return Rivals(classes, tuple({effect.name: effect for effect in silent}.values()), sizes)


def _members(finding: Block) -> tuple[Effect, ...]:
    effects = [_effect(block) for block in finding.blocks("class")]
    if not effects:
        raise InputError(f"{finding.place}.class: is empty")
    parameters = finding.block("parameters")
    known = {p.key: p for p in effects[0].parameters}
    # What the regression calls otherwise than the law is left at its prior mean.
    values = {
        key: float(np.clip(parameters.vector(key, size=2)[0], known[key].lower, known[key].upper))
        for key in map(str, parameters.values)
        if key in known
    }
    return (effects[0].with_values(values), *effects[1:])


def _effect(block: Block) -> Effect:
    name, component = block.text("effect"), block.text("component")
    return _placed(block, lambda: Effect(find_law(name), component))


def _placed(block: Block, make: Callable[[], Effect]) -> Effect:
    try:
        return make()
    except InputError as error:
        raise InputError(f"{block.place}: {error}") from error
