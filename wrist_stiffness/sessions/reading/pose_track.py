"""What an instrument measured: poses of the platform in F, whatever it said them in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import Frames, SensorFrame
from wrist_stiffness.compensation.measured_pose import NOT_MEASURED, UNIT_TOLERANCE
from wrist_stiffness.errors import FrameError, InputError
from wrist_stiffness.lookup.readout import MIN_SPREAD_RATIO
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import block_diagonal
from wrist_stiffness.recording.samples import MarkerSamples, PoseSamples, Samples
from wrist_stiffness.sessions.gauges import Gauges
from wrist_stiffness.sessions.reading.signals import Signal, Stamps, in_any, last_of_equal, set_back
from wrist_stiffness.topics import BASE_FRAME, INSTRUMENT_FRAME

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
"""Quaternion, scalar last."""

MOVED = 2.0
"""Variance over that of its white noise from which on the frame has moved, not only been noisy."""

LEAST_FRAME_POSES = 3

REFERENCE_SHARE = 0.05
"""Share of a session's frame poses, at its start, that are the reference for its motion."""

LEAST_MARKERS = 3

MIRROR_SHARE = 0.5
"""Of markers in a plane the mirror image is a motion too: then both misfits are noise."""


@dataclass(frozen=True, eq=False)
class MeasuredTrack:
    """Measured poses, or readings of gauges in place of them, by stamp."""

    time_ns: Stamps  # (n,) int64, rising [ns]
    shift: Array  # (n, 3), position of the platform's point O in F [m]; NaN = not measured
    rotation: Array  # (n, 3, 3), U -> F; NaN = not measured
    # (6, 6), as the instrument states it, zero where it does not [m, rad]
    covariance: Array | None = None
    remarks: tuple[str, ...] = ()  # what could not be used
    # all of this is in the axes of an instrument that stands anywhere, not in F
    unplaced: bool = False
    gauges: Gauges | None = None
    readings: Array | None = None  # (n, K), of the gauges [m] or [rad]; NaN = not read
    # (n,), poses that came as the one before to the bit; None where that is not known
    repeats: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        """Return the number of stamps."""
        return len(self.time_ns)

    def take(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> MeasuredTrack:
        """Return some of the measurements, in their order."""
        return replace(
            self,
            time_ns=self.time_ns[rows],
            shift=self.shift[rows],
            rotation=self.rotation[rows],
            readings=None if self.readings is None else self.readings[rows],
            repeats=None if self.repeats is None else self.repeats[rows],
        )

    def with_remark(self, remark: str) -> MeasuredTrack:
        """Return the track with one more remark."""
        return replace(self, remarks=(*self.remarks, remark))


def pose_track(samples: Samples, markers: Array, frames: Frames) -> MeasuredTrack:
    """Return the measured poses of a recording in the order of their stamps.

    `samples`: with poses or markers; poses are used where there are both; `markers` (k, 3): nominal
    places of the markers in U [m]; `frames`: sensor frames that are mapped to `wrist_base`.  Raises
    `FrameError` if poses are in a frame that is neither `wrist_base` nor mapped to it nor
    `instrument`; `InputError` if the markers are not those of the geometry or too few of them were
    ever seen.
    """
    posed, marked = len(samples.poses.time_ns) > 0, len(samples.markers.time_ns) > 0
    own_frame = samples.poses.frame_id if posed else samples.markers.frame_id
    unplaced = INSTRUMENT_FRAME in own_frame
    if unplaced:
        names = {*own_frame.tolist(), *samples.frame_poses.frame_id.tolist()}
        if len(names) > 1:
            raise FrameError(f"poses come in several frames: {', '.join(sorted(names))}")
        own = {INSTRUMENT_FRAME: SensorFrame(BASE_FRAME)}
        frames = Frames({**frames.sensors, **own}, frames.prefix)
    if posed:
        track = _track_of_poses(samples.poses, "measured pose", frames)
    else:
        track = _track_of_markers(samples.markers, markers, frames)
    if posed and marked:
        track = track.with_remark("markers and poses were measured: the poses are used")
    if len(samples.frame_poses.time_ns):
        frame = _track_of_poses(samples.frame_poses, "frame pose", frames)
        track = without_frame_motion(track, frame)
    return replace(track, unplaced=unplaced)


def without_frame_motion(track: MeasuredTrack, frame: MeasuredTrack) -> MeasuredTrack:
    """Take the motion of the frame out of the platform's poses.

    `frame`: poses of a target on the frame by the same instrument.  Gives poses as seen from the
    frame at the start.  Unchanged, with a remark, where the frame stood still within its noise:
    the noise of a target that is far from O would only be added.
    """
    known = np.isfinite(frame.shift).all(axis=1) & np.isfinite(frame.rotation).all(axis=(1, 2))
    if known.sum() < LEAST_FRAME_POSES:
        return track.with_remark(
            f"only {known.sum()} poses of the frame were measured: its motion stays in"
        )
    first = slice(0, max(1, int(REFERENCE_SHARE * known.sum())))
    turned = Rotation.from_matrix(frame.rotation[known])
    start_turn, start = turned[first].mean(), frame.shift[known][first].mean(axis=0)
    turn = turned * start_turn.inv()
    shift = frame.shift[known] - turn.apply(start)
    motion = np.hstack([shift, turn.as_rotvec()])
    white = 0.5 * np.mean(np.diff(motion, axis=0) ** 2, axis=0)
    if np.all(motion.var(axis=0) <= MOVED * white):
        return track.with_remark(
            "the frame stood still within the noise of its measurement: nothing is taken out"
        )
    signal = Signal(frame.time_ns[known], motion)
    inside = np.clip(track.time_ns, signal.time_ns[0], signal.time_ns[-1])
    at = signal.interpolated(inside)
    back = Rotation.from_rotvec(at[:, 3:]).inv()
    largest = np.max(np.linalg.norm(motion.reshape(-1, 2, 3), axis=2), axis=0)
    shift, rotation = back.apply(track.shift - at[:, :3]), back.as_matrix() @ track.rotation
    return replace(track, shift=shift, rotation=rotation).with_remark(
        f"motion of the frame taken out: up to {1e6 * largest[0]:.1f} um at O and "
        f"{1e3 * np.degrees(largest[1]):.1f} mdeg"
    )


def measured_components(poses: PoseSamples) -> tuple[Array, Array]:
    """Return positions (n, 3) and quaternions (n, 4) with NaN for what was not measured.

    A huge variance says so; so do numbers that are not finite.  A quaternion whose norm is not one
    is no measurement at all, and an orientation that is measured in part only is left out.
    """
    huge = np.diagonal(poses.covariance, axis1=1, axis2=2) >= NOT_MEASURED
    position, quaternion = poses.position.copy(), poses.quaternion.copy()
    unturned = huge[:, 3:].any(axis=1) | ~np.isfinite(quaternion).all(axis=1)
    broken = (np.abs(np.linalg.norm(quaternion, axis=1) - 1.0) > UNIT_TOLERANCE) & ~unturned
    position[huge[:, :3] | ~np.isfinite(position) | broken[:, None]] = np.nan
    quaternion[unturned | broken] = np.nan
    return position, quaternion


def _track_of_poses(poses: PoseSamples, what: str, frames: Frames) -> MeasuredTrack:
    turn, origin = base_transform(poses.frame_id, what, frames)
    shift, quaternion = measured_components(poses)
    turned = np.asarray(np.isfinite(quaternion).all(axis=1))
    rotation = Rotation.from_quat(np.where(turned[:, None], quaternion, IDENTITY)).as_matrix()
    rotation[~turned] = np.nan
    if np.any(turn != np.eye(3)):  # NaN times zero would spread to the other components
        shift, rotation = shift @ turn.T, turn @ rotation
    huge = np.diagonal(poses.covariance, axis1=1, axis2=2) >= NOT_MEASURED
    covariance = _stated(poses.covariance, ~huge)
    if covariance is not None:
        axes = block_diagonal(turn)
        covariance = axes @ covariance @ axes.T
    remarks = []
    if partly := int((huge[:, 3:].any(axis=1) & ~huge[:, 3:].all(axis=1)).sum()):
        remarks.append(
            f"{what}: {partly} of {len(shift)} orientations are measured in part only (a huge "
            "variance for some turn): all three turns of these are left out"
        )
    blind = ~huge[:, 3:].any(axis=1) & ~np.isfinite(poses.quaternion).all(axis=1)
    if alone := int((blind & np.isfinite(shift).any(axis=1)).sum()):
        remarks.append(
            f"{what}: {alone} of {len(shift)} orientations are not finite: of these the position "
            "alone is used"
        )
    lost = int((~turned & np.isnan(shift).all(axis=1) & ~huge.all(axis=1)).sum())
    track = MeasuredTrack(poses.time_ns, shift + origin, rotation, covariance, tuple(remarks))
    return _in_time_order(track, np.hstack([poses.position, poses.quaternion]), what, lost)


def _stated(covariance: Array, measured: NDArray[np.bool_]) -> Array | None:
    """Return the typical covariance that messages state, None where they state none.

    Of each component by those that measured it: most rows of a table may only tell the way.
    """
    told = np.isfinite(covariance).all(axis=(1, 2))
    if not told.any():
        return None
    both = measured[told][:, :, None] & measured[told][:, None, :]
    seen, ever = both.any(axis=0), measured[told].any(axis=0)
    typical: Array = np.zeros(seen.shape)
    typical[seen] = np.nanmedian(np.where(both, covariance[told], np.nan)[:, seen], axis=0)
    return typical if np.all(np.diag(typical)[ever] > 0.0) else None


def _track_of_markers(samples: MarkerSamples, nominal: Array, frames: Frames) -> MeasuredTrack:
    """Return the poses of markers in F; NaN where too few were seen."""
    what = "measured markers"
    turn, origin = base_transform(samples.frame_id, what, frames)
    count = samples.position.shape[1]
    if count != len(nominal):
        raise InputError(
            f"{what}: messages hold {count} markers, the geometry names {len(nominal)} readout "
            "points; both must be in the same order"
        )
    places = samples.position @ turn.T + origin
    shift, rotation = poses_from_markers(nominal, places)
    motion, mirror = (_misfit(nominal, sign * places) for sign in (1.0, -1.0))
    if mirror < MIRROR_SHARE * motion:
        raise InputError(
            f"{what}: they are the mirror image of the geometry's readout points: the instrument's "
            "axes are left-handed; swap two of its axes, or turn the sign of one"
        )
    unseen = int(np.isnan(shift).any(axis=1).sum())
    if unseen == len(shift):
        seen = np.isfinite(samples.position).all(axis=2).sum(axis=1)
        raise InputError(
            f"{what}: at most {seen.max()} of {count} were seen at once; at least {LEAST_MARKERS} "
            "that are not on a line are needed for a pose"
        )
    came = samples.position.reshape(len(shift), -1)
    return _in_time_order(MeasuredTrack(samples.time_ns, shift, rotation), came, what, unseen)


def base_transform(frame_id: NDArray[np.str_], what: str, frames: Frames) -> tuple[Array, Array]:
    """Return rotation and origin that take the frame of all messages to `wrist_base`.

    Raises `FrameError` if it is neither `wrist_base` nor mapped to it, or they come in several
    frames.
    """
    names = np.unique(frame_id).tolist()
    found = [frames.in_base(name, what) for name in names]
    if len(names) > 1:
        raise FrameError(f"{what}: more than one frame: {', '.join(names)}")
    return found[0]


def _in_time_order(track: MeasuredTrack, came: Array, what: str, lost: int) -> MeasuredTrack:
    """Return a track of samples, of which so many were lost, in order of time.

    `came` (n, k): the numbers of each sample as they came; NaN = not measured.
    """
    count, start_ns = len(track), int(track.time_ns[0])
    twice = set_back(track.time_ns)
    for each in twice:
        track = track.with_remark(f"{what}: {each.told(start_ns)}")
    if twice:
        once = ~in_any(twice, track.time_ns)
        track, came = track.take(once), came[once]
    left, rows = len(track), last_of_equal(track.time_ns)
    if lost:
        track = track.with_remark(f"{what}: {lost} of {count} lost by the instrument")
    track, came = track.take(rows), came[rows]
    same = (came[1:] == came[:-1]) | np.isnan(came[1:]) & np.isnan(came[:-1])
    seen = np.isfinite(track.shift).any(axis=1) | np.isfinite(track.rotation).any(axis=(1, 2))
    track = replace(track, repeats=seen & np.append(False, same.all(axis=1)))
    if len(track) == left:
        return track
    return track.with_remark(
        f"{what}: {left - len(track)} of {count} have the stamp of another one: of each only the "
        "last is used"
    )


def poses_from_markers(nominal: Array, measured: Array) -> tuple[Array, Array]:
    """Return the rigid motions with the least squared misfit (Kabsch), as `fit_markers` does.

    `nominal` (k, 3): markers in U [m]; `measured` (n, k, 3): in F [m]; a marker with any NaN is
    lost.  Gives `shift` (n, 3): position of the platform's point O in F [m], and `rotation` (n, 3,
    3): U -> F.  NaN where fewer than three markers were seen or these lie near a line.
    """
    seen = np.isfinite(measured).all(axis=2)
    shift, rotation = np.full((len(measured), 3), np.nan), np.full((len(measured), 3, 3), np.nan)
    # One fit for each set of markers that were seen together.
    patterns, belongs = np.unique(seen, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        if pattern.sum() < LEAST_MARKERS:
            continue
        reference = nominal[pattern] - nominal[pattern].mean(axis=0)
        sigma = np.linalg.svd(reference, compute_uv=False)
        if sigma[1] < MIN_SPREAD_RATIO * sigma[0]:
            continue
        rows = np.flatnonzero(belongs.reshape(-1) == number)
        points = measured[rows][:, pattern]
        centre = points.mean(axis=1)
        correlation = np.swapaxes(points - centre[:, None], 1, 2) @ reference
        left, _, right = np.linalg.svd(correlation)
        # A reflection is no motion: turn the direction that the markers tell least about.
        left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        rotation[rows] = left @ right
        shift[rows] = centre - rotation[rows] @ nominal[pattern].mean(axis=0)
    return shift, rotation


def _misfit(nominal: Array, measured: Array) -> float:
    """Return the median misfit of a rigid motion of markers [m]; infinite where there is none."""
    shift, rotation = poses_from_markers(nominal, measured)
    off = measured - nominal @ np.swapaxes(rotation, 1, 2) - shift[:, None]
    known = np.linalg.norm(off[np.isfinite(off).all(axis=2)], axis=1)
    return float(np.median(known)) if len(known) else np.inf
