"""How good an answer is, and how sure one can be of a rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bench_wrist import Array
from dictionary import Dictionary
from observe import Riddle
from own_diagnosis import calibrated
from scipy.stats import spearmanr
from solvers import Answer
from whitened import Whitened

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
        self._train = Whitened(riddle.train, words)
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


def detectability(riddle: Riddle, words: Dictionary) -> float:
    """Return the length of the true signature on the first day beside nuisances and base."""
    change = riddle.train.residual - riddle.bare[0].residual
    return float(np.linalg.norm(Whitened(riddle.train, words).white(change)))


@dataclass(frozen=True)
class Line:
    """Score of one case by one solver, as it is kept in the results file.

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
    rank_correlation: float | None
    seconds: float


def floor_of(riddle: Riddle, words: Dictionary) -> float:
    """Return the error of the second day of the wrist without its hidden effects.

    The better of two calibrations counts: the one of all solvers, and that after the project's own.
    """
    held, (one, two) = HeldOut(riddle, words), riddle.bare
    explained = calibrated(riddle.bare_days)
    return min(
        held.error(one.residual, two.residual),
        held.error(one.residual - explained[0], two.residual - explained[1]),
    )


def score(
    riddle: Riddle,
    name: str,
    answer: Answer,
    words: Dictionary,
    floor: float,
    version: str,
    seconds: float,
) -> Line:
    """Return the scores of one answer; `floor` is that of the riddle."""
    case = riddle.case
    truths = {f"{h.effect}@{h.component}" for h in riddle.hidden}
    first = answer.classes[0] if answer.classes else ()
    anywhere = {member for members in answer.classes for member in members}
    held = HeldOut(riddle, words)
    before = held.error(riddle.train.residual, riddle.test.residual)
    after = held.error(
        riddle.train.residual - answer.explained[0], riddle.test.residual - answer.explained[1]
    )
    detectable = detectability(riddle, words) if truths else 0.0
    unseen = case.kind in ("single", "double") and detectable < DETECTABLE
    return Line(
        key=case.key,
        solver=name,
        version=version,
        kind="unexcitable" if unseen else case.kind,
        effect="everything"
        if case.ordinary
        else "+".join(sorted(h.effect for h in riddle.hidden)) or "nothing",
        size=case.size,
        base=case.base,
        experiment=case.experiment,
        measured=f"{case.instrument} {case.sees}" + (" lost beams" if case.lost_beams else ""),
        path=case.path,
        detectability=detectable,
        verdict=answer.verdict,
        named=[list(members) for members in answer.classes],
        top=bool(first) and first[0] in truths,
        inside=bool(truths & set(first)),
        found=len(truths & anywhere) / len(truths) if truths else 0.0,
        class_size=len(first),
        spurious=sum(not truths & set(members) for members in answer.classes),
        not_excited=bool(truths) and truths <= set(answer.not_excited),
        before=before / floor,
        after=after / floor,
        rank_correlation=_ranks(riddle, answer, held) if riddle.parts else None,
        seconds=seconds,
    )


def _ranks(riddle: Riddle, answer: Answer, held: HeldOut) -> float:
    """Return Spearman's correlation between true contributions and the order of what was named."""
    names = list(riddle.parts)
    true = [held.contribution(riddle.parts[name]) for name in names]
    said = np.zeros(len(names))
    for number, members in enumerate(answer.classes):
        for member in members:
            if member in names and said[names.index(member)] == 0.0:
                said[names.index(member)] = len(answer.classes) - number
    return float(spearmanr(true, said).statistic) if np.ptp(said) > 0.0 else 0.0
