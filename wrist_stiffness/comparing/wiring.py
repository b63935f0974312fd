"""Signs, units and names that a cell got wrong: which of them would explain the error.

No set-up explains a load of the wrong sign, and no effect is as large.  So the few usual mistakes
are tried on what was measured, and one that explains most of the error is told; one that explains
part of it may be asked by a whole fit (`wrong_load`).  None is ever applied: whoever wired the cell
has to look.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.comparing.comparison import sizes
from wrist_stiffness.comparing.set_up import without_set_up
from wrist_stiffness.inference import Observations
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.gauges import Gauge
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.observing import Observed
from wrist_stiffness.sessions.unit_session import UnitSession

LOOK_FIRST = "Look at the set-up first"
"""How the sentence begins that tells a mistake."""

WORTH_ASKING = 2.0
"""Error over the instrument's noise from which a mistake is looked for."""

CLEAR = 0.5
"""A mistake is told if s or phi without it is less than this share of what it is with it."""

HINTED = 0.9
"""The same from which on a mistake is worth a whole fit: a right load leaves 0.25 to 0.7 of what
axes bent to the wrong one leave, another wrong one 0.95 and more."""

GROWN = 1.05
"""A mistake is none if s or phi without it is more than that times as large."""

LARGER = 10.0
"""A mistake is none if s or phi without it is more than that times as large in its own unit: where
a larger unit hides the model, nothing fits better."""


@dataclass(frozen=True)
class Mistake:
    """One thing that is easily got wrong.

    Parameters
    ----------
    without : str
        The data without it, after "with".
    check : str
        Where to look.
    block : callable
        From the recorded signals to those without it.
    shift_factor : float
        The same for the measured positions.
    gauge : str
        Name of a gauge whose readings turn their sign without it.
    """

    without: str
    check: str
    block: Callable[[Block], Block] = lambda block: block
    shift_factor: float = 1.0
    gauge: str = ""

    def put_right(self, session: UnitSession) -> UnitSession:
        """Return the session without the mistake."""
        cut = replace(session.cut, block=self.block(session.block))
        right = replace(session, cut=cut, shift=self.shift_factor * session.shift)
        read = session.readings
        if read is None or not self.gauge:
            return right
        sign = np.where([each.name == self.gauge for each in read.gauges], -1.0, 1.0)
        return replace(right, readings=replace(read, values=sign * read.values))

    def measured_right(self, session: MeasuredSession) -> MeasuredSession:
        """Return a session as it was measured without the mistake."""
        return replace(
            session, block=self.block(session.block), shift=self.shift_factor * session.shift
        )

    def concerns(self, session: UnitSession) -> bool:
        """Tell whether the session could have it: a measured rotation names its own motors."""
        same_angles = self.block(session.block).theta is session.block.theta
        if session.readings is not None:
            # Where the wrist moved, motors, units and signs were told when these were held to it.
            return same_angles and self.shift_factor == 1.0 and not session.moves(self.gauge)
        return same_angles or not np.isfinite(session.turn).any()


def _load(factor: float) -> Callable[[Block], Block]:
    return lambda block: replace(block, load=factor * block.load)


LOAD_MISTAKES = (
    Mistake(
        "the load's sign turned",
        "does the sensor show what acts on the platform, or the reaction (acts_on: environment)?",
        _load(-1.0),
    ),
    Mistake("the load times 1000", "is it in kN and kN m?", _load(1e3)),
    Mistake("the load times 9.81", "is it in kilograms?", _load(9.80665)),
    Mistake(
        "the load in the other frame",
        "does the load sensor turn with the platform (wrist_platform) or not (wrist_base)?",
        lambda block: replace(block, load_on_platform=not block.load_on_platform),
    ),
)

MISTAKES = (
    *LOAD_MISTAKES,
    Mistake(
        "the motors swapped",
        "--joint names motor 1 first",
        lambda block: replace(block, theta=block.theta[:, ::-1]),
    ),
    Mistake("positions divided by 1000", "are they in mm? A recording has m", shift_factor=1e-3),
    Mistake(
        "positions times 1000",
        "are they in m where mm belong, as in the _mm columns of a table?",
        shift_factor=1e3,
    ),
)


def _turned(gauge: Gauge) -> Mistake:
    return Mistake(
        f"the sign of gauge {gauge.name} turned", f"does it {gauge.counts_up}?", gauge=gauge.name
    )


@dataclass(frozen=True)
class Suspicion:
    """A mistake that explains part of an error.

    Parameters
    ----------
    mistake : Mistake
        The one that explains most.
    share : float
        What is left without it of s or of phi, whichever falls more.
    fall : str
        How the error falls.
    """

    mistake: Mistake
    share: float
    fall: str

    @property
    def clear(self) -> bool:
        """Whether nothing else explains so much."""
        return self.share < CLEAR

    def told(self, fall: str) -> str:
        """Return the sentence for a technician, with this or another account of the fall."""
        return f"{LOOK_FIRST}: with {self.mistake.without} {fall}; {self.mistake.check}"


def suspected(
    model: ErrorModel,
    observed: Observed,
    calibrated: Sequence[str],
    left: Observations,
    noise: dict[str, float],
    mistakes: Sequence[Mistake] = MISTAKES,
) -> Suspicion | None:
    """Return the mistake that explains most of the error, None if none explains any of it.

    Parameters
    ----------
    model : ErrorModel
        With which the sessions are compared.
    observed : Observed
        The sessions as they were recorded, and what the model predicts of them.
    calibrated : sequence of str
        Effects of the set-up that are not refitted.
    left : Observations
        Residuals of the units after the refit.
    noise : dict of str to float
        Of the instrument, by the key of the quantity.
    mistakes : sequence of Mistake, optional
        Those that are tried.
    """
    before = {key: size.rms for key, size in sizes(left).items()}
    over = _over(before, noise)
    if max(over.values(), default=0.0) < WORTH_ASKING:
        return None
    best = None
    read = observed.sessions[0].readings
    for mistake in (*mistakes, *(map(_turned, read.gauges) if read is not None else ())):
        after = _without(mistake, model, observed, calibrated)
        if any(after[key] > LARGER * before[key] for key in after):
            continue
        over_after = _over(after, noise, mistake.shift_factor)
        share = _share(over, over_after)
        if share < (best.share if best else HINTED):
            fall = " and ".join(
                f"from {_times(over[q.key])} to {_times(over_after[q.key])} the noise of {q.name}"
                if q.key == "s_um" and mistake.shift_factor > 1.0
                else f"from {before[q.key]:.3g} to {after[q.key]:.3g} {q.unit} of {q.name}"
                for q in left.reported
            )
            best = Suspicion(mistake, share, f"the error falls {fall}")
    return best


def told_mistake(suspicion: Suspicion | None) -> str:
    """Return a clear mistake in a sentence; empty for none, or one that is not clear."""
    return suspicion.told(suspicion.fall) if suspicion and suspicion.clear else ""


def _times(ratio: float) -> str:
    """Return a ratio with three digits and no exponent."""
    return f"{float(f'{ratio:.3g}'):g} x"


def _over(
    rms: dict[str, float], floor: dict[str, float], shift_factor: float = 1.0
) -> dict[str, float]:
    """Return the errors over their floors."""
    # A smaller unit makes noise and error smaller alike.
    scale = {"s_um": shift_factor}
    return {k: rms[k] / (floor[k] * scale.get(k, 1.0)) for k in rms if floor[k] > 0.0}


def _share(before: dict[str, float], after: dict[str, float]) -> float:
    """Return what is left of s or of phi, whichever falls more; 1 where the other grows.

    One of them is enough: backlash makes a phi that no sign of the load changes.
    """
    if any(after[k] > max(GROWN * before[k], WORTH_ASKING) for k in after):
        return 1.0
    return min((after[k] / before[k] for k in after if before[k] >= WORTH_ASKING), default=1.0)


def _without(
    mistake: Mistake,
    model: ErrorModel,
    observed: Observed,
    calibrated: Sequence[str],
) -> dict[str, float]:
    """Return the error that is left without a mistake, empty where it cannot be one."""
    if not all(mistake.concerns(session) for session in observed.sessions):
        return {}
    right = tuple(mistake.put_right(session) for session in observed.sessions)
    if not all(model.accepts(session.block).all() for session in right):
        return {}
    same = all(a.block is b.block for a, b in zip(right, observed.sessions, strict=True))
    predicted = observed.predicted if same else None
    _, refitted, _ = without_set_up(model, right, calibrated, predicted)
    return {key: size.rms for key, size in sizes(refitted).items()}
