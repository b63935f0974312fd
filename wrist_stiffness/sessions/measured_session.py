"""What one session of a campaign measured: where the platform really was, and under what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block
from wrist_stiffness.sessions.gauges import Gauges
from wrist_stiffness.sessions.in_pieces import in_pieces


@dataclass(frozen=True, eq=False)
class MeasuredSession:
    """Measured poses of the platform with the signals that belong to them, in the order of time.

    Between two sessions the instruments or the machine were set up anew.  Rows in which nothing was
    measured carry the path of angles and load between two measurements, which friction, backlash
    and creep remember.

    Raises `InputError` if there is no measurement.
    """

    name: str  # for reports: the recording's file name
    block: Block  # signals at the stamps of the n rows
    shift: Array  # (n, 3), measured position of the platform's point O in F [m]; NaN = not measured
    rotation: Array  # (n, 3, 3), measured rotation U -> F; NaN = not measured
    # (6, 6), white scatter of one measurement as its instrument states it, fixed axes of F,
    # translation first [m, rad]
    covariance: Array | None = None
    # what the recording says of itself: sensor, wrist, session, load source
    notes: Mapping[str, Any] = field(default_factory=dict)
    # what could not be used of the recording or was put right, a line for each
    remarks: tuple[str, ...] = ()
    # the one of them that says it is cut or damaged, and how much is used; empty where it is whole
    damage: str = ""
    # pose sensor's clock minus the joint states', estimate and one standard uncertainty, where the
    # motion tells it [s]
    clock_offset_s: tuple[float, float] | None = None
    gauges: Gauges | None = None  # dial gauges and inclinometers in place of a sensor of poses
    # (n, K), what they read less what they would of the rigid wrist [m] or [rad]; NaN = not read
    readings: Array | None = None

    def __post_init__(self) -> None:
        """Refuse what is empty."""
        if len(self.block) == 0:
            raise InputError(f"{self.name}: no measured pose")

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.block)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which of the six components of each pose error, or readings, there are, (n, m)."""
        if self.readings is not None:
            return np.isfinite(self.readings)
        turned = np.isfinite(self.rotation.sum(axis=(1, 2)))
        return np.hstack([np.isfinite(self.shift), np.repeat(turned[:, None], 3, axis=1)])

    def take(self, rows: slice | NDArray[np.bool_]) -> MeasuredSession:
        """Return some of the rows, in their order."""
        return replace(
            self,
            block=self.block.take(rows),
            shift=self.shift[rows],
            rotation=self.rotation[rows],
            readings=None if self.readings is None else self.readings[rows],
        )


MOST_BEYOND = 0.5
"""Share of the samples beyond the load range from which the load is doubted, not the samples."""


def overloaded(table: Table, block: Block) -> NDArray[np.bool_]:
    """Tell which samples of a block have a larger force or moment than a table takes, (n, 2)."""
    size = np.linalg.norm(block.load.reshape(-1, 2, 3), axis=2)
    return np.asarray(size > table.geometry.limits.most_load)


def beyond_range(table: Table, block: Block) -> list[str]:
    """Say which limits of a table samples exceed: how many, how far, and the limit."""
    of, out = len(block), []
    largest = np.linalg.norm(block.load.reshape(-1, 2, 3), axis=2).max(axis=0, initial=0.0)
    for name, beyond, size, limit, unit, others in zip(
        ("force", "moment"),
        overloaded(table, block).sum(axis=0).tolist(),
        largest,
        table.geometry.limits.most_load,
        ("N", "N m"),
        ("mN or grams", "N mm"),
        strict=True,
    ):
        if beyond:
            doubt = f" (is it in {others}? a recording has {unit})"
            out.append(
                f"{beyond} of {of} measured poses are not used: the {name} at O goes up to "
                f"{size:.3g} {unit}, the table's limit is {limit:.3g} {unit}"
                + (doubt if beyond > MOST_BEYOND * of else "")
            )
    outside = ~in_pieces(table.workspace.domain, block.theta)
    if outside.any():
        first = ", ".join(f"{angle:.1f}" for angle in np.degrees(block.theta[outside][0]))
        turns = np.abs(block.theta).max() > 2.0 * np.pi
        out.append(
            f"{outside.sum()} of {of} measured poses are not used: they lie outside the table's "
            f"domain, the first at {first} deg"
            + (" (are the angles in degrees? a recording has radians)" if turns else "")
        )
    return out
