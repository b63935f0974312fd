"""The cases of the benchmark: which effect hides where, how large, on which base, how measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from wrist_stiffness.simulation.catalogue import CATALOGUE, STRANGERS, Entry, places
from wrist_stiffness.simulation.instrument import instrument

ABSORBED = ("measurement_frame", "target_mounting", "encoder_offset", "load_bias")
"""Refitted in every session before any search: to find them is no diagnosis."""

REGISTRATIONS = ("measurement_frame", "target_mounting")
"""Of these, where the instrument and its target stand: another day they stand elsewhere.  Zeros and
tare are the machine's, and its nodes use them until somebody fits them anew."""

SIZES = (0.5, 1.0, 3.0, 30.0, 100.0)
TINY = 0.05
EXACT_SIZES = (TINY, 0.5, 3.0, 30.0)

AT_REST = (
    *("link_stiffness", "bushing_stiffness", "drive_compliance", "mount_compliance", "gravity"),
    *("joint_clearance", "flange_contact", "bushing_hardening", "axis_misalignment"),
    *("thermal_expansion", "thermal_softening", "load_scale", "load_misalignment"),
    *("load_point", "load_cross_talk", "drift"),
)
"""Effects whose laws need no motion: those that the exact path can hide."""

SAMPLED_ONE_IN = 25

WRISTS, WRISTS_ELSEWHERE = 60, 12
"""Wrong wrists, each with its noise, that take turns in the main design and in any other."""

Place = tuple[str, str, str]


@dataclass(frozen=True)
class Case:
    """One riddle.

    Parameters
    ----------
    effects : tuple of (effect, component, form)
        Empty = nothing hides; two = both do; many = an ordinary wrist.
    size : float
        Of each, in units of one sample's noise; an ordinary wrist has plausible sizes instead.
    base, experiment, instrument, sees, lost_beams
        As in `CellSettings`.
    path : str
        Truth by the `fast` or by the `exact` equilibrium.
    seed : int
        Of shapes, noise and base.
    """

    effects: tuple[Place, ...]
    size: float
    base: str = "wrong"
    experiment: str = "rich"
    instrument: str = "interferometer"
    sees: str = "pose"
    lost_beams: float = 0.0
    path: str = "fast"
    seed: int = 1

    @property
    def key(self) -> str:
        """Name by which a finished case is known again."""
        hidden = "+".join("-".join(place) for place in self.effects) or "nothing"
        measured = f"{self.instrument}-{self.sees}-{self.lost_beams:g}"
        hidden = f"everything{crc32(hidden.encode()):08x}" if self.ordinary else hidden
        return "|".join(
            [hidden, f"{self.size:g}", self.base, self.experiment, measured, self.path]
            + [str(self.seed)]
        )

    @property
    def ordinary(self) -> bool:
        """Whether every effect is there at a plausible size."""
        return len(self.effects) > 2

    @property
    def kind(self) -> str:
        """`none`, `single`, `double`, `ordinary` or `stranger`."""
        if not self.effects:
            return "none"
        if any(effect in STRANGERS for effect, _, _ in self.effects):
            return "stranger"
        return "ordinary" if self.ordinary else ("single", "double")[len(self.effects) - 1]

    @property
    def main(self) -> bool:
        """Whether this is the design for which the goals hold."""
        return (self.base, self.experiment, self.sees, self.path) == (
            "wrong",
            "rich",
            "pose",
            "fast",
        ) and not self.static

    @property
    def bare(self) -> Case:
        """The same wrist on the same days without what hides in it."""
        return replace(self, effects=(), size=0.0)

    def asked(self, solver: str) -> bool:
        """Whether a solver that is not asked everything is asked this case."""
        if solver == "knows_the_laws":
            return self.main and self.kind in ("single", "double")
        return crc32(f"sample {self.key}".encode()) % SAMPLED_ONE_IN == 0

    @property
    def static(self) -> bool:
        """Whether the instrument measures at rests only."""
        return instrument(self.instrument).static

    @property
    def seconds(self) -> float:
        """Duration of one session: 40 to 100 rests for an instrument that needs them [s]."""
        return 240.0 if self.static else 120.0


def searched(entries: dict[str, Entry]) -> list[Place]:
    """Return the places of all effects that are not absorbed beforehand."""
    return [place for place in places(entries) if place[0] not in ABSORBED]


def one_each(entries: dict[str, Entry]) -> list[Place]:
    """Return the first place and form of each effect."""
    return list({place[0]: place for place in reversed(searched(entries))}.values())


def ordinary_wrist(seed: int) -> tuple[Place, ...]:
    """Return one place and form of every effect of the catalogue, drawn from the seed."""
    rng = np.random.default_rng([seed, 0xA11])
    by_effect: dict[str, list[Place]] = {}
    for place in searched(CATALOGUE):
        by_effect.setdefault(place[0], []).append(place)
    return tuple(each[rng.integers(len(each))] for each in by_effect.values())


def _on_a_wrist(case: Case) -> Case:
    """Return the case on one of the wrong wrists."""
    wrists = WRISTS if case.main else WRISTS_ELSEWHERE
    return replace(case, seed=1 + crc32(f"wrist {case.key}".encode()) % wrists)


def stage_of(case: Case) -> int:
    """Return when a case is run: the main design, others of its experiment, all others."""
    if case.main:
        return 0
    if case.experiment != "rich":
        return 3
    return 2 if case.static else 1


def quick_cases() -> list[tuple[Case, str]]:
    """Return a sound wrist and a visible fault, each with the verdict that is right.

    A stranger takes minutes: of one the tutorial tells, which `test/test_readme.py` runs.
    """
    return [
        (Case((), 0.0), "none"),
        (Case((("backlash", "motor_1", "single"),), 3.0), "effect"),
    ]


def full_cases() -> list[Case]:
    """Return all cases stage by stage, mixed in each: its beginning is a fair sample of it."""
    nothing = Case((), 0.0)
    cases = [replace(nothing, seed=seed) for seed in range(1, 151)]
    cases += [replace(nothing, base="exact", seed=seed) for seed in range(1, 41)]
    for experiment in ("paper", "dead_weights", "production"):
        cases += [replace(nothing, experiment=experiment, seed=seed) for seed in range(1, 16)]
    for instrument_name in ("tracker", "cmm"):
        cases += [replace(nothing, instrument=instrument_name, seed=s) for s in range(1, 16)]
    cases += [*map(_on_a_wrist, _hidden()), *map(_ordinary, range(1, 13))]
    return sorted(cases, key=lambda case: (stage_of(case), crc32(case.key.encode())))


def _ordinary(seed: int) -> Case:
    return Case(ordinary_wrist(seed), 0.0, seed=seed)


def _hidden() -> list[Case]:
    """Return all cases with one or two effects, on no wrist yet."""
    cases: list[Case] = []
    for place in searched(CATALOGUE):
        single = Case((place,), 3.0)
        cases += [replace(single, size=size) for size in SIZES]
        cases += [replace(single, size=size, base="exact") for size in EXACT_SIZES]
        cases += [
            replace(single, experiment=experiment)
            for experiment in ("paper", "dead_weights", "production")
        ]
        cases += [replace(single, instrument="tracker", lost_beams=0.02)]
        cases += [replace(single, instrument="cmm")]
    for place in one_each(CATALOGUE):
        cases += [Case((place,), 3.0, sees=sees) for sees in ("points", "pointing")]
        cases += [Case((place,), 3.0, lost_beams=0.02), Case((place,), TINY)]
    cases += [Case((place,), size) for place in searched(STRANGERS) for size in (1.0, 3.0, 30.0)]
    cases += [
        Case((place,), 3.0, "exact", instrument="cmm", path="exact")
        for place in searched(CATALOGUE)
        if place[0] in AT_REST
    ]
    singles = searched(CATALOGUE)
    partners = singles[len(singles) // 3 :] + singles[: len(singles) // 3]
    pairs = [pair for pair in zip(singles, partners, strict=True) if pair[0][0] != pair[1][0]]
    return cases + [Case(pair, 3.0) for pair in pairs]
