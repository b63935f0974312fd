"""Which parameters a fit may move: effects with a start, a prior and a scope."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.refitted import ANSWERS_LOAD, AXES, BUILT, GAPS, SET_UP, TOLERATED

SHIM_UM = 1.5
"""Standard deviation of a flange gap after fitting: shims come in steps of 5 um."""

EVENLY_SPREAD = 1.0 / math.sqrt(3.0)
"""Standard deviation over the limit of a tolerance: a part lies anywhere within (GUM 4.3.7)."""


@dataclass(frozen=True)
class FreeEffect:
    """An effect whose parameters are fitted."""

    effect: Effect  # its values are the start and the mean of the prior
    # standard deviation of the prior of each parameter that is free, in the unit of its name;
    # infinite for none.  A parameter that is left out keeps its value
    scale: Mapping[str, float] = field(default_factory=dict)
    per_session: bool = False  # whether every session has values of its own

    @property
    def step(self) -> dict[str, float]:
        """Natural size of each free parameter: of its prior, of its value, or 1."""
        return {
            key: scale if np.isfinite(scale) else abs(self.effect.estimates[key].value) or 1.0
            for key, scale in self.scale.items()
        }


def free_all(effect: Effect, per_session: bool = False) -> FreeEffect:
    """Return an effect with all its parameters free, by the priors of its law."""
    scale = {parameter.key: parameter.scale for parameter in effect.parameters}
    return FreeEffect(effect, scale, per_session)


def commissioning(
    model: ErrorModel, calibrated: Sequence[str] = ()
) -> tuple[tuple[FreeEffect, ...], tuple[Effect, ...]]:
    """Return what is always refitted, and what of the model stays as it is.

    `model`: its effects are starts where they are among those that are refitted; `calibrated`: ids
    of effects that the recordings say were calibrated otherwise.
    The former are registrations, zeros and tare of each session; tolerances of the wrist; and every
    further effect of the model that was estimated.
    """
    own = {effect.name: effect for effect in model.effects}
    free: dict[str, FreeEffect] = {}
    for group, per_session in ((SET_UP, True), (BUILT, False)):
        for law, places in group:
            for place in places:
                effect = Effect(find_law(law), place)
                held = law in calibrated or (
                    effect.stage == "parts" and model.evaluation == "spline"
                )
                if not held:
                    free[effect.name] = free_all(own.get(effect.name, effect), per_session)
    for name, effect in own.items():
        estimates = effect.estimates
        # A parameter without an uncertainty is believed as it stands.
        scale = {p.key: p.scale for p in effect.parameters if estimates[p.key].sigma > 0.0}
        if name not in free and scale:
            free[name] = FreeEffect(effect, scale)
    return tuple(free.values()), tuple(own[name] for name in own if name not in free)


def within_tolerances(free: Sequence[FreeEffect], shimmed: bool = True) -> tuple[FreeEffect, ...]:
    """Return free effects, those of the wrist with the priors of what is built as drawn.

    So a search holds them, and so does the fit of what it named: a flange that stands otherwise
    is a fault with a name of its own, and gaps that may go anywhere would take a part of any other.

    `free`: with the priors of their laws; `shimmed`: whether the gaps still are as shims left them;
    an axis that moved later opened them.
    """
    found = []
    for each in free:
        scale = each.scale
        if each.effect.law.id == GAPS:
            scale = dict.fromkeys(scale, SHIM_UM) if shimmed else scale
        elif each.effect.law.id in TOLERATED:
            scale = {key: EVENLY_SPREAD * limit for key, limit in scale.items()}
        found.append(replace(each, scale=scale))
    return tuple(found)


def unfitted(model: ErrorModel) -> ErrorModel:
    """Return a model without what a fit has found of its set-up and of the wrist's tolerances.

    For another fit to the same data.  They would count twice, first as knowledge; and what stood in
    for a missing effect would go on standing in for it, at no price.  A tolerance that was added as
    a finding stays, and with an axis the gaps that it left.
    """
    laws = {law for law, _ in (*SET_UP, *BUILT)}
    added = {step.added for step in model.lineage}
    if any(name.startswith(f"{AXES}@") for name in added):
        laws -= {GAPS}
    return model.with_effects(
        *(
            effect
            for effect in model.effects
            if effect.law.id not in laws
            or effect.name in added
            or all(estimate.sigma == 0.0 for estimate in effect.estimates.values())
        )
    )


def answering_as(model: ErrorModel, fitted: ErrorModel) -> ErrorModel:
    """Return a fitted model that answers a load as the model before the fit did.

    Under a load of the wrong sign or unit a fit makes every part so stiff that no load does
    anything; then none that is put right would do anything either.
    """
    kept = [effect for effect in fitted.effects if effect.law.id not in ANSWERS_LOAD]
    own = [effect for effect in model.effects if effect.law.id in ANSWERS_LOAD]
    return fitted.with_effects(*kept, *own)
