"""Add one effect to a model, fit it, and write the new model."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wrist_stiffness.commands.calibrate import fit_values, parameter_values, require_model_place
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings, read_sessions, was_fitted_to
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.extension import Extension, extend
from wrist_stiffness.identification.free_effects import unfitted
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula import names_in
from wrist_stiffness.model.formula_law import SIGNALS, FormulaLaw
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.model.parameters import Estimate, has_unit
from wrist_stiffness.model.registry import at_component, law_from_file
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.measured_session import MeasuredSession

KINDS = ("along", "about")
AXIS = re.compile(r"(?P<sign>[+-]?)(?P<name>[xyz])")
"""How `compare` names directions."""


@dataclass(frozen=True, eq=False)
class FormulaEffect:
    """A formula; what in it is neither a signal nor a covariate is a parameter."""

    id: str
    component: str
    # screw for a value of 1, at O in the component's home frame [m, rad]: (6,), or one for each
    # formula between commas (r, 6)
    direction: ArrayLike
    expression: str  # see `model.formula_law`
    # values of parameters from which the fit begins; 1 where there is none
    start: Mapping[str, float]

    def effect(self, covariates: Sequence[str]) -> Effect:
        """Return the effect with its start values."""
        names = names_in(self.expression)
        used = sorted(names & set(covariates))
        keys = sorted(names - SIGNALS - set(covariates))
        if unknown := sorted(self.start.keys() - set(keys)):
            raise InputError(
                f"{self.id}: start value of {unknown[0]}, but the formula's parameters are "
                f"{', '.join(keys) or 'none'}"
            )
        if bare := [key for key in keys if key not in self.start and not has_unit(key)]:
            raise InputError(
                f"{self.id}: {bare[0]} is neither a signal ({', '.join(sorted(SIGNALS))}) nor a "
                "covariate of the recordings; if it is a number to be found, end its name in its "
                f"unit ({bare[0]}_um), or in a terminal give --start {bare[0]}=VALUE"
            )
        if not keys:
            raise InputError(
                f"{self.id}: the formula {self.expression!r} has no parameter to fit; multiply it "
                "by one, 'size_um * ...'"
            )
        direction = np.array(self.direction, dtype=float)
        law = FormulaLaw(self.id, self.component, direction, self.expression, used, keys)
        estimates = {key: Estimate(self.start.get(key, 1.0)) for key in keys}
        return Effect(law, self.component, estimates)


def common_covariates(sessions: Iterable[MeasuredSession]) -> list[str]:
    """Return the names of what was recorded in all sessions, for `FormulaEffect.effect`."""
    return sorted(set.intersection(*(set(each.block.covariates) for each in sessions)))


def own_effect(name: str) -> Effect:
    """Return the effect of a user's own law, `FILE.py:CLASS@COMPONENT`; the file is run."""
    reference, component = at_component(name, "laws.py:Twist@platform")
    return Effect(law_from_file(reference, Path.cwd()), component)


def direction_of(words: Sequence[str]) -> Array:
    """Return the screw that a user names, translation [m] and rotation [rad] for a value of 1.

    `words`: six numbers; or "along" (a shift) or "about" (a turn) with an axis such as "+z" or
    three numbers such as "(-0.38, -0.88, 0.29)", of which only the direction counts: `compare`
    rounds them, and a parameter in um should be the way in um; of several formulas as many, between
    semicolons.  Gives (6,), or of several (r, 6).  Raises `InputError` if it is neither, or the
    three numbers are no direction.
    """
    found = np.array([_direction_of(text) for text in " ".join(words).split(";")])
    return found if len(found) > 1 else found[0]


def _direction_of(text: str) -> list[float]:
    kind, *rest = re.sub(r"[(),]", " ", text).split() or [""]
    axis = AXIS.fullmatch(" ".join(rest)) if kind in KINDS else None
    if axis:
        size = -1.0 if axis["sign"] == "-" else 1.0
        three = [size * (axis["name"] == name) for name in "xyz"]
    else:
        try:
            three = [float(word) for word in (rest if kind in KINDS else [kind, *rest])]
        except ValueError:
            three = []
    if kind in KINDS and len(three) == 3:
        length = math.hypot(*three)
        if not 0.0 < length < math.inf:
            raise InputError(f"direction {text}: an axis of length {length:g} has no direction")
        three = [number / length for number in three]
        return [*three, 0.0, 0.0, 0.0] if kind == "along" else [0.0, 0.0, 0.0, *three]
    if kind in KINDS or len(three) != 6:
        raise InputError(
            f"direction {text.strip() or '(nothing)'}: write six numbers (translation, rotation),"
            " or as compare says 'along +z', 'about (-0.38, -0.88, 0.29)'; several between ';'"
        )
    return three


@dataclass(frozen=True, eq=False)
class Extended:
    """An extension and what it was made from."""

    extension: Extension
    sessions: tuple[MeasuredSession, ...]  # what was measured, in the order of time

    @property
    def before(self) -> dict[str, float]:
        """Errors on the unseen part without the effect, RMS by the key of the quantity."""
        return self.extension.before.rms(self.extension.quantities)

    @property
    def after(self) -> dict[str, float]:
        """Errors on the unseen part with it."""
        return self.extension.after.rms(self.extension.quantities)

    def as_values(self) -> dict[str, Any]:
        """Return what programs read, with units in the names."""
        found = self.extension
        return {
            **fit_values(found.fit, self.before, self.after, found.judged_by, self.sessions),
            "buys": {key: list(gain) for key, gain in found.bought.items()},
            "effect": found.effect.law.id,
            "component": found.effect.component,
            "warnings": list(found.warnings),
            "parameters": parameter_values(found.parameters),
            "base_moved": [
                {
                    "effect": before.effect,
                    "parameter": before.key,
                    "session": before.session,
                    "before": [before.value, before.sigma],
                    "after": [after.value, after.sigma],
                }
                for before, after in found.base_moved
            ],
        }


def extend_model(
    model: str | Path,
    addition: Effect | FormulaEffect,
    recordings: Recordings,
    output: str | Path,
    run: Run,
    progress: Progress = silent,
) -> Extended:
    """Add an effect to a model, fit it with what is there, and write the model.

    `progress`: told steps done and steps at most.  Raises `WristError` if a file cannot be read,
    used or written, or the effect cannot be added; then no model is written.
    """
    require_model_place(output)
    parent = load_model(model)
    sessions = read_sessions(recordings, [parent], progress)
    measured = tuple(sessions.values())
    effect = addition
    if isinstance(effect, FormulaEffect):
        effect = effect.effect(common_covariates(measured))
    step = replace(run.step(model, sessions), added=effect.name)
    known = unfitted(parent) if was_fitted_to(parent, sessions) else parent
    found = extend(known, effect, measured, progress)
    save_model(replace(found.model, lineage=(*parent.lineage, step)), output)
    return Extended(found, measured)
