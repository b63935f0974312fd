"""Sensor frames of a recording: those that the user maps, and those on its `/tf_static`."""

from __future__ import annotations

from collections.abc import Mapping

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
        Transforms that cannot be used.
    """
    topic = remaps.get(TF_STATIC, TF_STATIC)
    if topic not in {info.name for info in recording.topics}:
        return mapped, []
    found: dict[str, StaticTransform] = {}
    unusable: dict[str, None] = {}
    for _, _, message in recording.messages([topic]):
        for stamped in message.transforms if isinstance(message, TFMessage) else ():
            try:
                found[stamped.child_frame_id] = _transform(stamped)
            except InputError as error:
                unusable[f"{topic}: {error}: not used"] = None
    return Frames({**sensor_frames(found.values()), **mapped.sensors}), list(unusable)


def _transform(stamped: TransformStamped) -> StaticTransform:
    place, turn = stamped.transform.translation, stamped.transform.rotation
    return static_transform(
        stamped.header.frame_id,
        stamped.child_frame_id,
        (place.x, place.y, place.z),
        (turn.x, turn.y, turn.z, turn.w),
    )
