"""What one session of a campaign measured: where the platform really was, and under what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.block import Block


@dataclass(frozen=True, eq=False)
class MeasuredSession:
    """Measured poses of the platform with the signals that belong to them, in the order of time.

    Between two sessions the instruments or the machine were set up anew.

    Parameters
    ----------
    name : str
        For reports: the recording's file name.
    block : Block
        Signals at the stamps of the n measurements.
    shift : (n, 3) float
        Measured position of the platform's point O in F [m]; NaN = not measured.
    rotation : (n, 3, 3) float
        Measured rotation U -> F; NaN = not measured.
    covariance : (6, 6) float, optional
        White scatter of one measurement as its instrument states it, fixed axes of F, translation
        first [m, rad].
    notes : dict
        What the recording says of itself: sensor, wrist, session, load source.

    Raises
    ------
    InputError
        If there is no measurement, or the shapes do not belong together.
    """

    name: str
    block: Block
    shift: Array
    rotation: Array
    covariance: Array | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the shapes."""
        n = len(self.block)
        if n == 0:
            raise InputError(f"{self.name}: no measured pose")
        for name, shape in {"shift": (n, 3), "rotation": (n, 3, 3)}.items():
            if np.shape(getattr(self, name)) != shape:
                found = np.shape(getattr(self, name))
                raise InputError(f"{self.name}: {name} has shape {found}, not {shape}")

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.block)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which of the six components of each pose error were measured, (n, 6)."""
        turned = np.isfinite(self.rotation.sum(axis=(1, 2)))
        return np.hstack([np.isfinite(self.shift), np.repeat(turned[:, None], 3, axis=1)])

    def take(self, rows: slice | NDArray[np.bool_]) -> MeasuredSession:
        """Return some of the measurements, in their order."""
        return MeasuredSession(
            self.name,
            self.block.take(rows),
            self.shift[rows],
            self.rotation[rows],
            self.covariance,
            self.notes,
        )
