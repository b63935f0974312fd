"""Convert in: measured poses and markers from any frame, and the motion of the wrist's frame."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import UNIT_TOLERANCE, Frames
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.readout import fit_markers
from wrist_stiffness.mechanism.components import Array

NOT_MEASURED = 1.0
"""A variance of this or more says that a component is not measured [m^2, rad^2]."""

FARTHEST_M = 1e3
"""No instrument measures a wrist from farther away; its square is still a number."""

FRAME_POSES_KEPT = 256

Stamped = TypeVar("Stamped", bound=tuple[Any, ...])


def measured_pose(
    frames: Frames,
    frame_id: str,
    position: Sequence[float],
    quaternion: Sequence[float],
    what: str = "measured pose",
) -> tuple[Array, Array]:
    """Return a measured pose in F.

    `frames`: frames in which it may come; `position`, `quaternion` [m], x y z w; `what`: what was
    measured, for the message.  Gives `rotation` (3, 3): to F, and `position` (3,): in F [m].
    Raises `FrameError` if the frame is neither `wrist_base` nor mapped to it; `InputError` if a
    number is not finite or beyond reason or the quaternion is no unit quaternion.
    """
    turn, origin = frames.in_base(frame_id, what)
    numbers = np.array([*position, *quaternion], dtype=float)
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{what}: {numbers.tolist()} is not finite")
    norm = float(np.linalg.norm(numbers[3:]))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InputError(f"{what}: quaternion has the norm {norm:.4g}, not 1")
    _require_near(numbers[:3], what)
    return turn @ Rotation.from_quat(numbers[3:]).as_matrix(), turn @ numbers[:3] + origin


def pose_of_markers(
    frames: Frames, frame_id: str, points: ArrayLike, nominal: Array
) -> tuple[Array, Array]:
    """Return the platform's pose in F from the places of its markers.

    `frames`: frames in which they may come; `points` (n, 3): measured [m], a marker with a NaN is
    lost; `nominal` (n, 3): the same points of the platform in U [m].  Gives `rotation` (3, 3): U ->
    F, and `position` (3,): of the platform's point at O in F [m].  Raises `FrameError` if the frame
    is neither `wrist_base` nor mapped to it; `InputError` if another number of points comes, fewer
    than three that are not on a line are seen, or a coordinate is infinite or beyond reason.
    """
    turn, origin = frames.in_base(frame_id, "measured markers")
    places = np.reshape(np.asarray(points, dtype=float), (-1, 3))
    if len(places) != len(nominal):
        raise InputError(
            f"measured markers: {len(places)} came, the geometry names {len(nominal)} readout "
            "points; both must be in the same order"
        )
    _require_near(places, "measured markers")
    fit = fit_markers(nominal, places @ turn.T + origin)
    return fit.rotation, fit.shift


def _require_near(places: Array, what: str) -> None:
    """Refuse coordinates that are out of any proportion; NaN are not looked at."""
    farthest = float(np.max(np.abs(places), initial=0.0, where=~np.isnan(places)))
    if farthest > FARTHEST_M:
        raise InputError(f"{what}: a coordinate of {farthest:.4g} m is beyond {FARTHEST_M:g} m")


def newest_before(kept: deque[Stamped], stamp_ns: int, age_limit_s: float, what: str) -> Stamped:
    """Return the newest of what is kept, stamp [ns] first, that is not younger than a pose.

    `what`: is kept, for the message.  Raises `InputError` if there is none, or it is too old.
    """
    newest = next((each for each in reversed(kept) if each[0] <= stamp_ns), None)
    if newest is None:
        raise InputError(f"measured pose: no {what} with a stamp before it")
    age_ns = stamp_ns - newest[0]
    if age_ns > round(age_limit_s * NANOSECONDS):
        raise InputError(
            f"measured pose: newest {what} is {age_ns / NANOSECONDS:.3f} s older "
            f"(limit {age_limit_s:g} s)"
        )
    return newest


class FrameMotion:
    """How the wrist's frame has moved since a target on it was first measured.

    `age_limit_s`: oldest pose of the frame that is still used [s].
    """

    def __init__(self, age_limit_s: float) -> None:
        self._age_limit_s = age_limit_s
        self.count = 0  # poses of the frame taken in
        self._first: tuple[Array, Array] | None = None
        self._poses: deque[tuple[int, Array, Array]] = deque(maxlen=FRAME_POSES_KEPT)

    def add(self, stamp_ns: int, rotation: Array, position: Array) -> None:
        """Keep a pose of the frame's target: its stamp [ns], rotation (3, 3), place (3,) [m]."""
        if self._first is None:
            self._first = rotation, position
        self._poses.append((stamp_ns, rotation, position))
        self.count += 1

    def taken_out(self, stamp_ns: int, rotation: Array, position: Array) -> tuple[Array, Array]:
        """Return a pose of the platform as seen from the frame where it was first.

        `stamp_ns`: of the platform's pose [ns]; `rotation` (3, 3): U -> F; `position` (3,): in F
        [m].  Gives (3, 3), (3,): the same; unchanged where the frame was never measured.  Raises
        `InputError` if the frame was measured once, but not lately: a pose with its motion left in
        would look like a change of the wrist.
        """
        if self._first is None:
            return rotation, position
        newest = newest_before(self._poses, stamp_ns, self._age_limit_s, "pose of the frame")
        # F now, as seen from F at first: T_now T_first^-1.
        turn = newest[1] @ self._first[0].T
        moved = newest[2] - turn @ self._first[1]
        return turn.T @ rotation, turn.T @ (position - moved)
