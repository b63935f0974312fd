"""Signs, units and names that a cell got wrong: which of them would explain the error.

No set-up explains a load of the wrong sign, and no effect is as large.  So the few usual mistakes
are tried on what was measured.  The most probable one is told where it explains most of the error;
one that explains part of it may be asked by a whole fit (`wrong_load`).  None is ever applied:
whoever wired the cell has to look.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.comparing.explained import Explained
from wrist_stiffness.comparing.set_up import INDEPENDENT, without_set_up
from wrist_stiffness.identification.calibration import said_calibrated
from wrist_stiffness.inference.observations import Observations
from wrist_stiffness.inference.reading import NAMING
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.numerals import number, percent
from wrist_stiffness.sessions.gauges import Gauge
from wrist_stiffness.sessions.measured_session import MOST_BEYOND, MeasuredSession, overloaded
from wrist_stiffness.sessions.observing import Observed
from wrist_stiffness.sessions.unit_session import UnitSession, all_units

LOOK_FIRST = "Look at the set-up first"
"""How the sentence begins that tells a mistake."""

WORTH_ASKING = 2.0
"""Error over the instrument's noise from which a whole fit is asked for a mistake."""

BESIDE = (0.5, 2.0)
"""A unit is none if so many times its load fits better: then the wrist has another stiffness, as a
fault may give it.  The units that are taken for each other are more than four times apart."""

APART = 4.0
"""No wrist is so many times as soft as its model, and units are farther apart."""

RIGHT = 0.5
"""Probability, before anything is measured, that nothing is wrong: as good as any other."""

CLEAR = 0.5
"""A mistake is told if without it less than this share is left of what s or phi has above noise and
drift: a fault explains the rest no better."""


@dataclass(frozen=True)
class Mistake:
    """One thing that is easily got wrong."""

    without: str  # the data without it, after "with"
    check: str  # where to look
    # from the recorded signals to those without it
    block: Callable[[Block], Block] = lambda block: block
    shift_factor: float = 1.0  # the same for the measured positions
    gauge: str = ""  # name of a gauge whose readings turn their sign without it
    # a wrist stiffer or softer than its model may look like it: none is a thousandfold
    stiff: bool = False

    def put_right(self, session: UnitSession) -> UnitSession:
        """Return the session without the mistake."""
        cut = replace(session.cut, block=self.block(session.block))
        factor = np.repeat([self.shift_factor, 1.0], 3)
        if session.gauges is not None:
            turned = [each.name == self.gauge for each in session.gauges.members]
            factor = np.where(turned, -1.0, 1.0)
        return replace(session, cut=cut, values=factor * session.values)

    def measured_right(self, session: MeasuredSession) -> MeasuredSession:
        """Return a session as it was measured without the mistake."""
        return replace(
            session, block=self.block(session.block), shift=self.shift_factor * session.shift
        )

    def with_load(self, times: float) -> Mistake:
        """Return it beside a load so many times as large."""
        return replace(self, block=lambda block: _load(times)(self.block(block)))

    def unit(self, key: str) -> float:
        """Return how many units of a quantity one unit of the instrument really is."""
        return self.shift_factor if key == "s_um" else 1.0

    def concerns(self, session: UnitSession) -> bool:
        """Tell whether the session could have it: a measured rotation names its own motors."""
        same_angles = self.block(session.block).theta is session.block.theta
        if session.gauges is not None:
            # Where the wrist moved, motors, units and signs were told when these were held to it.
            return same_angles and self.shift_factor == 1.0 and not session.moves(self.gauge)
        return same_angles or not np.isfinite(session.values[:, 3:]).any()


def _load(force: float, moment: float | None = None) -> Callable[[Block], Block]:
    """Return the load so many times as large, its moment as the force where it is not told."""
    factor = np.repeat([force, force if moment is None else moment], 3)
    return lambda block: replace(block, load=factor * block.load)


LOAD_MISTAKES = (
    Mistake(
        "the load's sign turned",
        "does the sensor show what acts on the platform, or the reaction (acts_on: environment)?",
        _load(-1.0),
    ),
    Mistake("the load times 1000", "is it in kN and kN m?", _load(1e3)),
    Mistake("the load times 9.81", "is it in kilograms?", _load(9.80665), stiff=True),
    Mistake("the load times 4.45", "is it in pounds (lbf)?", _load(4.4482216), stiff=True),
    Mistake(
        "the load in the other frame",
        "does the load sensor turn with the platform (wrist_platform) or not (wrist_base)?",
        lambda block: replace(block, load_on_platform=not block.load_on_platform),
    ),
)

GRAMS = 1e3 / 9.80665
"""Grams-force in a newton."""

LARGE_LOADS = {
    (True, True): (
        Mistake(
            "the load divided by 1000",
            "is it in mN and N mm where N and N m belong?",
            _load(1e-3),
        ),
        Mistake("the load divided by 102", "is it in grams where N belong?", _load(1.0 / GRAMS)),
    ),
    (True, False): (
        Mistake("the forces divided by 1000", "are they in mN where N belong?", _load(1e-3, 1.0)),
        Mistake(
            "the forces divided by 102",
            "are they in grams where N belong?",
            _load(1.0 / GRAMS, 1.0),
        ),
    ),
    (False, True): (
        Mistake(
            "the moments divided by 1000", "are they in N mm where N m belong?", _load(1.0, 1e-3)
        ),
    ),
}
"""Units that make loads too large, by whether forces and moments are beyond what a table takes."""

NO_LOAD = Mistake(
    "the load left out", "does the load that was recorded act on the platform?", _load(0.0)
)
"""What a load is held against that may be none at all."""

MISTAKES = (
    *LOAD_MISTAKES,
    Mistake(
        "the motors swapped",
        "--joint names motor 1 first",
        lambda block: replace(block, theta=block.theta[:, ::-1]),
    ),
    Mistake(
        "positions divided by 1000",
        "are they in mm? A recording has m",
        shift_factor=1e-3,
    ),
    Mistake(
        "positions times 1000",
        "are they in m where mm belong, as in the _mm columns of a table?",
        shift_factor=1e3,
    ),
    Mistake(
        "positions times 25.4",
        "are they in inches where mm belong, as in the _mm columns of a table?",
        shift_factor=25.4,
        stiff=True,
    ),
)


def _turned(gauge: Gauge) -> Mistake:
    return Mistake(
        f"the sign of gauge {gauge.name} turned", f"does it {gauge.counts_up}?", gauge=gauge.name
    )


@dataclass(frozen=True)
class Suspicion:
    """A mistake that explains part of an error."""

    mistake: Mistake  # the most probable one
    probability: float  # of it, against all others and none
    # what is left without it of what s or phi has above noise and drift, whichever falls more
    share: float
    fall: str  # how the error falls

    @property
    def clear(self) -> bool:
        """Whether nothing else explains so much."""
        return self.share < CLEAR

    def told(self, fall: str) -> str:
        """Return the sentence for a technician, with this or another account of the fall."""
        sure = percent(self.probability)
        return (
            f"{LOOK_FIRST}: with {self.mistake.without} {fall} ({sure} sure); {self.mistake.check}"
        )


def suspected(
    model: ErrorModel,
    observed: Observed,
    calibrated: Sequence[str],
    left: Explained,
    mistakes: Sequence[Mistake] = MISTAKES,
) -> Suspicion | None:
    """Return the mistake that most probably was made, None if most probably none was.

    What was measured is the model's prediction, in the unit and with the sign of the mistake, and
    noise of a size that nobody knows: so the likelihood of a mistake goes with the error that it
    leaves in the unit of the instrument, to the power of minus the numbers measured.

    `calibrated`: effects of the set-up that are not refitted; `left`: what the units leave after
    the refit; `mistakes`: those that are tried.
    """
    before, count = left.error, independent(left.observations)
    gauges = observed.sessions[0].gauges
    mistakes = (*mistakes, *(map(_turned, gauges.members) if gauges is not None else ()))

    def gains(mistake: Mistake) -> dict[str, float]:
        """Return the logarithm of its likelihood against that of none, by quantity."""
        after = _without(mistake, model, observed, calibrated)
        return {key: count[key] * np.log(before[key] / size) for key, size in after.items() if size}

    found = {mistake: gain for mistake in mistakes if (gain := gains(mistake))}
    logs = np.array([sum(gain.values()) for gain in found.values()])
    largest = logs.max(initial=0.0)
    weights = np.exp(logs - largest) * (1.0 - RIGHT) / len(mistakes)
    total = weights.sum() + RIGHT * np.exp(-largest)
    if not len(logs) or weights.max() < NAMING * total:
        return None
    mistake = list(found)[int(np.argmax(logs))]
    # Where no load acts, positions do not follow it in any unit either.
    found[NO_LOAD] = gains(NO_LOAD)
    if sum(found[NO_LOAD].values()) > logs.max():
        mistake = NO_LOAD
    if mistake.stiff and any(
        sum(gains(mistake.with_load(times)).values()) > logs.max() for times in BESIDE
    ):
        return None
    after = {key: before[key] * np.exp(-gain / count[key]) for key, gain in found[mistake].items()}
    floor = {key: float(np.hypot(left.noise[key], left.drift[key])) for key in before}
    shares = [
        _above(after[key], floor[key]) / _above(before[key], floor[key])
        for key in after
        if before[key] > floor[key]
    ]
    share = min(shares, default=1.0)
    right = {key: size * mistake.unit(key) for key, size in after.items()}
    fall = " and ".join(
        f"from {number(before[q.key])} to {q.told(right[q.key])}"
        for q in left.observations.reported
    )
    # Below the noise what is left of larger positions may be larger.
    larger = any(right[key] > before[key] for key in right if mistake.unit(key) != 1.0)
    verb = "goes" if larger else "falls"
    return Suspicion(mistake, float(weights.max() / total), share, f"the error {verb} {fall}")


def told_mistake(suspicion: Suspicion | None) -> str:
    """Return a clear mistake in a sentence; empty for none, or one that is not clear."""
    return suspicion.told(suspicion.fall) if suspicion and suspicion.clear else ""


def independent(left: Observations) -> dict[str, float]:
    """Return how many numbers of each quantity count for themselves."""
    units = np.minimum(np.bincount(left.sessions), INDEPENDENT) / np.bincount(left.sessions)
    known = np.isfinite(left.values) * units[left.sessions, None]
    return {q.key: float(known[:, list(q.components)].sum()) for q in left.reported}


def _above(rms: float, floor: float) -> float:
    """Return what of an error is above noise and drift."""
    return float(np.sqrt(max(rms**2 - floor**2, 0.0)))


def _without(
    mistake: Mistake,
    model: ErrorModel,
    observed: Observed,
    calibrated: Sequence[str],
) -> dict[str, float]:
    """Return the error left without a mistake, in units of the instrument; empty if it is none.

    In its own units noise and errors compare with what they were before.
    """
    if not all(mistake.concerns(session) for session in observed.sessions):
        return {}
    right = tuple(mistake.put_right(session) for session in observed.sessions)
    if not all(model.accepts(session.block).all() for session in right):
        return {}
    same = all(a.block is b.block for a, b in zip(right, observed.sessions, strict=True))
    predicted = observed.predicted if same else None
    _, refitted, _ = without_set_up(model, right, calibrated, predicted)
    return {key: size / mistake.unit(key) for key, size in _error(refitted).items()}


def _error(left: Observations) -> dict[str, float]:
    """Return the RMS of what is left, by the key of the quantity."""
    return left.rms(np.nan_to_num(left.values) ** 2)


def load_too_large(model: ErrorModel, sessions: Sequence[MeasuredSession]) -> str:
    """Return a sentence on a load that is mostly beyond a model's range; empty where it is not.

    Such samples are left out before anything is compared, and what stays are the moments without a
    load: so the units are tried on all that was measured.

    It names the unit under which the load is in the range and explains what was measured.  Where
    there is none, it says only where to look.

    `sessions`: of one wrist, in the order of time.  Raises `InputError` if none of their
    measurements lies in the model's domain.
    """

    def beyond(mistake: Mistake | None = None) -> NDArray[np.bool_]:
        """Tell which measurements have a larger force or moment than the table takes, (n, 2)."""
        blocks = (each.take(np.asarray(each.measured.any(axis=1))).block for each in sessions)
        right = blocks if mistake is None else map(mistake.block, blocks)
        none = np.empty((0, 2), dtype=bool)
        return np.concatenate([none, *(overloaded(model.table, block) for block in right)])

    def left(mistake: Mistake) -> Observations:
        """Return what the model and the set-up leave of the units without a mistake."""
        right = tuple(mistake.measured_right(each) for each in sessions)
        return without_set_up(model, all_units(model, right), said_calibrated(sessions))[1]

    def likelihood(table: Observations) -> float:
        """Return its logarithm: see `suspected`."""
        count = independent(table)
        return -sum(count[key] * float(np.log(size)) for key, size in _error(table).items())

    over = beyond()
    force, moment = (over.sum(axis=0) > MOST_BEYOND * len(over)).tolist()
    if not (force or moment):
        return ""
    units = [each for each in LARGE_LOADS[force, moment] if beyond(each).mean() < 1.0 - NAMING]
    found = {mistake: left(mistake) for mistake in (NO_LOAD, *units)}
    logs = {mistake: likelihood(table) for mistake, table in found.items()}
    best = max(logs, key=logs.__getitem__)
    sure = 1.0 / sum(np.exp(each - logs[best]) for each in logs.values())
    said = (
        f"{LOOK_FIRST}: {over.any(axis=1).sum()} of {len(over)} measured poses are under a load "
        "beyond the table's range"
    )
    # A load that is there, and too large for the table, fits the better the less is taken off it.
    more = best.with_load(APART)
    real = not beyond(more).any(axis=1).all() and likelihood(left(more)) > logs[best]
    if best is NO_LOAD or real or sure < NAMING:
        return f"{said}; check its unit (N, N m), its tare and the sensor's frame"
    error = _error(found[best])
    sizes = " and ".join(q.told(error[q.key]) for q in found[best].reported)
    return f"{said}; with {best.without} the error is {sizes} ({percent(sure)} sure); {best.check}"
