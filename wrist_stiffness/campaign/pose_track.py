"""Measured poses of the platform in F, whatever the instrument said them in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness.campaign.marker_poses import LEAST_MARKERS, poses_from_markers
from wrist_stiffness.campaign.signals import Signal, Stamps
from wrist_stiffness.compensation.intake import BASE_FRAME, Frames
from wrist_stiffness.compensation.measured_pose import UNIT_TOLERANCE
from wrist_stiffness.compensation.monitor_stream import NOT_MEASURED
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.recording.samples import MarkerSamples, PoseSamples, Samples

MOVED = 2.0
"""Variance over that of its white noise from which on the frame has moved, not only been noisy."""

LEAST_FRAME_POSES = 3

REFERENCE_SHARE = 0.05
"""Share of a session's frame poses, at its start, that are the reference for its motion."""


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """Measured poses by stamp.

    Parameters
    ----------
    time_ns : (n,) int64
        Rising [ns].
    shift : (n, 3) float
        Position of the platform's point O in F [m]; NaN = not measured.
    rotation : (n, 3, 3) float
        U -> F; NaN = not measured.
    covariance : (6, 6) float, optional
        As the instrument states it, zero where it does not [m, rad].
    remarks : tuple of str
        What could not be used.
    """

    time_ns: Stamps
    shift: Array
    rotation: Array
    covariance: Array | None = None
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.time_ns)


def pose_track(samples: Samples, markers: Array, frames: Frames) -> PoseTrack:
    """Return the measured poses of a recording.

    Parameters
    ----------
    samples : Samples
        With poses or markers; poses are used where there are both.
    markers : (k, 3) float
        Nominal places of the markers in U [m].
    frames : Frames
        Sensor frames that are mapped to `wrist_base`.

    Returns
    -------
    PoseTrack
        In the order of their stamps.

    Raises
    ------
    FrameError
        If they are in a frame that is neither `wrist_base` nor mapped to it.
    InputError
        If the markers are not those of the geometry or too few of them were ever seen.
    """
    if len(samples.poses.time_ns):
        track = _track_of_poses(samples.poses, "measured pose", frames)
        if len(samples.markers.time_ns):
            unused = "markers and poses were measured: the poses are used"
            track = replace(track, remarks=(*track.remarks, unused))
    else:
        track = _track_of_markers(samples.markers, markers, frames)
    if len(samples.frame_poses.time_ns):
        return without_frame_motion(
            track, _track_of_poses(samples.frame_poses, "frame pose", frames)
        )
    return track


def without_frame_motion(track: PoseTrack, frame: PoseTrack) -> PoseTrack:
    """Take the motion of the frame out of the platform's poses.

    Parameters
    ----------
    track : PoseTrack
        Poses of the platform.
    frame : PoseTrack
        Poses of a target on the frame by the same instrument.

    Returns
    -------
    PoseTrack
        As seen from the frame at the start.  Unchanged, with a remark, where the frame stood still
        within its noise: the noise of a target that is far from O would only be added.
    """
    known = np.isfinite(frame.shift).all(axis=1) & np.isfinite(frame.rotation).all(axis=(1, 2))
    if known.sum() < LEAST_FRAME_POSES:
        few = f"only {known.sum()} poses of the frame were measured: its motion stays in"
        return replace(track, remarks=(*track.remarks, few))
    first = slice(0, max(1, int(REFERENCE_SHARE * known.sum())))
    turned = Rotation.from_matrix(frame.rotation[known])
    start_turn, start = turned[first].mean(), frame.shift[known][first].mean(axis=0)
    turn = turned * start_turn.inv()
    shift = frame.shift[known] - turn.apply(start)
    motion = np.hstack([shift, turn.as_rotvec()])
    white = 0.5 * np.mean(np.diff(motion, axis=0) ** 2, axis=0)
    if np.all(motion.var(axis=0) <= MOVED * white):
        still = "the frame stood still within the noise of its measurement: nothing is taken out"
        return replace(track, remarks=(*track.remarks, still))
    signal = Signal(frame.time_ns[known], motion)
    inside = np.clip(track.time_ns, signal.time_ns[0], signal.time_ns[-1])
    at = signal.interpolated(inside)
    back = Rotation.from_rotvec(at[:, 3:]).inv()
    largest = np.max(np.linalg.norm(motion.reshape(-1, 2, 3), axis=2), axis=0)
    taken = (
        f"motion of the frame taken out: up to {1e6 * largest[0]:.1f} um at O and "
        f"{1e3 * np.degrees(largest[1]):.1f} mdeg"
    )
    return replace(
        track,
        shift=back.apply(track.shift - at[:, :3]),
        rotation=back.as_matrix() @ track.rotation,
        remarks=(*track.remarks, taken),
    )


def _track_of_poses(poses: PoseSamples, what: str, frames: Frames) -> PoseTrack:
    """Return poses in F; components with a huge variance and broken quaternions are NaN."""
    turn, origin = _in_base(poses.frame_id, what, frames)
    remarks = []
    shift = poses.position.copy()
    usable = np.abs(np.linalg.norm(poses.quaternion, axis=1) - 1.0) <= UNIT_TOLERANCE
    variance = np.diagonal(poses.covariance, axis1=1, axis2=2)
    huge = variance >= NOT_MEASURED
    shift[huge[:, :3] | ~np.isfinite(shift)] = np.nan
    partly = huge[:, 3:].any(axis=1)
    if np.any(partly & ~huge[:, 3:].all(axis=1)):
        remarks.append(f"{what}: orientations that are measured in part only are not used")
    broken = ~usable & ~partly
    shift[broken] = np.nan
    usable &= ~partly
    rotation = np.full((len(usable), 3, 3), np.nan)
    rotation[usable] = turn @ Rotation.from_quat(poses.quaternion[usable]).as_matrix()
    if np.any(turn != np.eye(3)):  # NaN times zero would spread to the other components
        shift = shift @ turn.T
    covariance = _stated(poses.covariance, ~huge)
    if covariance is not None:
        turned = block_diagonal(turn)
        covariance = turned @ covariance @ turned.T
    return _in_time_order(
        poses.time_ns, shift + origin, rotation, covariance, what, int(broken.sum()), remarks
    )


def _stated(covariance: Array, measured: NDArray[np.bool_]) -> Array | None:
    """Return the typical covariance that messages state, None where they state none."""
    told = np.isfinite(covariance).all(axis=(1, 2))
    if not told.any():
        return None
    typical: Array = np.median(covariance[told], axis=0)
    ever = measured[told].any(axis=0)
    typical = typical * np.outer(ever, ever)
    return typical if np.all(np.diag(typical)[ever] > 0.0) else None


def _track_of_markers(samples: MarkerSamples, nominal: Array, frames: Frames) -> PoseTrack:
    """Return the poses of markers in F; NaN where too few were seen."""
    what = "measured markers"
    turn, origin = _in_base(samples.frame_id, what, frames)
    count = samples.position.shape[1]
    if count != len(nominal):
        raise InputError(
            f"{what}: messages hold {count} markers, the geometry names {len(nominal)} readout "
            "points; both must be in the same order"
        )
    shift, rotation = poses_from_markers(nominal, samples.position @ turn.T + origin)
    unseen = int(np.isnan(shift).any(axis=1).sum())
    if unseen == len(shift):
        seen = np.isfinite(samples.position).all(axis=2).sum(axis=1)
        raise InputError(
            f"{what}: at most {seen.max()} of {count} were seen at once; at least {LEAST_MARKERS} "
            "that are not on a line are needed for a pose"
        )
    return _in_time_order(samples.time_ns, shift, rotation, None, what, unseen, [])


def _in_base(frame_id: NDArray[np.str_], what: str, frames: Frames) -> tuple[Array, Array]:
    """Return rotation and origin that take a sensor frame to `wrist_base`."""
    names = np.unique(frame_id).tolist()
    mapped = {
        name: (frame.rotation, frame.position)
        for name, frame in frames.sensors.items()
        if frame.parent == BASE_FRAME
    }
    known = {BASE_FRAME: (np.eye(3), np.zeros(3)), **mapped}
    for name in names:
        if name not in known:
            raise FrameError(f"{what}: frame '{name}' is not known (known: {', '.join(known)})")
    if len(names) > 1:
        raise FrameError(f"{what}: more than one frame: {', '.join(names)}")
    return known[names[0]]


def _in_time_order(
    time_ns: Stamps,
    shift: Array,
    rotation: Array,
    covariance: Array | None,
    what: str,
    lost: int,
    remarks: list[str],
) -> PoseTrack:
    """Sort by stamps, of equal ones keep the last; count what was lost."""
    _, order = np.unique(time_ns[::-1], return_index=True)
    order = len(time_ns) - 1 - order
    if lost:
        remarks.append(f"{what}: {lost} of {len(time_ns)} lost by the instrument")
    return PoseTrack(time_ns[order], shift[order], rotation[order], covariance, tuple(remarks))
