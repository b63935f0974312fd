"""A case: an effect hidden in the virtual cell, and its twins in the paper's design."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from wrist import MODEL, NOISE, TABLE, left_by, paper_design

from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import catalogue, effect_named
from wrist_stiffness.planning.information import (
    FREE,
    Goal,
    Information,
    Layout,
    beyond_nuisances,
    discrimination,
    information,
)
from wrist_stiffness.planning.question import SESSION, WRIST, drawn
from wrist_stiffness.planning.signatures import Signature, signatures
from wrist_stiffness.planning.timeline import Timeline
from wrist_stiffness.simulation.catalogue import ALL, CATALOGUE, HiddenEffect, places

HIDDEN = (
    "backlash",
    "drive_compliance",
    "mount_compliance",
    "frame_compliance",
    "platform_compliance",
    "gravity",
    "joint_clearance",
    "bushing_hardening",
    "joint_friction",
    "creep",
    "load_misalignment",
    "load_point",
    "encoder_eccentricity",
    "cable_wrench",
)
"""What poses and loads at rest can show, and no diagnosis refits anyway."""

VISIBLE = 6.0
"""Discrimination from nothing that the hidden effect has in the paper's design, beyond what its
law's parameters cost: a diagnosis finds it."""

PARAMETER = float(np.log(300.0))
"""What a parameter costs by the Bayesian information criterion, with some hundred numbers."""

DECISIVE = 6.0
MOST_TWINS = 5


class NoCase(Exception):
    """Why a draw is left out."""


@dataclass(frozen=True, eq=False)
class Case:
    """A hidden effect and what the paper's design leaves open.

    Parameters
    ----------
    seed : int
        Of its draw.
    hidden : HiddenEffect
        Of the virtual cell.
    truth : str
        Its name in the model's catalogue.
    members : tuple of str
        Its class, best first, the truth among them.
    left : (n, 6) float
        What it leaves in the paper's design.
    known : Information
        That the paper's design has of the catalogue, with the simulation's truth.
    """

    seed: int
    hidden: HiddenEffect
    truth: str
    members: tuple[str, ...]
    left: np.ndarray
    known: Information

    @property
    def twins(self) -> list[str]:
        """The wrong members."""
        return [name for name in self.members if name != self.truth]


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Every effect of the model's catalogue, in the paper's design too."""

    timeline: Timeline

    @cached_property
    def sets(self) -> dict[str, tuple[Effect, ...]]:
        """Those that a diagnosis does not refit anyway, at plausible values."""
        rng = np.random.default_rng(99)
        names = [f"{law.id}@{place}" for law in catalogue().values() for place in law.places]
        return {n: drawn(effect_named(n), rng) for n in names if n not in (*SESSION, *WRIST)}

    @cached_property
    def signs(self) -> list[Signature]:
        """Signatures of the nuisances, then of the others."""
        known = [(effect_named(name),) for name in (*SESSION, *WRIST)]
        found = signatures(MODEL, self.timeline.block, [*known, *self.sets.values()])
        return [each for each in found if not each.lacks]

    @property
    def nuisances(self) -> list[Signature]:
        """What a diagnosis refits anyway."""
        return self.signs[: len(SESSION) + len(WRIST)]

    def draw(self, seed: int) -> Case:
        """Draw a case.

        Raises
        ------
        NoCase
            If the draw is too small at its limit or has no twins.
        """
        rng = np.random.default_rng(seed)
        choices = [place for place in places(CATALOGUE) if place[0] in HIDDEN]
        # Every effect is as likely as any other, however many places it has.
        name = HIDDEN[rng.integers(len(HIDDEN))]
        own = [place for place in choices if place[0] == name]
        effect, component, form = own[rng.integers(len(own))]
        hidden = HiddenEffect(effect, component, form, ALL[effect].plausible, seed)
        try:
            hidden, left, known = self._made_visible(hidden)
        except InputError as error:
            raise NoCase(str(error)[:60]) from error
        truth = f"{effect}@{component}"
        return Case(seed, hidden, truth, self._class_of(truth, known), left, known)

    def _made_visible(self, hidden: HiddenEffect) -> tuple[HiddenEffect, np.ndarray, Information]:
        truth = f"{hidden.effect}@{hidden.component}"
        rivals = self.signs[len(self.nuisances) :]
        for _ in range(3):
            left = left_by(self.timeline, hidden)
            effects = [replace(r, truths=left[..., None]) if r.name == truth else r for r in rivals]
            known = information(self.timeline, self.nuisances, SESSION, effects, TABLE, NOISE)
            size = float(discrimination(known.total, known.layout, [Goal(truth, "")])[0])
            wanted = np.sqrt(VISIBLE**2 + PARAMETER * len(known.layout.columns[truth]))
            if 0.8 * wanted < size < 1.25 * wanted:
                break
            larger = hidden.magnitude * wanted / max(size, 1e-3)
            if larger > ALL[hidden.effect].limit:
                raise NoCase("too small at its limit")
            hidden = replace(hidden, magnitude=larger)
        return hidden, left, known

    def _class_of(self, truth: str, known: Information) -> tuple[str, ...]:
        """Return the effects that fit about as well as the best one and are worth theirs."""
        by_name = {each.name: each for each in self.signs[len(self.nuisances) :]}
        names = list(by_name)
        margins = dict(zip(names, behind(known.total, known.layout, truth, names), strict=True))
        best = min(margins.values())
        members = sorted(
            (
                name
                for name in names
                if margins[name] - best <= DECISIVE
                and worth_its_parameters(known, truth, name)
                and (name == truth or in_bounds(known.total, known.layout, truth, by_name[name]))
            ),
            key=margins.__getitem__,
        )
        if truth not in members:
            raise NoCase("not in the class that the paper's design leaves")
        members = members[:MOST_TWINS]
        if truth not in members:
            members[-1] = truth
        if len(members) < 2:
            raise NoCase("no twins")
        return tuple(members)


def in_paper_design() -> Catalogue:
    """Return the catalogue with its signatures in the paper's design."""
    return Catalogue(paper_design())


def behind(gram: np.ndarray, layout: Layout, truth: str, names: list[str]) -> np.ndarray:
    """Return by how much each name lies behind the truth in the criterion, (..., b)."""
    goals = [Goal(truth, name) for name in (truth, *names)]
    squares = discrimination(gram, layout, goals) ** 2
    return squares[..., 1:] - squares[..., :1]


def worth_its_parameters(known: Information, truth: str, name: str) -> bool:
    """Tell whether the criterion prefers an effect to nothing for what the truth left."""
    inner, cross = _normal(known.total, known.layout, truth, name)
    explained = float((cross.T @ np.linalg.solve(inner, cross)).item())
    return explained > PARAMETER * len(inner)


def in_bounds(gram: np.ndarray, layout: Layout, truth: str, signature: Signature) -> bool:
    """Tell whether about such values fit the hidden effect best as its law allows."""
    inner, cross = _normal(gram, layout, truth, signature.name)
    sizes = np.linalg.solve(inner, cross)[:, 0]
    effect = signature.effect
    linear = effect.stage != "sensor" and all(p.linear for p in effect.parameters)
    return all(
        p.lower <= (0.0 if linear else effect.estimates[p.key].value) + size * p.scale <= p.upper
        for p, size in zip(effect.parameters, sizes, strict=True)
    )


def _normal(
    gram: np.ndarray, layout: Layout, truth: str, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of an effect for what the truth left."""
    left = beyond_nuisances(gram, layout)
    columns, y = layout.columns[name], layout.truths[truth]
    inner = left[np.ix_(columns, columns)] + np.eye(len(columns)) / FREE**2
    return inner, left[np.ix_(columns, y)]
