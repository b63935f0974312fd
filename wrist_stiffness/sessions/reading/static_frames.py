"""Sensor frames of a recording: those that the user maps, and those on its `/tf_static`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrist_stiffness.compensation.intake import (
    Frames,
    StaticTransform,
    sensor_frames,
    transform_of,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.recording.messages import TFMessage
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.topics import BASE_FRAME, PLATFORM_FRAME, TF_STATIC

MOST_NAMED = 6
"""Frames that one hint lists."""

SAME = 1e-6
"""Largest difference of two transforms that are the same [m, rad]."""


@dataclass(frozen=True)
class KnownFrames:
    """The frames in which the sensors of a recording may speak."""

    frames: Frames  # all of them
    # transforms that cannot be used, or that contradict an earlier one
    remarks: tuple[str, ...]
    hints: tuple[str, ...]  # what may be the reason where a frame is not known


def frames_of(recording: Recording, remaps: Mapping[str, str], mapped: Frames) -> KnownFrames:
    """Return the frames in which sensors may speak, as the nodes learn them.

    `recording`: may hold `/tf_static`; of two transforms of one child the later counts; `remaps`:
    actual by standard topic name; `mapped`: what the user says of frames goes before what the
    recording says.
    """
    topic = remaps.get(TF_STATIC, TF_STATIC)
    told = "--parameters FILE can tell where a sensor's frame stands"
    if topic not in {info.name for info in recording.topics}:
        return KnownFrames(mapped, (), (told,))
    found: dict[str, StaticTransform] = {}
    remarks: dict[str, None] = {}
    for _, _, message in recording.messages([topic]):
        for stamped in message.transforms if isinstance(message, TFMessage) else ():
            try:
                step = transform_of(stamped)
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
    sensors = {**sensor_frames(found.values()), **mapped.sensors}
    named = {name for step in found.values() for name in (step.parent, step.child)}
    elsewhere = sorted(named - {BASE_FRAME, PLATFORM_FRAME, *sensors})
    hints = [*remarks, told]
    if elsewhere:
        hints.append(
            f"{TF_STATIC} ties these to one another but not to {BASE_FRAME} or {PLATFORM_FRAME}: "
            + ", ".join(elsewhere[:MOST_NAMED])
            + (", ..." if len(elsewhere) > MOST_NAMED else "")
        )
    return KnownFrames(Frames(sensors), tuple(remarks), tuple(hints))


def _same(one: StaticTransform, other: StaticTransform) -> bool:
    """Tell whether two transforms of a child are one, but for the rounding of their publishers."""
    return (
        one.parent == other.parent
        and np.allclose(one.rotation, other.rotation, atol=SAME)
        and np.allclose(one.position, other.position, atol=SAME)
    )
