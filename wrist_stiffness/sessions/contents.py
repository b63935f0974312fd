"""What a recording holds, at a glance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import UnitSession


@dataclass(frozen=True, eq=False)
class Contents:
    """What one recording holds."""

    # `name`, `instrument`: of the recording, and of its pose sensor
    name: str
    instrument: str
    # `duration_s`, `rate_hz`: duration [s], and measured poses in a second [Hz]
    duration_s: float
    rate_hz: float
    # `measured`, `dwells`: measured poses, and poses that were held
    measured: int
    dwells: int
    angles: Array  # (2, 2), lowest and highest angle of each motor [rad]
    # `speed`, `force`: lowest and highest [rad/s], [N]
    speed: tuple[float, float]
    force: tuple[float, float]
    signals: tuple[str, ...]  # what was recorded beside angles, load and pose
    # remaining error once it is known where instrument and target stand, RMS by the key of the
    # quantity
    registered: Mapping[str, float]


def contents_of(
    session: MeasuredSession, units: UnitSession, registered: Mapping[str, float]
) -> Contents:
    """Return what a session holds, its units and the remaining error being known."""
    block, cut, warm = session.block, units.cut, len(session.block.temperatures)
    seconds, measured = float(np.ptp(block.time)), int(session.measured.any(axis=1).sum())
    speed = np.abs(cut.mean_speed).max(axis=1)
    force = np.linalg.norm(block.load[:, :3], axis=1)
    return Contents(
        session.name,
        str(session.notes.get("pose_sensor", "not told")),
        seconds,
        measured / seconds if seconds > 0.0 else 0.0,
        measured,
        int(cut.dwell[units.measured].sum()),
        np.stack([block.theta.min(axis=0), block.theta.max(axis=0)], axis=1),
        (float(speed.min()), float(speed.max())),
        (float(force.min()), float(force.max())),
        (*block.covariates, *([f"{warm} temperatures"] if warm else ())),
        registered,
    )
