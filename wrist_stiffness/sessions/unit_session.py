"""A measured session as units: what was measured at each dwell and moment, averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.inference.outliers import MAD_TO_SIGMA
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist, log_motion, rotation_vector
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.sessions.in_pieces import in_pieces
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.table_range import beyond_range
from wrist_stiffness.sessions.units import Cut, Labels, Mask, cut

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
    """One session as units.

    Parameters
    ----------
    name : str
        Of the session.
    cut : Cut
        Its units, and the moments that tell its path.
    shift, turn : (u, 3) float
        Mean measured pose error of each unit against the rigid wrist: shift of O [m] and rotation
        vector [rad]; NaN = not measured.
    samples : (u,) float
        Measurements in each mean.
    lost : int
        Measurements left out as lost beams.
    white : (6,) float
        Scatter of one measurement, NaN where it is not known [m, rad].
    wander : (6,) float
        Slow scatter beside it, which no mean over a dwell makes smaller: what the instrument states
        beyond the white scatter, or what its digits hide where they hide that one [m, rad].
    """

    name: str
    cut: Cut
    shift: Array
    turn: Array
    samples: Array
    lost: int
    white: Array
    wander: Array

    def __len__(self) -> int:
        """Return the number of units."""
        return len(self.cut.dwell)

    @cached_property
    def measured(self) -> Mask:
        """Units of which anything was measured, (u,); only these are in the table."""
        seen = np.isfinite(self.shift).any(axis=1) | np.isfinite(self.turn).any(axis=1)
        return np.asarray(seen)

    @property
    def block(self) -> Block:
        """Signals at the moments that are kept."""
        return self.cut.block

    @cached_property
    def still(self) -> Block:
        """Mean signals of the units, for effects without a memory."""
        mean, block = self.mean, self.block
        speed = np.zeros_like(block.theta) if block.theta_dot is None else block.theta_dot
        return Block(
            mean(block.time),
            mean(block.theta),
            mean(block.load),
            mean(speed),
            block.load_on_platform,
            {name: mean(value) for name, value in block.temperatures.items()},
            {name: mean(value) for name, value in block.covariates.items()},
        )

    @cached_property
    def known(self) -> dict[Any, Any]:
        """What models on it found out, and the next ones need not again: see `SessionModel`.

        Whether a law has a past, by law and place; what the last model did, by `Moments`.
        """
        return {}

    def mean(self, values: Array) -> Array:
        """Return the means over units (u, ...) of values at the kept moments (k, ...)."""
        flat = values.reshape(len(values), -1)
        used, units = self.cut.unit >= 0, len(self)
        weighted = flat[used] * self.cut.weight[used, None]
        sums = [np.bincount(self.cut.unit[used], column, units) for column in weighted.T]
        return np.asarray(np.stack(sums, axis=1).reshape(units, *values.shape[1:]), dtype=float)

    @cached_property
    def _turned(self) -> tuple[Mask, Array]:
        """Which units have a measured rotation, (u,), and the rotations (u, 3, 3)."""
        known = np.asarray(np.isfinite(self.turn).all(axis=1))
        return known, Rotation.from_rotvec(np.where(known[:, None], self.turn, 0.0)).as_matrix()

    def residual(self, twist: Array) -> Array:
        """Return log(T_measured T_predicted^-1) at O in F, (..., u, 6) [m, rad].

        Parameters
        ----------
        twist : (..., u, 6) float
            Predicted pose error of each unit [m, rad].
        """
        rotation, shift = exp_twist(twist)
        known, measured = self._turned
        # Without a measured rotation the predicted one stands in: then s is compared with s.
        measured = np.where(known[:, None, None], measured, rotation)
        left = measured @ np.swapaxes(rotation, -1, -2)
        moved = self.shift - (left @ shift[..., None])[..., 0]
        out = log_motion(left, np.nan_to_num(moved))
        out[..., :3][..., ~np.isfinite(self.shift)] = np.nan
        out[..., ~known, 3:] = np.nan
        return out


def as_units(model: ErrorModel, session: MeasuredSession) -> UnitSession:
    """Cut a session into units and average what was measured.

    Measurements outside the model's domain or load range belong to no unit.

    Raises
    ------
    InputError
        If none lies in it; the message names the limits.
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
    values = np.concatenate([session.shift, turn], axis=1)
    units = len(parts.dwell)
    lost = _lost(values, parts)
    stated = np.zeros(6) if session.covariance is None else np.diag(session.covariance)
    label = np.where(lost, -1, parts.label)
    mean, count = _means(values, label, units)
    steps = _steps(values, label, parts)
    white = _white(steps, stated)
    beside = np.sqrt(np.maximum(stated - np.nan_to_num(white) ** 2, 0.0))
    return UnitSession(
        session.name,
        parts,
        mean[:, :3],
        mean[:, 3:],
        np.maximum(count.max(axis=1), 1.0),
        int(lost.sum()),
        white,
        np.maximum(beside, np.where(white == 0.0, _rounding(steps), 0.0)),
    )


def _means(values: Array, label: Labels, units: int) -> tuple[Array, Array]:
    mean, count = np.full((2, units, values.shape[1]), np.nan)
    for column, each in enumerate(values.T):
        good = np.isfinite(each) & (label >= 0)
        count[:, column] = np.bincount(label[good], minlength=units)
        total = np.bincount(label[good], each[good], minlength=units)
        mean[:, column] = np.where(
            count[:, column] > 0, total / np.maximum(count[:, column], 1.0), np.nan
        )
    return mean, count


def _lost(values: Array, parts: Cut) -> Mask:
    """Tell which measurements lie far from the median of their dwell, (n,)."""
    rows = np.flatnonzero((parts.label >= 0) & parts.dwell[parts.label])
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


def _rounding(steps: Sequence[Array]) -> Array:
    """Return the scatter of what digits hide, by the smallest steps that they show, (6,).

    Shifts share their digits, and so do turns: in a component that never changes none shows.
    """
    smallest = [np.min(each, initial=np.inf, where=each > 0.0) for each in steps]
    digit = np.where(np.isfinite(smallest), np.maximum(smallest, FINEST), FINEST)
    return np.repeat(digit.reshape(2, 3).max(axis=1), 3) / np.sqrt(12.0)
