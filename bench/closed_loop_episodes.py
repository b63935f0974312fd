"""Episodes of a cell, drawn at random: what is commanded, carried, met, told and measured."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from stops import Stops

from wrist_stiffness.lookup.table import Table

Array = NDArray[np.float64]

RATE_HZ = 50
KINDS = ("carry", "insert", "jam", "press", "collide", "lose", "swap")
RATIOS = tuple(float(each) for each in 2.0 ** np.linspace(-1.0, 1.0, 9))
"""Assumed over true compliance."""

TARE_S = 1.0
TOOL_MM = [0.0, 0.0, 60.0]
TOOL_M = 0.06
NEAR = {"insert": 0.02, "jam": 0.09}
"""A hole holds while the command is within this of it, a wall is longer [deg]."""

BESIDE = float(np.radians(1.0))

QUIET_S = 2.0
"""So long after the last thing that happened, nothing may change any more."""


@dataclass
class Script:
    """One episode of T samples.

    Parameters
    ----------
    kind, ratio, objective : str, float, str
        What happens; assumed over true compliance; what the corrector makes right.
    command : (T, 2) float
        Motor angles [rad].
    mass, centre : (T,), (3,) float
        Carried [kg], and where in U [m].
    stop : dict
        Of `Stops`, one wrist; `target` (2,) where it stands.
    there : (T,) bool
        Whether the stop is in the way.
    bias : (T, 6) float
        Of the load sensor [N, N m].
    noise : float
        Times the sensor's usual noise.
    on_platform : bool
        Where the sensor sits.
    value_delay, arrival_delay : int
        Samples by which the load lags behind its stamp, and comes after it.
    lost : (T,) bool
        Loads that never arrive.
    told : dict of int to (float, Array) or None
        What the gripper tells, by sample: mass [kg] and centre [m].
    quiet : (T,) bool
        Samples at which nothing has happened for a while.
    """

    kind: str
    ratio: float
    objective: str
    command: Array
    mass: Array
    centre: Array
    stop: dict[str, Array]
    there: NDArray[np.bool_]
    bias: Array
    noise: float
    on_platform: bool
    value_delay: int
    arrival_delay: int
    lost: NDArray[np.bool_]
    told: dict[int, tuple[float, Array] | None]
    quiet: NDArray[np.bool_]


@dataclass
class _Line:
    """A time line that is being written."""

    rng: np.random.Generator
    command: list[Array] = field(default_factory=list)
    mass: list[float] = field(default_factory=list)
    happened: list[int] = field(default_factory=list)

    def rest(self, seconds: float, mass: float) -> None:
        """Stay; the load becomes that of a mass within a part of a second."""
        last = self.mass[-1] if self.mass else 0.0
        n = max(round(seconds * RATE_HZ), 1)
        ramp = 1 if mass < last else min(self.rng.integers(1, RATE_HZ), n)
        grown = np.minimum(np.arange(1, n + 1) / ramp, 1.0)
        if mass != last:
            self.happened += [len(self.mass), len(self.mass) + int(ramp)]
        self.mass += (last + grown * (mass - last)).tolist()
        self.command += [self.command[-1]] * n

    def move(self, theta: Array, seconds: float) -> None:
        """Move smoothly."""
        n = max(round(seconds * RATE_HZ), 2)
        s = np.arange(1, n + 1) / n
        way = (s * s * (3.0 - 2.0 * s))[:, None] * (theta - self.command[-1])
        self.happened += range(len(self.mass), len(self.mass) + n)
        self.command += list(self.command[-1] + way)
        self.mass += [self.mass[-1]] * n


def draw(table: Table, seed: int, seconds: float = 14.0) -> Script:
    """Return the episode of a seed."""
    rng = np.random.default_rng([seed, 23])
    kind = KINDS[seed % len(KINDS)]
    length = round(seconds * RATE_HZ)

    def pose() -> Array:
        return np.radians(rng.uniform(-30.0, 30.0, 2))

    weight = float(np.exp(rng.uniform(np.log(0.3), np.log(4.0))))
    mass = weight / 9.81 if kind not in ("jam", "press", "collide") or rng.random() < 0.5 else 0.0
    reach = min(0.03, 0.06 / weight)
    centre = rng.uniform(-1.0, 1.0, 3) * reach + np.array([0.0, 0.0, reach])
    line = _Line(rng, [pose()], [0.0])
    line.rest(TARE_S + rng.uniform(0.3, 1.5), 0.0)
    picked = len(line.mass)
    line.rest(rng.uniform(0.3, 3.0), mass)
    for _ in range(rng.integers(1, 3)):
        line.move(pose(), rng.uniform(0.4, 1.2))
        line.rest(rng.uniform(0.1, 1.0), mass)
    target = pose()
    aside = rng.normal(size=2)
    beside = target + BESIDE * rng.uniform(1.5, 3.0) * aside / np.linalg.norm(aside)
    line.move(beside, rng.uniform(0.4, 1.2))
    line.move(target, rng.uniform(0.2, 1.5))
    line.rest(rng.uniform(0.2, 4.0), mass)
    if kind == "jam":
        turn = np.radians(rng.uniform(-0.06, 0.06, 2))
        line.move(target + turn, rng.uniform(0.2, 1.0))
        line.rest(rng.uniform(0.5, 3.0), mass)
    left = {"insert": 0.0, "lose": 0.0, "swap": mass * rng.uniform(0.3, 0.8)}
    after = left.get(kind, 0.0 if rng.random() < 0.5 else mass)
    released = len(line.mass)
    line.rest(rng.uniform(0.1, 3.0), after)
    if kind != "lose" or rng.random() < 0.5:
        line.move(beside, rng.uniform(0.3, 1.0))
        line.move(pose(), rng.uniform(0.4, 1.2))
    line.rest(max((length - len(line.mass)) / RATE_HZ, 1.0), after)

    command, masses = np.array(line.command[:length]), np.array(line.mass[:length])
    stop = _stop(table, kind, target, beside, rng)
    there = np.max(np.abs(command - target), axis=1) < np.radians(NEAR.get(kind, 1.0))
    there &= kind not in ("carry", "lose", "swap")
    lost = np.zeros(length, dtype=bool)
    if rng.random() < 0.3:
        for _ in range(rng.integers(1, 4)):
            start = rng.integers(round(TARE_S * RATE_HZ), length)
            lost[start : start + rng.integers(2, 100)] = True
    bias = np.zeros((length, 6))
    if rng.random() < 0.5:
        drift = rng.normal(size=6) * np.repeat([0.1, 0.003], 3)
        late = np.clip(np.arange(length) / RATE_HZ - TARE_S, 0.0, None) / seconds
        bias = late[:, None] * drift
    told: dict[int, tuple[float, Array] | None] = {}
    if mass and rng.random() < 0.3:
        wrong = mass * rng.uniform(0.97, 1.03), centre + rng.normal(size=3) * 0.0005
        told[max(picked + int(rng.integers(-10, 15)), 60)] = wrong
        if after == 0.0:
            told[released + int(rng.integers(-5, 15))] = None
    changed = np.zeros(length, dtype=bool)
    changed[[i for i in line.happened if i < length]] = True
    changed[list(set(told) & set(range(length)))] = True
    changed |= np.diff(there, prepend=there[0]) | lost
    since = np.arange(length) - np.maximum.accumulate(np.where(changed, np.arange(length), 0))
    delay = int(rng.integers(0, 11)) if rng.random() < 0.4 else 0
    by_value = rng.random() < 0.5
    return Script(
        kind,
        RATIOS[int(rng.integers(len(RATIOS)))],
        "pointing" if rng.random() < 0.7 else "tool_point",
        command,
        masses,
        centre,
        stop,
        there,
        bias,
        float(rng.uniform(1.0, 5.0)),
        bool(rng.random() < 0.5),
        delay if by_value else 0,
        0 if by_value else delay,
        lost,
        told,
        since > QUIET_S * RATE_HZ,
    )


def _stop(
    table: Table, kind: str, target: Array, beside: Array, rng: np.random.Generator
) -> dict[str, Array]:
    """Return a wall that is pressed from where the command comes, or a hole."""
    mechanism, tool = table.mechanism, np.array([0.0, 0.0, TOOL_M])
    wanted, before = (mechanism.forward(each).platform for each in (target, beside))
    stiffness = 1e6 * float(np.exp(rng.uniform(np.log(0.05), np.log(100.0))))
    along, about = rng.normal(size=3), np.zeros(3)
    along /= np.linalg.norm(along)
    if along @ (wanted - before) @ tool < 0.0:
        along = -along
    lowest, highest = -np.inf, 1e-6 * rng.uniform(-60.0, 20.0)
    if kind in ("insert", "jam"):
        middle, half = 1e-6 * rng.uniform(-30.0, 30.0), 1e-6 * rng.uniform(0.0, 20.0)
        lowest, highest = middle - half, middle + half
        if kind == "jam" or rng.random() < 0.5:
            # The same hole, by its couple: a micrometre at the tool is so much of a turn.
            along, about = np.zeros(3), along
            about -= (about @ wanted[:, 2]) * wanted[:, 2]
            about /= np.linalg.norm(about)
            lowest, highest = lowest / TOOL_M, highest / TOOL_M
            stiffness *= TOOL_M**2
    return {
        "along": along,
        "about": about,
        "tool": tool,
        "wanted": wanted,
        "lowest": np.array(lowest),
        "highest": np.array(highest),
        "stiffness": np.array(stiffness),
    }


def stops(scripts: list[Script]) -> Stops:
    """Return the stops of many episodes."""
    return Stops(**{name: np.array([s.stop[name] for s in scripts]) for name in scripts[0].stop})
