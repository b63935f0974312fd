"""What every law of the simulation does in a given experiment: the words a solver may use.

For solvers that are allowed to know the laws.  Directions and time constants of an effect are not
known beforehand: a word is the span of several draws of its shape, as few directions as hold it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from bench_wrist import TRUTH, Array, code_version, wrist
from cases import ABSORBED, Case
from observe import day_of, run_cell, settings_of, times
from units import unit_labels, unit_means

from wrist_stiffness.cli.progress import Progress
from wrist_stiffness.errors import InputError
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect, places
from wrist_stiffness.simulation.cell import VirtualCell
from wrist_stiffness.simulation.size import Scale

KEPT = 3e-3
"""Directions whose singular value is smaller than this share of the largest are left out."""

SMALL = 0.3
"""Share of the plausible magnitude at which a law is taken as linear."""

DRAWS = 6
"""Draws of an effect's shape."""

BASES = 160
"""Wrong bases that are drawn to know what a wrong base does: so many leave 0.1 of a unit's
variance unknown."""

FIRST_BASE = 50_000
"""Seeds of these bases, which no case has."""

SOURCES = ("dictionary.py", "observe.py", "units.py", "registered.py")


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


@dataclass(frozen=True, eq=False)
class Dictionary:
    """What the laws do in one design.

    Parameters
    ----------
    words : tuple of Word
        Of all effects, those that every session refits included.
    base : Word
        What a wrong base does: the sum of the columns' squares is its covariance.
    """

    words: tuple[Word, ...]
    base: Word

    @property
    def searched(self) -> list[Word]:
        """Words that a search may choose."""
        return [word for word in self.words if word.name not in nuisance_names()]

    @property
    def nuisance(self) -> list[Word]:
        """Words that are refitted in every session."""
        return [word for word in self.words if word.name in nuisance_names()]


def design_of(case: Case) -> tuple[str, bool]:
    """Return what words depend on: the experiment, and whether only rests are measured."""
    return case.experiment, case.static


def _blank(design: tuple[str, bool]) -> Case:
    experiment, static = design
    return Case((), 0.0, "exact", experiment, "cmm" if static else "interferometer", seed=0)


def word_of(name: str, design: tuple[str, bool], draws: int) -> Word | None:
    """Return the span of an effect at a place, None where nothing changes or no draw can be run."""
    effect, component = name.split("@")
    entry, case = CATALOGUE[effect], _blank(design)
    forms = [f for e, c, f in places({effect: entry}) if c == component]
    both = []
    for session in (0, 1):
        settings = settings_of(case, session)
        scale = Scale(wrist(), settings, case.seconds)
        cell = VirtualCell(wrist(), settings, np.random.default_rng(0))
        labels = unit_labels(cell.program, times(case), case.static)
        columns = []
        for draw in range(draws):
            magnitude = SMALL * entry.plausible
            form = forms[draw % len(forms)]
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


def base_draw(number: int, design: tuple[str, bool]) -> tuple[Array, Array]:
    """Return what one drawn wrong base leaves after registration on both days, two (u, 6)."""
    wrong = replace(_blank(design), base="wrong", seed=FIRST_BASE + number)
    one, two = (_quiet(wrong, session) - _right(design, session) for session in (0, 1))
    return one, two


def _quiet(case: Case, session: int) -> Array:
    return day_of(case, session, run_cell(case, (), session, quiet=True)).units.residual


@cache
def _right(design: tuple[str, bool], session: int) -> Array:
    return _quiet(_blank(design), session)


def _task(task: tuple[Callable[..., object], tuple[object, ...]]) -> object:
    function, arguments = task
    return function(*arguments)


@cache
def dictionary(design: tuple[str, bool], folder: Path, processes: int = 1) -> Dictionary:
    """Return what the laws do in a design, from the folder where it was kept before.

    Parameters
    ----------
    design : (str, bool)
        See `design_of`.
    folder : Path
        Cache.
    processes : int
        To spread the work over.
    """
    names = [
        f"{effect}@{component}"
        for effect, entry in CATALOGUE.items()
        for component in entry.components
    ]
    version = code_version(TRUTH, SOURCES)
    kind = f"{design[0]}{'_rests' if design[1] else ''}"
    path = folder / f"words_{kind}_{version}.npz"
    if not path.exists():
        _make(names, design, path, processes)
    with np.load(path, allow_pickle=False) as kept:
        found = [
            Word(name, kept[f"{name}|train"], kept[f"{name}|test"])
            for name in ("base", *names)
            if f"{name}|train" in kept
        ]
    return Dictionary(tuple(found[1:]), found[0])


def _make(names: list[str], design: tuple[str, bool], path: Path, processes: int) -> None:
    tasks = [(base_draw, (number, design)) for number in range(BASES)]
    tasks += [(word_of, (name, design, DRAWS)) for name in names]
    progress, made = Progress(f"words of {path.stem}"), []
    with ProcessPoolExecutor(processes) as pool:
        for one in pool.map(_task, tasks):
            made.append(one)
            progress(len(made), len(tasks))
    drawn = [np.stack(day, axis=-1) / np.sqrt(BASES) for day in zip(*made[:BASES], strict=True)]
    arrays = {"base|train": drawn[0], "base|test": drawn[1]}
    for word in made[BASES:]:
        if word is not None:
            arrays |= {f"{word.name}|train": word.train, f"{word.name}|test": word.test}
    partial = path.with_suffix(".part.npz")
    np.savez_compressed(partial, **arrays)
    partial.replace(path)


def nuisance_names() -> tuple[str, ...]:
    """Return the words that are refitted in every session."""
    return tuple(
        f"{effect}@{component}" for effect in ABSORBED for component in CATALOGUE[effect].components
    )
