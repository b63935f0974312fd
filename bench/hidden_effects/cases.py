"""The cases of the benchmark: which effect hides where, how large, on which base, how measured."""

from __future__ import annotations

from dataclasses import dataclass

from wrist_stiffness.simulation.catalogue import CATALOGUE, STRANGERS, Entry, places

ABSORBED = ("measurement_frame", "target_mounting", "encoder_offset", "load_bias")
"""Refitted in every session before any search: to find them is no diagnosis."""

SIZES = (0.5, 3.0, 30.0)
WIDE_SIZES = (0.05, 0.5, 1.0, 3.0, 30.0, 100.0)


@dataclass(frozen=True)
class Case:
    """One riddle.

    Parameters
    ----------
    effects : tuple of (effect, component, form)
        Empty = nothing hides; two = both do.
    size : float
        Of each, in units of one sample's noise.
    base, experiment, instrument : str
        As in `CellSettings`.
    seed : int
        Of shapes, noise and base.
    """

    effects: tuple[tuple[str, str, str], ...]
    size: float
    base: str
    experiment: str
    instrument: str
    seed: int

    @property
    def key(self) -> str:
        """Name by which a finished case is known again."""
        hidden = "+".join("-".join(place) for place in self.effects) or "nothing"
        return f"{hidden}|{self.size:g}|{self.base}|{self.experiment}|{self.instrument}|{self.seed}"

    @property
    def kind(self) -> str:
        """`none`, `single`, `double` or `stranger`."""
        if not self.effects:
            return "none"
        if any(effect in STRANGERS for effect, _, _ in self.effects):
            return "stranger"
        return "single" if len(self.effects) == 1 else "double"


def searched(entries: dict[str, Entry]) -> list[tuple[str, str, str]]:
    """Return the places of all effects that are not absorbed beforehand."""
    return [place for place in places(entries) if place[0] not in ABSORBED]


def quick_cases() -> list[Case]:
    """Return one place an effect at size 3, some strangers, and wrists without an effect."""
    cases = [Case((), 0.0, "exact", "rich", "interferometer", seed) for seed in range(6)]
    for entries in (CATALOGUE, STRANGERS):
        first = {place[0]: place for place in reversed(searched(entries))}
        cases += [
            Case((place,), 3.0, "exact", "rich", "interferometer", 1) for place in first.values()
        ]
    return cases


def full_cases() -> list[Case]:
    """Return every place, form and size on both bases, doubles, strangers, and 150 of nothing."""
    cases = []
    for base in ("exact", "wrong"):
        for experiment in ("rich", "paper"):
            cases += [
                Case((), 0.0, base, experiment, "interferometer", seed)
                for seed in range(150 if experiment == "rich" else 30)
            ]
        for size in WIDE_SIZES if base == "exact" else SIZES:
            for entries in (CATALOGUE, STRANGERS):
                cases += [
                    Case((place,), size, base, "rich", "interferometer", 1)
                    for place in searched(entries)
                ]
        cases += [
            Case((place,), 3.0, base, experiment, "interferometer", 1)
            for experiment in ("paper", "dead_weights", "production")
            for place in searched(CATALOGUE)
        ]
    cases += [
        Case((place,), 3.0, "exact", "rich", instrument, 1)
        for instrument in ("tracker", "cmm")
        for place in searched(CATALOGUE)
    ]
    singles = searched(CATALOGUE)
    pairs = zip(singles[::2], singles[len(singles) // 2 :: 2], strict=False)
    cases += [Case(pair, 3.0, "exact", "rich", "interferometer", 2) for pair in pairs]
    return cases
