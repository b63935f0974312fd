"""Sensors of the cell: noise with a colour on pose and load, and how much of a pose is seen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist


@dataclass(frozen=True)
class Noise:
    """White noise and a slow wander on three components (a stationary Gauss-Markov process)."""

    # `white`, `wander`: standard deviations of one component, in the unit of the signal
    white: float
    wander: float
    wander_time_s: float = 60.0  # correlation time of the wander [s]


@dataclass(frozen=True)
class PoseInstrument:
    """What measures the platform's pose."""

    name: str
    # `shift`, `rotation`: on each component [m], [rad]
    shift: Noise
    rotation: Noise
    static: bool = False  # measures once at the end of each rest, not all the time

    @property
    def sigma(self) -> Array:
        """Standard deviation of one sample, wander included, (6,) [m, rad]."""
        each = [float(np.hypot(n.white, n.wander)) for n in (self.shift, self.rotation)]
        return np.repeat(each, 3)


@dataclass(frozen=True)
class LoadSensor:
    """What measures the load."""

    # `force`, `moment`: on each component [N], [N m]
    force: Noise = field(default_factory=lambda: Noise(2e-3, 1e-3))
    moment: Noise = field(default_factory=lambda: Noise(5e-5, 2e-5))


MDEG = float(np.radians(1e-3))

INSTRUMENTS = {
    instrument.name: instrument
    for instrument in (
        PoseInstrument("interferometer", Noise(0.7e-6, 0.3e-6), Noise(1.0 * MDEG, 0.3 * MDEG)),
        PoseInstrument("tracker", Noise(5e-6, 3e-6), Noise(10.0 * MDEG, 3.0 * MDEG)),
        PoseInstrument(
            "cmm",
            Noise(1.5e-6, 0.8e-6, 600.0),
            Noise(3.0 * MDEG, 1.5 * MDEG, 600.0),
            static=True,
        ),
        PoseInstrument("ideal", Noise(0.0, 0.0), Noise(0.0, 0.0)),
    )
}


def instrument(name: str) -> PoseInstrument:
    """Return an instrument by its name.

    Raises `InputError` if there is none of that name.
    """
    if name not in INSTRUMENTS:
        raise InputError(f"instrument {name!r} is not one of {', '.join(INSTRUMENTS)}")
    return INSTRUMENTS[name]


class NoiseSource:
    """Noise of a six-component sensor, sample after sample.

    `first`, `second`: of the first and of the last three components; `rng`: belongs to this source
    alone.
    """

    def __init__(self, first: Noise, second: Noise, rng: np.random.Generator) -> None:
        self._white = np.repeat([first.white, second.white], 3)
        self._wander = np.repeat([first.wander, second.wander], 3)
        self._wander_time_s = np.repeat([first.wander_time_s, second.wander_time_s], 3)
        self._rng = rng
        self._state = rng.standard_normal(6)
        self._time_s: float | None = None

    def __call__(self, time_s: Array) -> Array:
        """Return the noise (n, 6) at the next n times (n,) [s]."""
        drawn = self._rng.standard_normal((len(time_s), 2, 6))
        start = time_s[0] if self._time_s is None else self._time_s
        steps = np.maximum(np.diff(time_s, prepend=start), 0.0)
        kept = np.exp(-steps[:, None] / self._wander_time_s)
        push = np.sqrt(1.0 - kept * kept) * drawn[:, 1]
        slow = np.empty((len(time_s), 6))
        for i in range(len(time_s)):
            self._state = kept[i] * self._state + push[i]
            slow[i] = self._state
        self._time_s = float(time_s[-1])
        return self._white * drawn[:, 0] + self._wander * slow


VIEWS = ("pose", "points", "pointing")
"""Position of O and rotation; the position alone; the rotation alone."""

WILD_SHIFT, WILD_TURN = 2e-4, float(np.radians(0.1))
"""Standard deviation of a reading through a beam that is half lost [m], [rad]."""

MOST_LOST = 0.5


class PoseView:
    """What is left of a pose sensor's readings: parts that it does not see become NaN.

    Of the lost beams one half leave no reading and the other half a wild one.

    `sees`: one of `VIEWS`; `lost_beams`: share of the samples; `rng`: belongs to this view alone.
    Raises `InputError` if there is no such view, or the share is not in 0 to `MOST_LOST`.
    """

    def __init__(self, sees: str, lost_beams: float, rng: np.random.Generator) -> None:
        if sees not in VIEWS:
            raise InputError(f"pose sensor sees {sees!r}, which is not one of {', '.join(VIEWS)}")
        if not 0.0 <= lost_beams <= MOST_LOST:
            raise InputError(f"share of lost beams {lost_beams:g} is not in 0 to {MOST_LOST:g}")
        self._sees, self._lost, self._rng = sees, lost_beams, rng

    def __call__(self, rotation: Array, shift: Array) -> tuple[Array, Array]:
        """Return the next n rotations (n, 3, 3) and positions (n, 3) [m] as they are seen."""
        if self._lost > 0.0:
            drawn = self._rng.standard_normal((len(shift), 7))
            chance = ndtr(drawn[:, 6])
            wild = drawn[:, :6] * np.repeat([WILD_SHIFT, WILD_TURN], 3)
            wild[chance >= self._lost / 2.0] = 0.0
            rotation, shift = exp_twist(wild)[0] @ rotation, shift + wild[:, :3]
            gone = (chance >= self._lost / 2.0) & (chance < self._lost)
            rotation[gone], shift[gone] = np.nan, np.nan
        if self._sees == "points":
            rotation = np.full_like(rotation, np.nan)
        if self._sees == "pointing":
            shift = np.full_like(shift, np.nan)
        return rotation, shift
