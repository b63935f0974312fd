"""How large an effect is in the data, the magnitude of a wanted size, and what a seed hides.

size = sqrt(mean over samples of xi' Sigma^-1 xi / 6), xi being the change of the residual twist by
the effect over all samples that are loaded or moving, less its mean; Sigma is the covariance of
one sample: that of the pose instrument, and a hidden encoder count spread over its step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.simulation.block import joined
from wrist_stiffness.simulation.catalogue import ALL, CATALOGUE, HiddenEffect, places
from wrist_stiffness.simulation.cell import CellSample, CellSettings, VirtualCell
from wrist_stiffness.simulation.heat import HEATED
from wrist_stiffness.simulation.instrument import LoadSensor, Noise, instrument
from wrist_stiffness.simulation.wrist import TrueWrist

SIZE_TOLERANCE = 2e-3
"""Relative, of the size that `magnitude_for` reaches."""

MAX_TRIALS = 40

SMALLEST, LARGEST = 0.5, 30.0
"""Range of the sizes that `draw` draws, even in their logarithm."""

ATTEMPTS = 20
"""Of `draw`, to find an effect that can be as large as was drawn."""

FASTEST_HZ = 200.0
"""Sizes of faster experiments are found at this rate: no law's size depends on more."""

BLOCK = 2000
"""Samples whose operators and inner state are in memory at a time."""


BasePose = tuple[Array, Array]
"""Poses (n) that the base predicts: rotation (n, 3, 3) U -> F, and place (n, 3) of O [m]."""


def base_pose(table: Table, encoder: Array, wrench: Array) -> BasePose:
    """Return where the platform would be by the base alone.

    `encoder` (n, 2): motor angles [rad]; `wrench` (n, 6): load on the platform at O in F [N, N m].
    """
    wrist, still = TrueWrist(table, ()), np.zeros((len(encoder), len(HEATED)))
    blocks = [slice(first, first + BLOCK) for first in range(0, len(encoder), BLOCK)]
    true = [wrist.at(still[rows, 0], encoder[rows], wrench[rows], still[rows]) for rows in blocks]
    return (
        np.concatenate([each.rotation for each in true]),
        np.concatenate([each.shift for each in true]),
    )


def departure(rotation: Array, shift: Array, base: BasePose) -> Array:
    """Return log(T T_base^-1) at O in F for poses T, (n, 6) [m, rad]."""
    turn = rotation @ np.swapaxes(base[0], -1, -2)
    return log_motion(turn, shift - (turn @ base[1][..., None])[..., 0])


def sample_covariance(table: Table, theta: Array, name: str) -> Array:
    """Return the covariance of one sample of the residual twist.

    `theta` (n, 2): motor angles [rad].  Gives (n, 6, 6): translation first, fixed axes of F.
    """
    mechanism = table.mechanism
    jacobian = np.zeros((len(theta), 6, 2))
    jacobian[:, 3:] = mechanism.jacobian(mechanism.forward(theta))
    step = table.geometry.limits.encoder_step
    count = jacobian @ np.swapaxes(jacobian, -1, -2) * step**2 / 12.0
    return count + np.diag(instrument(name).sigma ** 2)


class Scale:
    """Measures sizes of effects in one experiment.

    `settings`: experiment, rate and instrument; other hidden effects in it act in both runs.
    `seconds`: duration of the experiment [s].  `tell`: is told before every run of the experiment,
    of which a size takes several; not of which effect.  Raises `InputError` if the instrument has
    no noise to measure in.
    """

    def __init__(
        self,
        table: Table,
        settings: CellSettings,
        seconds: float,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        if settings.instrument == "ideal":
            raise InputError(
                "a hidden effect is as large as so many times the noise, and the instrument "
                "'ideal' has none: take another one"
            )
        self._table, self._settings, self._tell, self._runs = table, settings, tell, 0
        quiet = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))
        # The size is that of the whole motion, whatever part of it the sensor sees.
        self._quiet = replace(
            settings,
            instrument="ideal",
            sees="pose",
            lost_beams=0.0,
            load_sensor=quiet,
        )
        rate_hz = min(settings.rate_hz, FASTEST_HZ)
        self.time_s = np.arange(max(1, round(seconds * rate_hz))) / rate_hz
        self._without = without = self._run(())
        self._base = base_pose(table, without.encoder, without.wrench)
        self._residual = departure(without.measured_rotation, without.measured_shift, self._base)
        covariance = sample_covariance(table, without.encoder, settings.instrument)
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        moves = np.diff(without.encoder, axis=0, prepend=without.encoder[:1]).any(axis=1)
        self.counted = moves | without.wrench.any(axis=1)

    def _run(self, hidden: tuple[HiddenEffect, ...]) -> CellSample:
        settings = replace(self._quiet, hidden=self._settings.hidden + hidden)
        cell = VirtualCell(self._table, settings, np.random.default_rng(0))
        blocks = [
            cell.run(time_s, cell.desired(time_s))
            for time_s in np.split(self.time_s, np.arange(BLOCK, len(self.time_s), BLOCK))
        ]
        return joined(blocks)

    def signature(self, hidden: HiddenEffect) -> Array:
        """Return the change of the residual twist by an effect, (n, 6) [m, rad]."""
        sample, without, base = self._run((hidden,)), self._without, self._base
        said = np.hstack([sample.encoder, sample.wrench])
        if not np.array_equal(said, np.hstack([without.encoder, without.wrench])):
            base = base_pose(self._table, sample.encoder, sample.wrench)
        return departure(sample.measured_rotation, sample.measured_shift, base) - self._residual

    def size(self, hidden: HiddenEffect) -> float:
        """Return the size of an effect in units of one sample's noise."""
        self._runs += 1
        self._tell(f"finding how much of the effect has the wanted size, run {self._runs}")
        change = self.signature(hidden)[self.counted]
        change = change - change.mean(axis=0)
        white = (self._whiten[self.counted] @ change[..., None])[..., 0]
        return float(np.sqrt(np.mean(white * white)))

    def sized(
        self, hidden: HiddenEffect, size: float, largest: float | None = None
    ) -> HiddenEffect:
        """Return the effect with the magnitude that has a size.

        `hidden`: its magnitude is where the search begins.  `size`: wanted.  `largest`: magnitude
        to stay below; that which can be simulated if None.  Gives `HiddenEffect`: of that size
        within `SIZE_TOLERANCE`.  Raises `InputError` if no magnitude up to the largest has this
        size.
        """
        entry = ALL[hidden.effect]
        limit = entry.limit if largest is None else largest

        def measure(magnitude: float) -> float:
            try:
                return self.size(replace(hidden, magnitude=magnitude))
            except InputError:
                # So large that the wrist has no equilibrium any more.
                return np.inf

        magnitude = magnitude_for(measure, hidden.magnitude, size, limit)
        if magnitude is None:
            unit = "" if entry.unit == "-" else f" {entry.unit}"
            raise InputError(
                f"{hidden.effect}@{hidden.component}: size {size:g} is out of reach: with the "
                f"largest effect that can be simulated, {limit:g}{unit}, it is {measure(limit):.3g}"
            )
        return replace(hidden, magnitude=magnitude)


def magnitude_for(
    measure: Callable[[float], float], start: float, size: float, limit: float
) -> float | None:
    """Return the magnitude up to `limit` at which `measure` is `size`, None if there is none.

    Secant steps between logarithms inside a bracket: most effects are nearly proportional.
    """
    low, high = 0.0, np.inf
    magnitude = min(start, limit)
    power = 1.0
    last: tuple[float, float] | None = None
    for _ in range(MAX_TRIALS):
        found = measure(magnitude)
        if abs(found - size) <= SIZE_TOLERANCE * size:
            return magnitude
        if found < size:
            low = max(low, magnitude)
            if magnitude >= limit:
                return None
        else:
            high = min(high, magnitude)
        if last is not None and 0.0 < found < np.inf and last[1] > 0.0 and magnitude != last[0]:
            slope = np.log(found / last[1]) / np.log(magnitude / last[0])
            power = float(np.clip(slope, 0.2, 4.0))
        if np.isfinite(found):
            last = magnitude, found
        step = (size / found) ** (1.0 / power) if found > 0.0 else 10.0
        following = min(magnitude * float(np.clip(step, 1e-3, 1e3)), limit)
        if not low < following < high and not following == limit > low:
            following = 0.5 * (low + high)
        magnitude = following
    return None


@dataclass(frozen=True)
class Secret:
    """What a seed hides and nobody is told: a blind test."""

    hidden: HiddenEffect  # with its magnitude
    size: float  # in units of one sample's noise


def draw(
    seed: int,
    table: Table,
    settings: CellSettings,
    seconds: float,
    tell: Callable[[str], None] = lambda text: None,
    without: Collection[str] = (),
) -> Secret:
    """Draw effect, place, form and size.

    Every effect of the catalogue is as likely as any other, then every place of it.  A drawn size
    that its effect cannot have on a wrist that still works is drawn again with all the rest.

    `seed`: not negative.  `settings`: the size holds for this experiment.  `seconds`: duration of
    the experiment [s].  `tell`: is told before every run of the experiment; not what is tried.
    `without`: effects that are not drawn, such as those that every session sets up anew.  Raises
    `InputError` if the seed is negative or nothing fits after many draws.
    """
    if seed < 0:
        raise InputError(f"blind seed {seed} is negative")
    # Apart from the noise, which a user may seed with the same number.
    rng = np.random.default_rng([seed, 0x5EC2E7])
    scale = Scale(table, replace(settings, hidden=()), seconds, tell)
    names = [name for name in CATALOGUE if name not in without]
    for _ in range(ATTEMPTS):
        entry = CATALOGUE[effect := str(rng.choice(names))]
        found = places({effect: entry})
        _, component, form = found[rng.integers(len(found))]
        size = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
        shape = int(rng.integers(2**31))
        hidden = HiddenEffect(effect, component, form, entry.plausible, shape)
        try:
            return Secret(scale.sized(hidden, size, entry.largest), size)
        except InputError:
            continue
    raise InputError(f"blind seed {seed}: no effect fits this experiment after {ATTEMPTS} draws")
