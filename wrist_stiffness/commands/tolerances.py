"""Which tolerance costs how much: many virtual wrists, each built as its drawing allows.

Every tolerance of every wrist is drawn within its limit, as the priors of a diagnosis have it.  How
far the wrist's error is from what the nominal model says, at poses over the operative workspace, is
regressed on all of them at once: what a tolerance costs is the part in proportion to it.  What is
in proportion to none (flanges that open or close, products of several) is a line of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wrist_stiffness.commands.fleet import spread
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.free_effects import EVENLY_SPREAD, SHIM_UM
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect, effect_at
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.places import cross_axes
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.sessions.refitted import AXES, BUILT, GAPS

POSES_PER_AXIS = 7
WRISTS_AT_A_TIME = 50
"""As many as one worker takes at once, and as many as die with it."""

SIZES = {"s_um": (slice(0, 3), 1e6), "phi_mdeg": (slice(3, 6), float(np.degrees(1e3)))}
"""Which part of a twist, and its unit."""


@dataclass(frozen=True)
class Tolerance:
    """One parameter that differs from wrist to wrist."""

    # `law`, `place`, `key`: effect, component, and parameter with its unit
    law: str
    place: str
    key: str
    sigma: float  # standard deviation, in that unit

    @property
    def name(self) -> str:
        """`law@place key`."""
        return f"{self.law}@{self.place} {self.key}"

    def drawn(self, rng: np.random.Generator, count: int) -> Array:
        """Return draws (count,): anywhere within the limit; what shims leave of a gap is normal."""
        if self.law == GAPS:
            return rng.normal(0.0, self.sigma, count)
        limit = self.sigma / EVENLY_SPREAD
        return rng.uniform(-limit, limit, count)


def tolerances_of(limits: Mapping[str, float]) -> tuple[Tolerance, ...]:
    """Return what differs from wrist to wrist, with the usual limits or others.

    `limits`: limit of a part, of a gap its standard deviation, by `law.key` for all places or by
    `law@place.key`; 0 for no tolerance.  Raises `InputError` if a name is unknown, a limit
    negative, or none is left.
    """
    found: list[Tolerance] = []
    used: set[str] = set()
    for law_name, places in BUILT:
        if places == ("load_sensor",):
            continue
        for place in places:
            for parameter in find_law(law_name).parameters(place):
                names = f"{law_name}@{place}.{parameter.key}", f"{law_name}.{parameter.key}"
                given = next((limits[name] for name in names if name in limits), None)
                used.update(names)
                if given is not None and not 0.0 <= given < np.inf:
                    raise InputError(f"--limit: {names[0]} = {given:g} is not a number >= 0")
                if law_name == GAPS:
                    sigma = SHIM_UM if given is None else given
                else:
                    sigma = EVENLY_SPREAD * (parameter.scale if given is None else given)
                if sigma:
                    found.append(Tolerance(law_name, place, parameter.key, sigma))
    if unknown := sorted(set(limits) - used):
        known = ", ".join(name for name in sorted(used) if "@" not in name)
        raise InputError(f"--limit: {unknown[0]} is none of {known}, at a place or at all")
    if not found:
        raise InputError("--limit: no tolerance is left")
    return tuple(found)


class Sums(NamedTuple):
    """What many wrists add up to; sums of sums are those of all."""

    wrists: int
    products: Array  # (1 + k, 1 + k), of 1 and the k standardised tolerances with each other
    answers: Array  # (1 + k, p * 6), of these with what the wrists err by at p poses [m, rad]
    squares: Array  # (p * 6,), of what they err by


@dataclass(frozen=True)
class Cost:
    """What a tolerance costs: RMS over wrists and poses."""

    name: str  # `law@place key`, or what it is where no tolerance alone costs it
    # standard deviation of the tolerance, in the unit of its name; NaN where it has none
    sigma: float
    size: dict[str, tuple[float, float]]  # value and standard uncertainty by `SIZES`


@dataclass(frozen=True)
class ToleranceStudy:
    """Which tolerance costs how much."""

    model: str
    wrists: int
    poses: int
    load: Sequence[float]  # at O in F [N, N m]
    costs: tuple[Cost, ...]  # the dearest in s first
    # `others`, `whole`: what several do together that none does alone, and all together
    others: Cost
    whole: Cost

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {
            "schema": 1,
            "model": self.model,
            "wrists": self.wrists,
            "poses": self.poses,
            "load": list(self.load),
            "tolerances": [_values(cost) for cost in self.costs],
            "none_alone": _values(self.others),
            "together": _values(self.whole),
        }


def _values(cost: Cost) -> dict[str, Any]:
    sizes = {key: {"rms": value, "sigma": sigma} for key, (value, sigma) in cost.size.items()}
    return {"name": cost.name, "sigma": None if np.isnan(cost.sigma) else cost.sigma, **sizes}


def study_tolerances(
    model: str | Path,
    wrists: int,
    load: Sequence[float],
    limits: Mapping[str, float],
    seed: int = 0,
    workers: int | None = None,
    progress: Progress = silent,
) -> ToleranceStudy:
    """Build virtual wrists and tell which tolerance costs how much.

    The same seed gives the same wrists and the same table on any number of processes.

    `load` (sequence of 6 float): on the platform at O in F [N, N m]; `limits`: see `tolerances_of`;
    `workers`, `progress`: see `fleet.spread`.  Raises `WristError` if there are too few wrists to
    tell the tolerances apart, or some cannot be computed.
    """
    tolerances = tolerances_of(limits)
    if wrists < (least := 3 * len(tolerances)):
        raise InputError(f"{wrists} wrists are too few: {len(tolerances)} tolerances need {least}")
    firsts = range(0, wrists, WRISTS_AT_A_TIME)
    one = partial(
        wrist_sums, Path(model).absolute(), tolerances, tuple(map(float, load)), seed, wrists
    )

    def told(done: int, _: int) -> None:
        progress(min(done * WRISTS_AT_A_TIME, wrists), wrists)

    parts = []
    for answer in spread(one, firsts, workers, told):
        if answer.result is None:
            raise InputError(f"tolerances: {answer.error}")
        parts.append(answer.result)
    total = Sums(*(sum(each) for each in zip(*parts, strict=True)))
    return _study(load_model(model).name, tolerances, load, total)


def wrist_sums(
    path: Path,
    tolerances: Sequence[Tolerance],
    load: Sequence[float],
    seed: int,
    wrists: int,
    first: int,
) -> Sums:
    """Return the sums of some wrists from a number on."""
    model = load_model(path)
    block = _block(model.table, load)
    count = min(WRISTS_AT_A_TIME, wrists - first)
    rng = np.random.default_rng([seed, first])
    drawn = np.stack([tolerance.drawn(rng, count) for tolerance in tolerances], axis=1)
    nominal = model.batch(block).twist
    errs = np.array(
        [
            model.with_effects(*e).batch(block).twist - nominal
            for e in _wrists(model, tolerances, drawn)
        ]
    ).reshape(count, -1)
    if not np.isfinite(errs).all():
        raise InputError("a pose of the operative workspace, or the load, is out of range")
    sigma = np.array([tolerance.sigma for tolerance in tolerances])
    columns = np.hstack([np.ones((count, 1)), drawn / sigma])
    return Sums(count, columns.T @ columns, columns.T @ errs, (errs**2).sum(axis=0))


def _block(table: Table, load: Sequence[float]) -> Block:
    theta = table.workspace.grid(POSES_PER_AXIS)
    theta = theta[table.workspace.operative(theta)]
    time = np.arange(len(theta), dtype=float)
    return Block(time, theta, np.tile(np.array(load), (len(theta), 1)), np.zeros_like(theta))


def _wrists(
    model: ErrorModel, tolerances: Sequence[Tolerance], drawn: Array
) -> Iterator[list[Effect]]:
    """Yield the effects of each wrist; shims bring the flanges back to where axes moved them."""
    shims = _shims(model.table, tolerances)
    for values in drawn:
        by_effect: dict[tuple[str, str], dict[str, float]] = {}
        for tolerance, value in zip(tolerances, values.tolist(), strict=True):
            by_effect.setdefault((tolerance.law, tolerance.place), {})[tolerance.key] = value
        for joint, shim in shims.items():
            gap = by_effect.setdefault((GAPS, joint), {})
            gap["gap_um"] = gap.get("gap_um", 0.0) + float(shim @ values)
        own = {effect.name: effect for effect in model.effects}
        for (law, place), changed in by_effect.items():
            if (before := own.get(f"{law}@{place}")) is not None:
                had = {key: estimate.value for key, estimate in before.estimates.items()}
                changed = had | {key: had[key] + value for key, value in changed.items()}
            effect = effect_at(find_law(law), place, changed)
            own[effect.name] = effect
        yield list(own.values())


def _shims(table: Table, tolerances: Sequence[Tolerance]) -> dict[str, Array]:
    """Return the shim [um] of each joint with flanges by one unit of every tolerance (k,)."""
    rows = influence(table.mechanism.forward(np.zeros(2))).slides()
    found = {}
    for number, joint in enumerate(PASSIVE_JOINTS):
        if joint not in table.components.contact:
            continue
        sign = float(table.components.contact[joint].sign[0])
        found[joint] = np.array(
            [-sign * rows[ELASTIC.index(t.place), number] @ _shift(table, t) for t in tolerances]
        )
    return found


def _shift(table: Table, tolerance: Tolerance) -> Array:
    kind, _, rest = tolerance.key.partition("_")
    if tolerance.law != AXES or kind != "shift":
        return np.zeros(3)
    return np.asarray(cross_axes(table.geometry, tolerance.place)["uvw".index(rest[0])])


def _study(
    name: str, tolerances: Sequence[Tolerance], load: Sequence[float], total: Sums
) -> ToleranceStudy:
    n, k = total.wrists, len(tolerances)
    inverse = np.linalg.inv(total.products)
    slopes = inverse @ total.answers
    rest = np.maximum(total.squares - (slopes * total.answers).sum(axis=0), 0.0) / (n - k - 1)

    def sizes(squares: Array, variance: Array | float = 0.0) -> dict[str, tuple[float, float]]:
        # Poses share the wrists, so their errors do not average out.
        noise = np.broadcast_to(variance, squares.shape)
        return {
            key: (unit * _rms(squares - noise, half), unit * _rms(noise, half))
            for key, (half, unit) in SIZES.items()
        }

    costs = [
        Cost(tolerance.name, tolerance.sigma, sizes(slopes[i] ** 2, inverse[i, i] * rest))
        for i, tolerance in enumerate(tolerances, start=1)
    ]
    costs.sort(key=lambda cost: -cost.size["s_um"][0])
    others = Cost("in proportion to none", np.nan, sizes(rest + slopes[0] ** 2))
    whole = Cost("all together", np.nan, sizes(total.squares / n))
    return ToleranceStudy(name, n, len(total.squares) // 6, load, tuple(costs), others, whole)


def _rms(squares: Array, half: slice) -> float:
    """Return the root of the mean over poses of the squares (p * 6,) of a half of a twist."""
    square = squares.reshape(-1, 6)[:, half].sum(axis=1).mean()
    return float(np.sqrt(max(square, 0.0)))
