"""What is proposed for an error that nothing on the list explains, in words and as a law."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.identification.forms import EVERYWHERE, Form, Shape
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula import names_in
from wrist_stiffness.model.formula_law import LOAD_SENSOR, SIGNALS, TOOL, FormulaLaw, words_of
from wrist_stiffness.model.parameters import Estimate, si_factor
from wrist_stiffness.model.places import BODY, LIMB
from wrist_stiffness.numerals import number, plus_minus

SAME: dict[str, tuple[str, ...]] = {
    "frame": ("the stand of the instrument",),
    "platform": ("the target on it",),
    LOAD_SENSOR: ("whatever pulls at the platform",),
    TOOL: ("whatever pulls and turns with the platform",),
}
"""What does exactly the same and is none of the wrist."""


BESIDE = {
    "size_um": "size_mdeg",
    "size_mdeg": "size_um",
    "size_N": "size_Nmm",
    "size_Nmm": "size_N",
}
"""The other half of a screw or a wrench."""

TURNING = ("size_mdeg", "size_Nmm")
"""Sizes of a turn, or of a moment."""


def _unit(key: str) -> str:
    return key.rpartition("_")[2]


def twins(component: str) -> tuple[str, ...]:
    """Return where else the very same screw may sit: no recording can tell."""
    seats = {name: (LIMB[name], BODY[name]) for name in LIMB}
    seat = seats.pop(component, None)
    others = (name for name, own in seats.items() if own == seat)
    return (*others, *SAME.get(component, ()))


@dataclass(frozen=True, eq=False)
class Proposal:
    """A law: a form of signals as a screw at a component.

    Parameters
    ----------
    form : Form
        How its size follows from the signals.
    shape : tuple of float
        Numbers inside the form.
    component : str
        Where.
    direction : (r, 6) float
        Translation; rotation at O in the component's home frame, for a size of 1, one for each
        formula of the form; those of `key` have length 1 together [m, rad; N, N m].
    value, sigma : float
        Size and its standard uncertainty, in the unit of `key`.
    key : str
        `size_um` or `size_mdeg`; of a wrench `size_N` or `size_Nmm`.
    probability : float
        That it is the one, among all that were asked and none of them; of a second law, that both
        are.
    log_gain : float
        Natural logarithm of the evidence with it over that without it, its prior included.
    explains : float
        Share of the error above the noise that it explains.
    change : (u, 6) float
        What it does to the prediction of each unit [m, rad].
    """

    form: Form
    shape: Shape
    component: str
    direction: Array
    value: float
    sigma: float
    key: str
    probability: float
    log_gain: float
    explains: float
    change: Array

    @property
    def formula(self) -> str:
        """In the grammar of `extend --formula`."""
        return ", ".join(f"{self.key} * {each.write(self.shape)}" for each in self.form.each)

    @property
    def way(self) -> str:
        """Direction as `extend --direction` takes it: `along +z`, or six numbers; or several."""
        if len(self.direction) > 1 or (self.direction[:, :3].any() and self.direction[:, 3:].any()):
            return words_of(self.direction, digits=4)
        return _words(self.direction[0], self.key)

    @property
    def places(self) -> str:
        """Component, and where else it may sit."""
        return " or ".join((self.component, *twins(self.component)))

    @property
    def sentence(self) -> str:
        """What it says of the wrist."""
        screws = [self._screw(row) for row in self.direction]
        laws = [form.tell(self.shape) for form in self.form.each]
        if len(screws) == 1:
            return f"{screws[0]} at {self.places} {laws[0]}"
        told = (f"{screw} {law}" for screw, law in zip(screws, laws, strict=True))
        return f"at {self.places}: {'; '.join(told)}"

    def _screw(self, row: Array) -> str:
        """Return how large it is along one direction, in words."""
        other, turns = BESIDE[self.key], self.key in TURNING
        parts = (row[3:], row[:3]) if turns else (row[:3], row[3:])
        length, beside = (float(np.linalg.norm(part)) for part in parts)
        size = plus_minus(self.value * length, self.sigma * length)
        screw = f"{size} {_unit(self.key)} {_words(row, self.key)}"
        if beside:
            more = self.value * si_factor(self.key) / si_factor(other) * beside
            screw += f" and {number(more)} {_unit(other)} {_words(row, other)}"
        return screw

    def effect(self, name: str = "proposed") -> Effect:
        """Return it as an effect of a model."""
        text = self.formula
        used = sorted(names_in(text) - SIGNALS - {self.key})
        law = FormulaLaw(name, self.component, self.direction, text, used, (self.key,))
        return Effect(law, self.component, {self.key: Estimate(self.value, self.sigma)})

    def command(self, model: str, recordings: Sequence[str], name: str = "proposed") -> str:
        """Return the command that adds it to a model file."""
        words = ["wrist-stiffness", "extend", model, "--formula", self.formula]
        words += ["--component", self.component, "--direction", self.way, "--name", name]
        words += ["--fit", *recordings, "-o", f"{name}.yaml"]
        return shlex.join(words)

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "formula": self.formula,
            "component": self.component,
            "or": list(twins(self.component)),
            "direction": self.way,
            self.key: [self.value, self.sigma],
            "probability": self.probability,
            "log_gain": self.log_gain,
            "explains": self.explains,
            "sentence": self.sentence,
        }


def _percent(probability: float) -> str:
    return "over 99 %" if probability > 0.99 else f"{100.0 * probability:.0f} %"


def _words(row: Array, key: str) -> str:
    """Return the direction of a shift or a turn in words, `along +z`."""
    turns = key in TURNING
    three = row[3:] if turns else row[:3]
    own = three / np.linalg.norm(three)
    axis = int(np.argmax(np.abs(own)))
    if abs(own[axis]) == 1.0:
        words = f"{'+' if own[axis] > 0.0 else '-'}{'xyz'[axis]}"
    else:
        words = f"({', '.join(f'{each:.2f}' for each in own)})"
    return f"{'about' if turns else 'along'} {words}"


@dataclass(frozen=True, eq=False)
class Proposals:
    """Laws for what a model leaves.

    Parameters
    ----------
    terms : tuple of Proposal
        One law or two together; none where no law is sure enough.
    rivals : tuple of Proposal
        Others in place of the first, the most probable first.
    probability : float
        That the error follows one of the laws that were asked.
    places : dict of str to float
        Probability of each component, where it is one of them.
    asked : int
        Forms times components times directions.
    complete : bool
        Whether all that may lead were judged before the time was over.
    """

    terms: tuple[Proposal, ...]
    rivals: tuple[Proposal, ...]
    probability: float
    places: Mapping[str, float]
    asked: int
    complete: bool = True

    @property
    def tells_apart(self) -> str:
        """What to record to tell the first from its closest rival; empty where there is none."""
        if not (self.terms and self.rivals):
            return ""
        one, two = self.terms[0].form, self.rivals[0].form
        if one.name != two.name:
            needs = dict.fromkeys(each.needs for form in (one, two) for each in form.each)
            return f"record {'; and '.join(needs)}"
        return f"record {one.needs}, each at {EVERYWHERE}"

    def lines(
        self,
        model: str = "MODEL",
        recordings: Sequence[str] = ("RECORDING",),
        named: Sequence[str] = (),
    ) -> list[str]:
        """Return them for a terminal, with the commands that add them.

        Parameters
        ----------
        model : str
            Model file.
        recordings : sequence of str
            To fit to.
        named : sequence of str
            Effects, `name@component`, beside which they were found: these are added first.
        """
        # A model that has such a law already is not overwritten.
        before = re.fullmatch(r"proposed_(\d+)", Path(model).stem)
        first = int(before[1]) + 1 if before else 1
        out = []
        for count, each in enumerate(self.terms, first):
            name = f"proposed_{count}"
            out.append(f"{'Proposed law' if count == first else 'And'}: {each.sentence}.")
            of = "what the first leaves above it" if count > first else "the error above the noise"
            sure = f"{_percent(each.probability)} sure{' of both' if count > first else ''}"
            out.append(f"   explains {100.0 * each.explains:.0f} % of {of}; {sure}")
            for place, effect in enumerate(named if count == first else (), 1):
                target = f"found_{place}.yaml"
                words = ["extend", model, "--effect", effect, "--fit", *recordings, "-o", target]
                out.append(f"   {shlex.join(['wrist-stiffness', *words])}")
                model = target
            out.append(f"   {each.command(model, recordings, name)}")
            model = f"{name}.yaml"
        if self.rivals:
            out += [f"   or ({_percent(e.probability)}) {e.sentence}" for e in self.rivals]
            out.append(f"   to tell the first two apart: {self.tells_apart}")
        if not self.complete:
            out.append("The time was over before every law was judged. Allow more --seconds.")
        return out

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "terms": [each.as_values() for each in self.terms],
            "rivals": [each.as_values() for each in self.rivals],
            "probability": self.probability,
            "components": dict(self.places),
            "tells_apart": self.tells_apart,
            "asked": self.asked,
            "complete": self.complete,
        }
