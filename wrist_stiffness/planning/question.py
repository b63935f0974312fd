"""What an experiment shall tell: everything about a new wrist, or which of some rivals is true."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import catalogue, effect_named
from wrist_stiffness.planning.information import Goal
from wrist_stiffness.planning.signatures import plausible
from wrist_stiffness.sessions.refitted import BUILT, SET_UP, names_of

TARE = "load_bias@load_sensor"
"""Set anew in every session, but known to its plausible size."""

SESSION = tuple(name for name in names_of(SET_UP) if name != TARE)
"""Of which nothing is known in a session."""

WRIST = (TARE, *names_of(BUILT))
"""Known to their plausible sizes."""

TRUTHS = 2
"""Plausible sets of values at which an effect with several parameters is planned for."""


@dataclass(frozen=True, eq=False)
class Question:
    """What an experiment is planned for."""

    effects: tuple[tuple[Effect, ...], ...]  # each at one or more plausible sets of values
    nuisances: tuple[Effect, ...]  # refitted whatever is asked
    free: tuple[str, ...]  # nuisances of which nothing is known
    # questions; None for all effects and the nearest rivals of each
    goals: tuple[Goal, ...] | None = None
    # classes of rivals: made equally large, as all explain the same measurements; the first one is
    # as large as its values say
    alike: tuple[tuple[str, ...], ...] = ()

    def without(self, names: Collection[str]) -> Question:
        """Return the same without some of the effects."""
        goals = self.goals
        if goals is not None:
            goals = tuple(g for g in goals if g.truth not in names and g.rival not in names)
        effects = tuple(sets for sets in self.effects if sets[0].name not in names)
        return replace(self, effects=effects, goals=goals)


def drawn(effect: Effect, rng: np.random.Generator) -> tuple[Effect, ...]:
    """Return an effect at plausible values, several sets where it has several parameters."""
    count = 1 if len(effect.parameters) == 1 else TRUTHS
    return tuple(plausible(effect, rng) for _ in range(count))


def commissioning(rng: np.random.Generator) -> Question:
    """Ask for everything: calibrate the wrist, see every effect, keep the nearest ones apart."""
    known = (*SESSION, *WRIST)
    names = [f"{law.id}@{place}" for law in catalogue().values() for place in law.places]
    effects = tuple(drawn(effect_named(name), rng) for name in names if name not in known)
    return Question(effects, _nuisances(known), SESSION)


def between(
    classes: Sequence[Sequence[Effect]], silent: Sequence[Effect], rng: np.random.Generator
) -> Question:
    """Ask which member of each class is the true one, and whether silent effects are there.

    `classes`: rivals; the first of each class with the values that the diagnosis found, or at its
    prior means where it found them in other coordinates; `silent`: what the diagnosis could not
    have seen; what is always refitted is no question of its own; `rng`: draws plausible values.
    The best member of every other class is refitted as well.  Raises `InputError` if there is
    nothing to ask.
    """
    rivals: dict[str, tuple[Effect, ...]] = {}
    goals = []
    for members in classes:
        if len(members) > 1:
            best = members[0]
            valued = any(best.estimates[p.key].value != p.mean for p in best.parameters)
            rivals[best.name] = (best,) if valued else drawn(best, rng)
            for effect in members[1:]:
                rivals.setdefault(effect.name, drawn(effect, rng))
            goals += [Goal(a.name, b.name) for a in members for b in members if a is not b]
    for effect in silent:
        if effect.name in (*SESSION, *WRIST):
            continue
        rivals.setdefault(effect.name, drawn(effect, rng))
        goals.append(Goal(effect.name, ""))
    if not goals:
        raise InputError(
            "plan: the diagnosis leaves nothing to separate: every class has one member, and "
            "every effect was excited but those that are always refitted (plan --commissioning)"
        )
    found = [members[0] for members in classes if members and members[0].name not in rivals]
    known = [name for name in (*SESSION, *WRIST) if name not in rivals]
    nuisances = _nuisances([n for n in known if n not in {effect.name for effect in found}])
    alike = tuple(tuple(e.name for e in members) for members in classes if len(members) > 1)
    free = (*(name for name in SESSION if name in known), *(effect.name for effect in found))
    return Question(tuple(rivals.values()), (*nuisances, *found), free, tuple(goals), alike)


def _nuisances(names: Sequence[str]) -> tuple[Effect, ...]:
    return tuple(effect_named(name) for name in names)
