"""The cases of the benchmark: which effect hides where, how large, on which base, how measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from zlib import crc32

from wrist_stiffness.simulation.catalogue import CATALOGUE, Entry, places
from wrist_stiffness.simulation.instrument import instrument

ABSORBED = ("measurement_frame", "target_mounting", "encoder_offset", "load_bias")
"""Refitted in every session before any search: to find them is no diagnosis."""

SIZES = (0.5, 1.0, 3.0, 30.0, 100.0)

WRISTS = 60
"""Wrong wrists, each with its noise, that take turns."""

Place = tuple[str, str, str]


@dataclass(frozen=True)
class Case:
    """One riddle.

    Parameters
    ----------
    effects : tuple of (effect, component, form)
        Empty = nothing hides; two = both do.
    size : float
        Of each, in units of one sample's noise.
    base, experiment, instrument, sees, lost_beams
        As in `CellSettings`.
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
    seed: int = 1

    @property
    def key(self) -> str:
        """Name by which a finished case is known again."""
        hidden = "+".join("-".join(place) for place in self.effects) or "nothing"
        measured = f"{self.instrument}-{self.sees}-{self.lost_beams:g}"
        # The noise of all cases that were ever posed is drawn by their keys: "fast" stays in them.
        return "|".join(
            [hidden, f"{self.size:g}", self.base, self.experiment, measured, "fast", str(self.seed)]
        )

    @property
    def bare(self) -> Case:
        """The same wrist on the same days without what hides in it."""
        return replace(self, effects=(), size=0.0)

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


def singles() -> list[Case]:
    """Return every effect at every place and size, mixed: a beginning is a fair sample."""
    cases = [Case((place,), size) for place in searched(CATALOGUE) for size in SIZES]
    cases = [replace(case, seed=1 + crc32(f"wrist {case.key}".encode()) % WRISTS) for case in cases]
    return sorted(cases, key=lambda case: crc32(case.key.encode()))
