"""What every law of the simulation does in a given experiment: the words a solver may use.

For solvers that are allowed to know the laws.  Directions and time constants of an effect are not
known beforehand: a word is the span of several draws of its shape, as few directions as hold it.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bench_wrist import SECONDS, Array, wrist
from cases import ABSORBED, Case
from observe import QUIET, settings_of, times, unit_labels, unit_means

from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect
from wrist_stiffness.simulation.cell import VirtualCell
from wrist_stiffness.simulation.size import Scale

KEPT = 3e-3
"""Directions whose singular value is smaller than this share of the largest are left out."""

SMALL = 0.3
"""Share of the plausible magnitude at which a law is taken as linear."""


@dataclass(frozen=True)
class Word:
    """Span of one effect at one place, over both sessions.

    Parameters
    ----------
    name : str
        `effect@component`.
    train, test : (u, 6, r) float
        Change of the units' residuals by each of r directions.
    """

    name: str
    train: Array
    test: Array


def words_of(name: str, experiment: str, draws: int) -> Word | None:
    """Return the span of an effect at a place, None where nothing changes or no draw can be run."""
    effect, component = name.split("@")
    entry = CATALOGUE[effect]
    case = Case((), 0.0, "exact", experiment, "interferometer", 0)
    both = []
    for session in (0, 1):
        settings = settings_of(case, session)
        scale = Scale(wrist(), settings, SECONDS)
        quiet = replace(settings, instrument="ideal", load_sensor=QUIET)
        labels = unit_labels(VirtualCell(wrist(), quiet, np.random.default_rng(0)), times())
        columns = []
        for draw in range(draws):
            form = entry.forms[draw % len(entry.forms)]
            if effect == "gravity" and form == "tilt" and component != "platform":
                form = "mass"
            magnitude = SMALL * entry.plausible
            hidden = HiddenEffect(effect, component, form, magnitude, 7000 + draw)
            try:
                columns.append(unit_means(labels, scale.signature(hidden)) / SMALL)
            except InputError:
                return None
        both.append(np.stack(columns, axis=-1))
    whole = np.concatenate(both) / np.repeat([1e-6, 3e-5], 3)[:, None]
    flat = whole.reshape(-1, whole.shape[-1])
    _, sizes, directions = np.linalg.svd(flat, full_matrices=False)
    if sizes[0] == 0.0:
        return None
    mix = directions[sizes > KEPT * sizes[0]].T
    return Word(name, both[0] @ mix, both[1] @ mix)


def _one(task: tuple[str, str, int]) -> Word | None:
    return words_of(*task)


def dictionary(
    experiment: str, components: bool, draws: int, processes: int, folder: Path
) -> list[Word]:
    """Return the words of all effects, from the folder where they were kept before.

    Parameters
    ----------
    experiment : str
        As in `CellSettings`.
    components : bool
        Every place, or the first place of each effect alone.
    draws : int
        Of an effect's shape.
    processes : int
        To spread the work over.
    folder : Path
        Cache.
    """
    names = [
        f"{effect}@{component}"
        for effect, entry in CATALOGUE.items()
        for component in (entry.components if components else entry.components[:1])
    ]
    path = folder / f"words_{experiment}_{len(names)}_{draws}.npz"
    if not path.exists():
        with ProcessPoolExecutor(processes) as pool:
            words = list(pool.map(_one, [(name, experiment, draws) for name in names]))
        arrays = {
            f"{word.name}|{part}": getattr(word, part)
            for word in words
            if word is not None
            for part in ("train", "test")
        }
        partial = path.with_suffix(".part.npz")
        np.savez_compressed(partial, **arrays)
        partial.replace(path)
    with np.load(path, allow_pickle=False) as kept:
        return [
            Word(name, kept[f"{name}|train"], kept[f"{name}|test"])
            for name in names
            if f"{name}|train" in kept
        ]


def nuisance_names() -> tuple[str, ...]:
    """Return the words that are refitted in every session."""
    return tuple(
        f"{effect}@{component}" for effect in ABSORBED for component in CATALOGUE[effect].components
    )
