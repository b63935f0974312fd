"""How good an answer is, and how sure one can be of a rate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from bench_wrist import Array
from cases import WRISTS, Case
from dictionary import Dictionary
from observe import Riddle, bare_day
from own_diagnosis import calibrated
from scipy.stats import spearmanr
from solvers import Answer
from whitened import Whitened, whitened

from wrist_stiffness.simulation.catalogue import is_plausible

Z = 1.96
"""Of a two-sided 95 % interval."""

DETECTABLE = 3.0
"""Length of a signature in standard deviations, beside nuisances and base, that data can show."""


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (Wilson 1927)."""
    if trials == 0:
        return 0.0, 1.0
    rate = hits / trials
    centre = rate + Z * Z / (2 * trials)
    half = Z * np.sqrt(rate * (1 - rate) / trials + Z * Z / (4 * trials * trials))
    scale = 1 + Z * Z / trials
    return max(0.0, float((centre - half) / scale)), min(1.0, float((centre + half) / scale))


class HeldOut:
    """Error of the second day, whitened, once it was calibrated.

    All solvers are calibrated alike after what they explain was taken off: on the first day
    registrations, zeros and tare, and the wrist's stiffnesses, axes and load scale within the
    spread of wrong bases; on the second day registrations, zeros and tare again.
    """

    def __init__(self, riddle: Riddle, words: Dictionary) -> None:
        self._train = whitened(riddle, words)
        self._base = words.base.test
        test = riddle.test
        slow = test.wander[:6, :6]
        self._rows = test.measured.ravel()
        self._factor = np.linalg.cholesky(test.covariance + slow)
        columns = np.concatenate([word.test for word in words.nuisance], axis=2)
        white = self._white(columns)
        basis, sizes, _ = np.linalg.svd(white / np.linalg.norm(white, axis=0), full_matrices=False)
        self._basis = basis[:, sizes > 1e-6 * sizes[0]]

    def error(self, train: Array, test: Array) -> float:
        """Return the error for what is left of both days, (u, 6)."""
        flat = self._white(test - self._base @ self._train.base_estimate(train))
        return float(np.linalg.norm(flat - self._basis @ (self._basis.T @ flat)))

    def contribution(self, change: Array) -> float:
        """Return how long a change of the second day is beside its own nuisances."""
        flat = self._white(change)
        return float(np.linalg.norm(flat - self._basis @ (self._basis.T @ flat)))

    def _white(self, values: Array) -> Array:
        shaped = values if values.ndim == 3 else values[..., None]
        flat = np.linalg.solve(self._factor, shaped).reshape(-1, shaped.shape[2])
        return flat[self._rows].reshape(-1, *values.shape[2:])


@dataclass(frozen=True)
class Line:
    """Score of one case by one solver, as it is kept in the results file.

    `kind`: as of the case, or `unexcitable` (registrations, zeros and tare take up what it does) or
    `absorbed` (the tolerances of a wrong base do); `plausible`: a wrist with that would still work;
    `reached`: the largest size in reach where it is less than the wanted one;
    `top`: the first name of the first class is true; `inside`: the first class holds a true name;
    `found`: share of the true names that stand in any class; `before`, `after`: error of the second
    day over that of who is told the answer.
    """

    key: str
    solver: str
    version: str
    kind: str
    effect: str
    size: float
    base: str
    experiment: str
    measured: str
    path: str
    main: bool
    plausible: bool
    excitation: float
    detectability: float
    verdict: str
    named: list[list[str]]
    top: bool
    inside: bool
    found: float
    class_size: int
    spurious: int
    not_excited: bool
    before: float
    after: float
    after_with_suspects: float
    rank_correlation: float | None
    seconds: float


class Judge:
    """Scores the answers to one riddle."""

    def __init__(self, riddle: Riddle, words: Dictionary) -> None:
        self._riddle = riddle
        self._held = HeldOut(riddle, words)
        self._floor = floor(riddle.case.bare, words)
        self._before = self._held.error(riddle.train.residual, riddle.test.residual)
        change = riddle.train.residual - riddle.bare[0].residual
        self._detectability = float(np.linalg.norm(whitened(riddle, words).white(change)))
        known_base = Whitened(riddle.train, words, with_base=False)
        self._excitation = float(np.linalg.norm(known_base.white(change)))

    @property
    def kind(self) -> str:
        """What the case is, by what the data can show of it."""
        kind = self._riddle.case.kind
        if kind not in ("single", "double"):
            return kind
        if self._excitation < DETECTABLE:
            return "unexcitable"
        return "absorbed" if self._detectability < DETECTABLE else kind

    def line(self, name: str, answer: Answer, version: str, seconds: float) -> Line:
        """Return the scores of one answer."""
        riddle, held, case = self._riddle, self._held, self._riddle.case
        truths = {f"{h.effect}@{h.component}" for h in riddle.hidden}
        first = answer.classes[0] if answer.classes else ()
        anywhere = {member for members in answer.classes for member in members}
        days = riddle.train.residual, riddle.test.residual
        after, after_with_suspects = (
            held.error(days[0] - explained[0], days[1] - explained[1]) / self._floor
            for explained in (answer.explained, answer.explained_with_suspects or answer.explained)
        )
        ordered = bool(riddle.parts) and name != "told_the_answer"
        return Line(
            key=case.key,
            solver=name,
            version=version,
            kind=self.kind,
            effect="everything"
            if case.ordinary
            else "+".join(sorted(h.effect for h in riddle.hidden)) or "nothing",
            size=case.size,
            base=case.base,
            experiment=case.experiment,
            measured=f"{case.instrument} {case.sees}" + (" lost beams" if case.lost_beams else ""),
            path=case.path,
            main=case.main,
            plausible=all(is_plausible(each) for each in riddle.hidden),
            excitation=self._excitation,
            detectability=self._detectability,
            verdict=answer.verdict,
            named=[list(members) for members in answer.classes],
            top=bool(first) and first[0] in truths,
            inside=bool(truths & set(first)),
            found=len(truths & anywhere) / len(truths) if truths else 0.0,
            class_size=len(first),
            spurious=sum(not truths & set(members) for members in answer.classes),
            not_excited=bool(truths) and truths <= set(answer.not_excited),
            before=self._before / self._floor,
            after=after,
            after_with_suspects=after_with_suspects,
            rank_correlation=self._ranks(answer) if ordered else None,
            seconds=seconds,
        )

    def _ranks(self, answer: Answer) -> float:
        """Return Spearman's correlation of true contributions and the order of the suspects."""
        names = list(self._riddle.parts)
        true = [self._held.contribution(self._riddle.parts[name]) for name in names]
        order = answer.suspects or in_order(answer.classes)
        said = [order.get(name, 0.0) for name in names]
        return float(spearmanr(true, said).statistic) if np.ptp(said) > 0.0 else 0.0


@lru_cache(maxsize=WRISTS)
def floor(bare: Case, words: Dictionary) -> float:
    """Return the error of the second day of a wrist in which nothing hides.

    The better of two calibrations counts: the one of all solvers, and that after the project's own.
    """
    days = bare_day(bare, 0), bare_day(bare, 1)
    held = HeldOut(Riddle(bare, (), days, days), words)
    one, two = (day.units.residual for day in days)
    explained = calibrated(days)
    return min(held.error(one, two), held.error(one - explained[0], two - explained[1]))


def in_order(classes: tuple[tuple[str, ...], ...]) -> dict[str, float]:
    """Return a figure for each name, larger for those that were named earlier."""
    out: dict[str, float] = {}
    for number, members in enumerate(classes):
        for member in members:
            out.setdefault(member, float(len(classes) - number))
    return out
