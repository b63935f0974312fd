"""A measured session as units: what was measured at each dwell and moment, averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.observations import Quantity
from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion, rotation_vector
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.gauges import Gauges
from wrist_stiffness.sessions.in_pieces import in_pieces
from wrist_stiffness.sessions.measured_session import MeasuredSession, beyond_range
from wrist_stiffness.sessions.units import FEWEST_IN_DWELL, Cut, Labels, Mask, cut

QUANTITIES = (
    Quantity("s", "um", (0, 1, 2), 1e6),
    Quantity("phi", "mdeg", (3, 4, 5), 180e3 / np.pi),
)
"""Of poses: which components are reported as one length."""

LOST = 8.0
"""Robust standard deviations from its dwell's median at which one measurement is a lost beam."""

WILD = 1e3
"""The same beyond which a measurement tells nothing of how much its dwell changes."""

CHANGING_SHARE, MOST_CHANGING = 0.5, 4.0
"""Share of a dwell's own root mean square that counts as its scatter where it is more than usual,
and how many usual ones it may be: settling and creep make it larger, as lost beams do."""

FEWEST_FOR_NOISE = 30
"""Steps between neighbouring measurements of dwells from which their scatter is known."""

FINEST = 1e-9
"""What no instrument tells apart [m, rad]."""


@dataclass(frozen=True, eq=False)
class UnitSession:
    """One session as units."""

    name: str
    cut: Cut  # its units, and the moments that tell its path
    # (u, m), mean of what was measured of each unit against the rigid wrist: shift of O [m] and
    # rotation vector [rad] of the platform, or readings of gauges; NaN = not measured
    values: Array
    samples: Array  # (u,), measurements in each mean
    lost: int  # measurements left out as lost beams
    white: Array  # (m,), scatter of one measurement, NaN where it is not known [m, rad]
    # (m,), what the instrument states beyond all that: it drifts slowly [m, rad]
    drift: Array
    # (m,), what its digits hide, where they hide the white scatter; else 0 [m, rad]
    digits: Array
    # (m,), what finite rotations leave of the model, which no tolerance takes up [m, rad]
    table_error: Array
    gauges: Gauges | None = None  # what read them, in place of a sensor of poses: m is K, else 6

    def __len__(self) -> int:
        """Return the number of units."""
        return len(self.cut.dwell)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Which of these are reported as one length."""
        return QUANTITIES if self.gauges is None else self.gauges.quantities

    @property
    def instruments(self) -> str:
        """What measured it, for a person."""
        if self.gauges is None:
            return "poses"
        return f"gauges ({', '.join(each.name for each in self.gauges.members)})"

    @property
    def wander(self) -> Array:
        """Scatter beside the white one that no mean over a dwell makes smaller, (m,) [m, rad]."""
        return np.hypot(self.drift, self.digits)

    @cached_property
    def measured(self) -> Mask:
        """Units of which anything was measured, (u,); only these are in the table."""
        return np.asarray(np.isfinite(self.values).any(axis=1))

    def without(self, units: Labels) -> UnitSession:
        """Return the session with nothing measured in some of its units."""
        values = self.values.copy()
        values[units] = np.nan
        return replace(self, values=values)

    def seen(self, twist: Array) -> Array:
        """Return what the instrument shows of small twists at O, (..., u, 6) -> (..., u, m)."""
        return self.columns_seen(twist[..., None])[..., 0]

    def columns_seen(self, twists: Array) -> Array:
        """Return the same of columns of twists, (u, 6, k) -> (u, m, k)."""
        return twists if self.gauges is None else np.asarray(self._rows @ twists)

    @cached_property
    def common(self) -> Array:
        """What standard deviations of the gauges' mountings do to the units, (u, m, q).

        In motion the mean of that is not what they do at the mean angles: a ball a millimetre off
        goes along a bow.
        """
        if self.gauges is None:
            return np.empty((len(self), 6, 0))
        return self.mean(self.gauges.common(self.block.theta))

    def moves(self, gauge: str) -> bool:
        """Tell whether a gauge of this name followed motions of the rigid wrist."""
        if self.gauges is None:
            return False
        rigid, up = self.gauges.rigid(self.still.theta), self.gauges.up
        return any(
            each.name == gauge and each.follows(each.reading(np.zeros(3), rigid, up))
            for each in self.gauges.members
        )

    @cached_property
    def _rows(self) -> Array:
        """By how much a twist changes each reading, (u, m, 6)."""
        if self.gauges is None:
            return np.broadcast_to(np.eye(6), (len(self), 6, 6))
        return self.gauges.rows(self.still.theta)

    @property
    def block(self) -> Block:
        """Signals at the moments that are kept."""
        return self.cut.block

    @cached_property
    def still(self) -> Block:
        """Mean signals of the units, for effects without a memory."""
        return self.block.mapped(self.mean)

    @property
    def span(self) -> Array:
        """First and last moment of each unit, (u, 2) [s]."""
        return np.stack(self.cut.extremes(self.block.time), axis=1)

    @cached_property
    def known(self) -> dict[Any, Any]:
        """What models on it found out, and the next ones need not again: see `SessionModel`.

        Whether a law has a past, by law and place; what the last model did, by `Moments`.
        """
        return {}

    def thinned(self, most: int) -> UnitSession:
        """Return the session with at most so many of its measured units, evenly spread."""
        rows = np.flatnonzero(self.measured)
        if len(rows) <= most:
            return self
        own = rows[np.linspace(0, len(rows) - 1, most).astype(int)]
        return replace(
            self,
            cut=self.cut.of_units(own),
            values=self.values[own],
            samples=self.samples[own],
        )

    def mean(self, values: Array) -> Array:
        """Return the means over units (u, ...) of values at the kept moments (k, ...)."""
        flat = values.reshape(len(values), -1)
        used, units = self.cut.unit >= 0, len(self)
        weighted = flat[used] * self.cut.weight[used, None]
        sums = [np.bincount(self.cut.unit[used], column, units) for column in weighted.T]
        return np.asarray(np.stack(sums, axis=1).reshape(units, *values.shape[1:]), dtype=float)

    def mean_twist(self, twist: Array) -> Array:
        """Return the twist at O of each unit, (u, 6), from those at the kept moments, (k, 6).

        Where gauges read, it is one that at the mean angles reads as all moments do on average.
        """
        mean = self.mean(twist)
        if self.gauges is None:
            return mean
        shown = self.mean(self.gauges.predicted(twist, self.block.theta))
        off = shown - self.gauges.predicted(mean, self.still.theta)
        return np.asarray(mean + (np.linalg.pinv(self._rows) @ off[..., None])[..., 0])

    @cached_property
    def _turned(self) -> tuple[Mask, Array]:
        """Which units have a measured rotation, (u,), and the rotations (u, 3, 3)."""
        turn = self.values[:, 3:]
        known = np.asarray(np.isfinite(turn).all(axis=1))
        return known, Rotation.from_rotvec(np.where(known[:, None], turn, 0.0)).as_matrix()

    def residual(self, twist: Array) -> Array:
        """Return log(T_measured T_predicted^-1) at O in F, (..., u, 6) [m, rad].

        `twist` (..., u, 6): predicted pose error of each unit [m, rad].  Gives (..., u, m): of
        gauges what they read less what they should.
        """
        if self.gauges is not None:
            return self.values - self.gauges.predicted(twist, self.still.theta)
        rotation, shift = exp_twist(twist)
        place = self.values[:, :3]
        known, measured = self._turned
        # Without a measured rotation the predicted one stands in: then s is compared with s.
        measured = np.where(known[:, None, None], measured, rotation)
        left = measured @ np.swapaxes(rotation, -1, -2)
        moved = place - (left @ shift[..., None])[..., 0]
        out = log_motion(left, np.nan_to_num(moved))
        out[..., :3][..., ~np.isfinite(place)] = np.nan
        out[..., ~known, 3:] = np.nan
        return out


def as_units(model: ErrorModel, session: MeasuredSession) -> UnitSession:
    """Cut a session into units and average what was measured.

    Measurements outside the model's domain or load range belong to no unit.  Raises `InputError`
    with the limits if none lies in it.
    """
    accepted = model.accepts(session.block)
    if not accepted.any():
        raise InputError(
            f"{session.name}: none of {len(session)} measurements lies in the table's domain and "
            f"load range ({'; '.join(beyond_range(model.table, session.block))})"
        )
    session = session.take(accepted)
    parts = cut(
        session.block,
        model.table.geometry.limits.encoder_step,
        np.asarray(session.measured.any(axis=1)),
    )
    rigid = model.table.mechanism.platform_rotation
    turn = in_pieces(
        lambda theta, rotation: rotation_vector(rotation @ np.swapaxes(rigid(theta), 1, 2)),
        session.block.theta,
        session.rotation,
    )
    values = session.readings
    if values is None:
        values = np.concatenate([session.shift, turn], axis=1)
    units = len(parts.dwell)
    lost = _lost(values, parts)
    stated = np.zeros(values.shape[1])
    if session.covariance is not None:
        stated = np.diag(session.covariance)
    label = np.where(lost, -1, parts.label)
    mean, count = _means(values, label, units)
    steps = _steps(values, label, parts)
    white = _white(steps, stated)
    quantities = QUANTITIES if session.gauges is None else session.gauges.quantities
    digits = np.where(white == 0.0, _rounding(steps, quantities), 0.0)
    drift = np.sqrt(np.maximum(stated - np.nan_to_num(white) ** 2 - digits**2, 0.0))
    return UnitSession(
        session.name,
        parts,
        mean,
        np.maximum(count.max(axis=1), 1.0),
        int(lost.sum()),
        white,
        drift,
        digits,
        _table_error(model, parts.block, session.gauges, quantities),
        session.gauges,
    )


def _table_error(
    model: ErrorModel, block: Block, gauges: Gauges | None, quantities: Sequence[Quantity]
) -> Array:
    """Return what the table states of finite rotations, of what is seen of the deflection, (m,).

    Mesh and contact make a wrist softer or stiffer, which tolerances take up.
    """
    seen = model.with_effects().batch(block).twist
    if gauges is not None:
        seen = gauges.predicted(seen, block.theta)
    square = np.mean(seen**2, axis=0)
    for at in (list(each.components) for each in quantities):
        square[at] = square[at].mean()
    relative = model.table.header.errors.get("second_order_relative", 0.0)
    return np.asarray(relative * np.sqrt(square))


def _means(values: Array, label: Labels, units: int) -> tuple[Array, Array]:
    """Return means (u, m) of what was measured (n, m), NaN for none, and of how many, (u, m)."""
    total, count = np.zeros((2, units, values.shape[1]))
    for column, each in enumerate(values.T):
        good = np.isfinite(each) & (label >= 0)
        count[:, column] = np.bincount(label[good], minlength=units)
        total[:, column] = np.bincount(label[good], each[good], minlength=units)
    return np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0), count


def _lost(values: Array, parts: Cut) -> Mask:
    """Tell which measurements lie far from the median of their dwell, (n,).

    Of two nobody can say which one is off.
    """
    used = parts.label >= 0
    many = np.bincount(parts.label[used], minlength=len(parts.dwell)) >= FEWEST_IN_DWELL
    rows = np.flatnonzero(used & (parts.dwell & many)[parts.label])
    lost = np.zeros(len(values), dtype=bool)
    if len(rows) == 0:
        return lost
    label = parts.label[rows]
    for column in values.T:
        order = rows[np.lexsort((column[rows], label))]
        count = np.bincount(label)
        good = np.bincount(label, np.isfinite(column[rows])).astype(int)
        # NaN sort to the end of their dwell.
        first = np.cumsum(count) - count
        middle = column[order[np.minimum(first + good // 2, len(order) - 1)]]
        off = np.abs(column[rows] - middle[label])
        usual = MAD_TO_SIGMA * float(np.nanmedian(off)) if np.isfinite(off).any() else 0.0
        if usual == 0.0:
            # Digits coarser than the noise: one of them up or down is no lost beam.
            usual = float(np.min(off, initial=np.inf, where=off > 0.0))
        # A dwell in which the wrist settles or creeps is no dropout: its own spread counts too.
        own = np.sqrt(np.bincount(label, np.nan_to_num(np.minimum(off, WILD * usual)) ** 2))
        own /= np.sqrt(np.maximum(count, 1))
        own = CHANGING_SHARE * np.minimum(own, MOST_CHANGING * usual)
        lost[rows] |= off > LOST * np.maximum(usual, own[label])
    return lost


def _steps(values: Array, label: Labels, parts: Cut) -> list[Array]:
    """Return the steps between neighbours in dwells, for each component those that were seen."""
    inside = (label[1:] == label[:-1]) & (label[1:] >= 0) & parts.dwell[label[1:]]
    step = np.abs(np.diff(values, axis=0)[inside])
    step[step < FINEST] = 0.0
    return [each[np.isfinite(each)] for each in step.T]


def _white(steps: Sequence[Array], stated: Array) -> Array:
    """Return the scatter of one measurement from steps in dwells, else as stated, (6,)."""
    white = np.full(len(steps), np.nan)
    for column, each in enumerate(steps):
        if len(each) >= FEWEST_FOR_NOISE:
            white[column] = MAD_TO_SIGMA / np.sqrt(2.0) * np.median(each)
        elif stated[column] > 0.0:
            white[column] = np.sqrt(stated[column])
    return white


def _rounding(steps: Sequence[Array], quantities: Sequence[Quantity]) -> Array:
    """Return the scatter of what digits hide, by the smallest steps that they show, (m,).

    Shifts share their digits, and so do turns: in a component that never changes none shows.
    """
    smallest = [np.min(each, initial=np.inf, where=each > 0.0) for each in steps]
    digit = np.where(np.isfinite(smallest), smallest, FINEST)
    for at in (list(each.components) for each in quantities):
        digit[at] = digit[at].max()
    return digit / np.sqrt(12.0)


def all_units(model: ErrorModel, sessions: Sequence[MeasuredSession]) -> tuple[UnitSession, ...]:
    """Cut sessions into units that are looked at together.

    Raises `InputError` as `as_units`, or if they were not all measured by instruments of one kind.
    """
    units = tuple(as_units(model, session) for session in sessions)
    for other in units[1:]:
        if other.instruments != units[0].instruments:
            raise InputError(
                f"{units[0].name} was measured by {units[0].instruments}, {other.name} by "
                f"{other.instruments}: ask of them one after the other"
            )
    return units
