"""Sensor frames of a recording: those that the user maps, and those on its `/tf_static`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.static_transforms import (
    StaticTransform,
    sensor_frames,
    static_transform,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.recording.messages import TFMessage, TransformStamped
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.recording.topics import TF_STATIC

SAME = 1e-6
"""Largest difference of two transforms that are the same [m, rad]."""


def frames_of(
    recording: Recording, remaps: Mapping[str, str], mapped: Frames
) -> tuple[Frames, list[str]]:
    """Return the frames in which sensors may speak, as the nodes learn them.

    Parameters
    ----------
    recording : Recording
        May hold `/tf_static`; of two transforms of one child the later counts.
    remaps : mapping
        Actual by standard topic name.
    mapped : Frames
        What the user says of frames goes before what the recording says.

    Returns
    -------
    Frames
        All of them.
    list of str
        Transforms that cannot be used, or that contradict an earlier one.
    """
    topic = remaps.get(TF_STATIC, TF_STATIC)
    if topic not in {info.name for info in recording.topics}:
        return mapped, []
    found: dict[str, StaticTransform] = {}
    remarks: dict[str, None] = {}
    for _, _, message in recording.messages([topic]):
        for stamped in message.transforms if isinstance(message, TFMessage) else ():
            try:
                step = _transform(stamped)
            except InputError as error:
                remarks[f"{topic}: {error}: not used"] = None
                continue
            before = found.get(step.child)
            if before is not None and not _same(before, step):
                remarks[
                    f"{topic}: {step.child!r} stands in two places, first in {before.parent!r}, "
                    f"then in {step.parent!r}: the later one is used all along"
                ] = None
            found[step.child] = step
    return Frames({**sensor_frames(found.values()), **mapped.sensors}), list(remarks)


def _same(one: StaticTransform, other: StaticTransform) -> bool:
    """Tell whether two transforms of a child are one, but for the rounding of their publishers."""
    return (
        one.parent == other.parent
        and np.allclose(one.rotation, other.rotation, atol=SAME)
        and np.allclose(one.position, other.position, atol=SAME)
    )


def _transform(stamped: TransformStamped) -> StaticTransform:
    place, turn = stamped.transform.translation, stamped.transform.rotation
    return static_transform(
        stamped.header.frame_id,
        stamped.child_frame_id,
        (place.x, place.y, place.z),
        (turn.x, turn.y, turn.z, turn.w),
    )
