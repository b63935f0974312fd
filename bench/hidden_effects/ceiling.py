"""The ceiling: the simulation's own laws, with magnitude and shape fitted, at the likeliest places.

The laws act on the true base, so no calibration can follow them better; how far it is from the
table counts as unknown within the tolerances of wrong bases, as for all other solvers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from bench_wrist import Array, wrist
from dictionary import Dictionary
from observe import QUIET, Day, Riddle, settings_of, times
from scipy.optimize import least_squares
from scipy.special import ndtr
from scipy.stats import chi2
from solvers import ALPHA, INDISTINGUISHABLE, STRUCTURE, Answer, nothing
from units import unit_means
from whitened import Whitened, whitened

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.simulation.catalogue import CATALOGUE, places
from wrist_stiffness.simulation.cell import CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.effect_entry import Draw
from wrist_stiffness.simulation.laws.law import Law
from wrist_stiffness.simulation.size import BasePose, base_pose, departure
from wrist_stiffness.simulation.wrist import TrueWrist

PLACES = 6
"""Likeliest places by linear words, which are fitted with their laws."""

DRAWS = 5
"""Random shapes of which the best one begins a fit."""

MOST_EFFECTS = 2
EVALUATIONS = 20
"""Of a fit, the differences for its slopes aside."""

SMALL_STEP = 3e-3
"""Of the differences, of the order of the numbers' own spread."""


class Numbers:
    """Stands in for a random generator: gives the numbers that a fit proposes.

    Parameters
    ----------
    values : sequence of float
        Standard normal numbers behind every draw; beyond their end it is zero.
    """

    def __init__(self, values: Array) -> None:
        self._values, self.used = values, 0

    def _next(self, count: int) -> Array:
        out = np.zeros(count)
        given = self._values[self.used : self.used + count]
        out[: len(given)] = given
        self.used += count
        return out

    def normal(self, size: int | tuple[int, ...] = 1) -> Array:
        """Return numbers of the wanted shape."""
        return self._next(int(np.prod(size))).reshape(size)

    def uniform(self, low: object = 0.0, high: object = 1.0, size: int | None = None) -> object:
        """Return numbers between bounds, evenly spread for normal values behind them."""
        low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        shape = np.broadcast(low, high).shape if size is None else (size,)
        share = ndtr(self._next(int(np.prod(shape, dtype=int)))).reshape(shape)
        out = low + (high - low) * share
        return out if out.shape else float(out)

    def integers(self, low: int, high: int | None = None) -> int:
        """Return a whole number below `high`, or below `low` where it is the only bound."""
        first, end = (0, low) if high is None else (low, high)
        return first + min(int((end - first) * ndtr(self._next(1)[0])), end - first - 1)


class LawCell(VirtualCell):
    """A cell whose hidden law is given instead of named."""

    def __init__(self, table: Table, settings: CellSettings, law: Law) -> None:
        super().__init__(table, settings, np.random.default_rng(0))
        law.told(self.program)
        self._laws = [law, *self._laws]
        self._wrist = TrueWrist(table, self._laws)


class Signatures:
    """What laws do to the units of both days, found by simulation on the true base."""

    def __init__(self, riddle: Riddle) -> None:
        case = riddle.case
        self._table, self._time_s, self._days = wrist(), times(case), riddle.days
        self._settings = [
            replace(
                settings_of(replace(case, path="fast"), session),
                instrument="ideal",
                sees="pose",
                lost_beams=0.0,
                load_sensor=QUIET,
            )
            for session in (0, 1)
        ]
        self._without, self._base, self._rest = [], [], []
        for day, settings in zip(riddle.days, self._settings, strict=True):
            cell = VirtualCell(self._table, settings, np.random.default_rng(0))
            sample = self._run(cell)
            base = base_pose(self._table, sample.encoder, sample.wrench)
            self._without.append(sample)
            self._base.append(base)
            self._rest.append(self._left(sample, base, day))

    def _run(self, cell: VirtualCell) -> CellSample:
        return cell.run(self._time_s, cell.desired(self._time_s))

    def _left(self, sample: CellSample, base: BasePose, day: Day) -> Array:
        """Return residuals (n, 6) after the registration of a day."""
        seen = day.registration.seen(base)
        return departure(sample.measured_rotation, sample.measured_shift, seen)

    def without(self, day: int) -> Array:
        """Return the residuals of the units where nothing hides and nothing is noisy, (u, 6)."""
        return unit_means(self._days[day].labels, self._rest[day])

    def of(self, law: Law, day: int) -> Array:
        """Return the change of the units' residuals by a law on a day, (u, 6)."""
        sample = self._run(LawCell(self._table, self._settings[day], law))
        without, base = self._without[day], self._base[day]
        same = np.array_equal(sample.encoder, without.encoder)
        if not (same and np.array_equal(sample.wrench, without.wrench)):
            base = base_pose(self._table, sample.encoder, sample.wrench)
        change = self._left(sample, base, self._days[day]) - self._rest[day]
        return unit_means(self._days[day].labels, change)


@dataclass(frozen=True)
class Fitted:
    """One place and form with the likeliest magnitude and shape: a law, and how good it is."""

    name: str
    make: Callable[[], Law]
    train: Array
    cost: float
    free: int


def knows_the_laws(riddle: Riddle, words: Dictionary) -> Answer:
    """Fit magnitude and shape of the likeliest effects by their own laws, one after another."""
    signatures, fit = Signatures(riddle), whitened(riddle, words)
    left = np.where(riddle.train.measured, riddle.train.residual - signatures.without(0), 0.0)
    begun, rest = left, fit.white(left)
    n = len(rest)
    excess = float(rest @ rest) - n
    rng = np.random.default_rng(riddle.case.seed)
    classes, chosen = [], []
    for _ in range(MOST_EFFECTS):
        rest = fit.white(left)
        start = float(rest @ rest)
        if chosen and chi2.sf(start, n) > ALPHA:
            break
        fits = sorted(_fits(fit, left, words, signatures, rng), key=lambda each: each.cost)
        if not fits:
            break
        best = fits[0]
        gain = start - best.cost
        if chi2.sf(max(gain, 0.0), best.free) > ALPHA / len(words.searched):
            break
        near = [each.name for each in fits if each.cost < best.cost + INDISTINGUISHABLE]
        classes.append(tuple(dict.fromkeys(near)))
        chosen.append(best)
        left = left - best.train
    rest = fit.white(left)
    over = float(rest @ rest) - n
    structure = chi2.sf(over + n, n) < ALPHA and over > STRUCTURE * excess
    if not chosen:
        return nothing(riddle, "unknown" if structure else "none")
    test = sum((signatures.of(each.make(), 1) for each in chosen), np.zeros_like(left[:1]))
    train = begun - left
    return Answer("unknown" if structure else "effect", tuple(classes), (train, np.asarray(test)))


def _fits(
    fit: Whitened, left: Array, words: Dictionary, signatures: Signatures, rng: np.random.Generator
) -> list[Fitted]:
    """Return the fits of all forms at the likeliest places."""
    rest = fit.white(left)
    gains = []
    for word in words.searched:
        design = fit.word(word)
        values, _, rank, _ = np.linalg.lstsq(design, rest, rcond=1e-6)
        explained = design @ values
        # The tail of chi-squared would be zero for every large effect, and all places alike.
        gains.append((float(explained @ explained) - int(rank) * np.log(len(rest)), word.name))
    likeliest = [name for _, name in sorted(gains, reverse=True)[:PLACES]]
    found = []
    for name in likeliest:
        effect, component = name.split("@")
        for _, where, form in places({effect: CATALOGUE[effect]}):
            if where == component:
                one = _fit(fit, rest, (effect, component, form), signatures, rng)
                if one is not None:
                    found.append(one)
    return found


def _fit(
    fit: Whitened,
    rest: Array,
    place: tuple[str, str, str],
    signatures: Signatures,
    rng: np.random.Generator,
) -> Fitted | None:
    """Fit logarithm of the magnitude and shape; None where no shape could be simulated."""
    effect, component, form = place
    entry, table = CATALOGUE[effect], wrist()

    def law(p: Array) -> Law:
        magnitude = float(np.exp(np.clip(p[0], -30.0, np.log(entry.limit))))
        return entry.make(Draw(table, component, form, magnitude, Numbers(p[1:])))

    def white(p: Array) -> Array:
        return fit.white(signatures.of(law(p), 0))

    counter = Numbers(np.zeros(0))
    # A direction of nothing has no length; only the number of draws matters here.
    with np.errstate(invalid="ignore", divide="ignore"):
        entry.make(Draw(table, component, form, entry.plausible, counter))
    starts = []
    for _ in range(DRAWS if counter.used else 1):
        shape = rng.standard_normal(counter.used)
        p = np.concatenate([[np.log(0.3 * entry.plausible)], shape])
        try:
            change = white(p)
        except InputError:
            continue
        along, size = float(change @ rest), float(change @ change)
        if along <= 0.0 or size == 0.0:
            continue
        p[0] = min(p[0] + np.log(along / size), np.log(entry.limit))
        starts.append((float(rest @ rest) - along**2 / size, tuple(p)))
    if not starts:
        return None

    def misfit(p: Array) -> Array:
        try:
            return np.concatenate([rest - white(p), p[1:]])
        except InputError:
            return np.full(len(rest) + counter.used, 1e3)

    begin = np.array(min(starts)[1])
    # Numbers of the order of one: relative steps would vanish where a number is zero.
    done = least_squares(
        misfit, begin, diff_step=SMALL_STEP / np.maximum(np.abs(begin), 0.1), max_nfev=EVALUATIONS
    )
    sharp = np.linalg.slogdet(done.jac.T @ done.jac + 1e-9 * np.eye(len(begin)))[1]
    # Laplace's evidence: a shape that had to be hit exactly counts for less.
    cost = 2.0 * done.cost + float(sharp)
    return Fitted(
        f"{effect}@{component}",
        lambda: law(done.x),
        signatures.of(law(done.x), 0),
        cost,
        len(begin),
    )
