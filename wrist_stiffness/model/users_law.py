"""Ask a law, maybe a user's own: whatever goes wrong in it becomes an error that names it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.model.contribution import Contribution, MissingSignalError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.situation import Situation


def advanced_by(effect: Effect, at: Situation, state: Any) -> tuple[Contribution, Any]:
    """Return what a law adds, and its state after that.

    Raises `InputError` if a user's own law raises anything, adds what is no contribution, or writes
    into what it is told.
    """
    if not effect.law.foreign:
        return effect.law.advance(at, effect.component, effect.si, state)
    told, wrote = _told(at), []
    before = [array.tobytes() for array in told.values()]
    try:
        with _naming(effect):
            # What it writes into its values is forgotten, and into its state by a preview.
            own = state if effect.law.state_is_a_guess else deepcopy(state)
            added, state = effect.law.advance(at, effect.component, dict(effect.si), own)
            added.check(len(at.block), len(at.parts.sectors.gap))
    finally:
        for (name, array), there in zip(told.items(), before, strict=True):
            if array.tobytes() != there:
                # Other laws read it, and a command's angles go on to the motors.
                array[...] = np.frombuffer(there, array.dtype).reshape(array.shape)
                wrote.append(name)
    if wrote:
        raise InputError(f"{effect.name}: writes into {wrote[0]}; let it take a copy")
    return added, state


def changed_by(effect: Effect, parts: ElasticComponents) -> ElasticComponents:
    """Return the elastic parts with what a law of the stage `parts` changes (errors as above).

    A user's own law may write into what it gets: it is a copy, else the table would change.
    """
    if not effect.law.foreign:
        return effect.law.changed(parts, effect.component, effect.si)
    with _naming(effect):
        own = deepcopy(replace(parts))  # without what is known of the parts as they were
        changed: Any = effect.law.changed(own, effect.component, dict(effect.si))
        if not isinstance(changed, ElasticComponents):
            raise InputError(f"changed gives a {type(changed).__name__}, not ElasticComponents")
    return changed


@contextmanager
def _naming(effect: Effect) -> Iterator[None]:
    """Make what a user's own law raises an error that names the effect."""
    try:
        yield
    except MissingSignalError:
        raise
    except WristError as error:
        raise InputError(f"{effect.name}: {error}") from error
    except (Exception, SystemExit) as error:
        told = f"{effect.name}: {type(error).__name__}: {error}"
        raise InputError(told + _line_in(effect.law.file, error)) from error


def _told(at: Situation) -> dict[str, Array]:
    """Return the arrays that a law is told, by the names that it has for them."""
    parts = {
        "at.block.": {**at.block.temperatures, **at.block.covariates, **vars(at.block)},
        "at.configuration.": vars(at.configuration),
        "at.": {"load": at.load},
    }
    return {
        part + name: array
        for part, arrays in parts.items()
        for name, array in arrays.items()
        if isinstance(array, np.ndarray)
    }


def _line_in(file: Path | None, error: BaseException) -> str:
    """Return which line of a user's own file an error came through last, empty for none."""
    if file is None:
        return ""
    # A model that is named from its own folder names it without one.
    own = file.absolute()
    lines = [at.lineno for at in extract_tb(error.__traceback__) if Path(at.filename) == own]
    return f" ({file.name}, line {lines[-1]})" if lines else ""
