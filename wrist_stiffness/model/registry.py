"""Find the laws: the catalogue of this package, and those of other installed packages."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable
from functools import cache
from importlib import import_module, metadata, util
from pathlib import Path
from pkgutil import iter_modules

from wrist_stiffness.errors import InputError, meant
from wrist_stiffness.model import effects
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.law import STAGES, Law, require_id

ENTRY_POINTS = "wrist_stiffness.effects"
"""Group in which another package offers its own `Law` classes."""


@cache
def catalogue() -> dict[str, Law]:
    """Return all laws by their id, the package's own first.

    Raises
    ------
    InputError
        If an entry point cannot be imported, is no law, or takes a name that is in use.
    """
    own = [
        law
        for module in iter_modules(effects.__path__)
        for law in laws_in(import_module(f"{effects.__name__}.{module.name}"))
    ]
    laws = {law.id: law for law in sorted(own, key=lambda law: law.id)}
    for point in metadata.entry_points(group=ENTRY_POINTS):
        try:
            found = point.load()
        except Exception as error:
            raise InputError(f"entry point {point.name}: {point.value}: {error}") from error
        law = law_of(found, f"entry point {point.name}")
        if law.id in laws:
            raise InputError(f"entry point {point.name}: the name {law.id} is in use")
        laws[law.id] = law
    return laws


def find_law(name: str) -> Law:
    """Return a law of the catalogue.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    laws = catalogue()
    if name not in laws:
        raise unknown_effect(name, laws)
    return laws[name]


def unknown_effect(name: str, known: Iterable[str]) -> InputError:
    """Return the error of an effect that is none of those known."""
    listed = ", ".join(sorted(known))
    return InputError(f"unknown effect {name!r}{meant(name, known) or ';'} known are {listed}")


def effect_named(name: str) -> Effect:
    """Return the effect of the catalogue that `NAME@COMPONENT` names, with its usual values.

    Raises `InputError` if it is no such name, or there is no such law.
    """
    law, component = at_component(name, "backlash@motor_2")
    return Effect(find_law(law), component)


def at_component(text: str, example: str) -> tuple[str, str]:
    """Split `NAME@COMPONENT`.

    `example`: such a name, for the error.  Raises `InputError` if one of them is missing.
    """
    name, _, component = text.rpartition("@")
    if not name or not component:
        raise InputError(f"effect {text!r}: write NAME@COMPONENT, such as {example}")
    return name, component


def laws_in(module: object) -> list[Law]:
    """Return the laws that a module itself defines."""
    name = getattr(module, "__name__", "")
    return [
        law_of(found, name)
        for found in vars(module).values()
        if inspect.isclass(found)
        and issubclass(found, Law)
        and found.__module__ == name
        and not inspect.isabstract(found)
    ]


def law_of(found: object, place: str) -> Law:
    """Return an instance of a law class.

    Raises `InputError` if it is no complete law, or its id cannot be one.
    """
    if not (inspect.isclass(found) and issubclass(found, Law)):
        raise InputError(f"{place}: {found!r} is not a class derived from Law")
    wanted = ("id", "stage", "places", "sentence", "check", "excited_by")
    missing = [*getattr(found, "__abstractmethods__", ())]
    if found.parameters is Law.parameters and not hasattr(found, "own"):
        missing.append("parameters")
    acts = ("changed",) if getattr(found, "stage", "") == "parts" else ("advance", "added")
    if all(getattr(found, name) is getattr(Law, name) for name in acts):
        missing.append(" or ".join(acts))
    if missing := [*missing, *(name for name in wanted if not hasattr(found, name))]:
        raise InputError(f"{place}: {found.__name__} does not define {', '.join(missing)}")
    try:
        law = found()
    except (Exception, SystemExit) as error:
        said = f"{type(error).__name__}: {error}"
        raise InputError(f"{place}: {found.__name__}(): {said}") from error
    require_id(law.id)
    if law.stage not in STAGES:
        raise InputError(
            f"{place}: stage {law.stage!r} of {found.__name__} is not one of {', '.join(STAGES)}"
        )
    if law.stage == "friction" and law.state_is_a_guess:
        raise InputError(f"{place}: the state of {found.__name__}, a friction, cannot be a guess")
    _require_parameters(law, place)
    return law


def _require_parameters(law: Law, place: str) -> None:
    """Refuse what no fit can begin with."""
    if not 0.0 <= law.inexactness <= 1.0:
        raise InputError(f"{place}: inexactness = {law.inexactness} is not from 0 to 1")
    for component in law.places:
        asked = "parameters"
        try:
            parameters = law.parameters(component)
            if not parameters:
                raise InputError(
                    f"{type(law).__name__} has no parameter to fit at {component}; multiply what "
                    "it does by one"
                )
            for each in parameters:
                if not each.scale > 0.0:
                    raise InputError(f"{each.key}: scale = {each.scale} is not above 0")
            asked = "sentence"
            law.sentence.format(place=component)
            asked = "linearised"
            # The first columns, and the effect with which a fit would begin.
            recipe = law.linearised(component, frozenset())
            shape = recipe.shapes[0]
            columns = recipe.columns(shape)
            begin = recipe.start({column.factor.key: 0.0 for column in columns}, shape)
            for values in (begin, *(column.trial for column in columns)):
                effect_at(law, component, values)
        except InputError as error:
            raise InputError(f"{place}: {error}") from error
        except (Exception, SystemExit) as error:
            said = f"{type(error).__name__}: {error}"
            raise InputError(f"{place}: {asked}({component!r}): {said}") from error


def law_from_file(reference: str, folder: Path) -> Law:
    """Return a user's own law from a Python file, which is executed.

    Parameters
    ----------
    reference : str
        `FILE.py:CLASS`, relative to the folder.
    folder : path
        Of the model file.

    Returns
    -------
    Law
        An instance.  A model with it can be saved: the model file names the Python file.

    Raises
    ------
    InputError
        If the file cannot be run or has no such law.
    """
    file, _, name = reference.rpartition(":")
    path = folder / file
    if not file or not os.path.isfile(path):
        raise InputError(f"{reference}: no file {path}; write FILE.py:CLASS")
    spec = util.spec_from_file_location(f"wrist_stiffness_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{reference}: {path.name} is not a Python file")
    module = util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        told = "it ends the program" if isinstance(error, SystemExit) else error
        raise InputError(f"{reference}: cannot be run: {told}") from error
    if not hasattr(module, name):
        raise InputError(f"{reference}: {path.name} has no class {name}")
    law = law_of(getattr(module, name), reference)
    law.file = path
    return law
