"""Decoding of many payloads of one message type at once.

The messages of a topic mostly differ in their numbers only: names, frame and the lengths of their
sequences stay.  Then each number sits at the same byte in every payload, and NumPy reads a whole
column.  Payloads that differ in more form groups of their own, down to a group of one.  Joint
states come as arrays sixteen times as fast as from rosbags (`bench/recording_speed.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.fixed_layout import FixedLayout
from wrist_stiffness.recording.mcap_chunk import Payloads
from wrist_stiffness.recording.messages import Message

# More layouts than this in one call gain nothing from columns.
_MAX_LAYOUTS = 8


@dataclass(frozen=True)
class Batch:
    """Messages that differ in their numbers only."""

    indices: NDArray[np.intp]  # (m,) array, which of the payloads, increasing
    first: Message  # the first of them, decoded; its texts and lengths are those of all
    # the numbers by dotted attribute path: (m,) for a scalar, (m, k) for a sequence of k numbers,
    # elements of other sequences by position (``poses.0.position.x``); times in integer nanoseconds
    columns: dict[str, NDArray[Any]]


def decode_batches(
    message_type: type[Message], payloads: Payloads
) -> tuple[list[Batch], list[int]]:
    """Decode payloads column by column.

    `payloads` (Sequence[bytes] or (n, size) uint8 array): CDR of either byte order.  Gives
    `batches`: together they hold every payload that can be decoded, with exactly the values of
    `decode`.
    """
    batches: list[Batch] = []
    undecodable: list[int] = []
    if isinstance(payloads, np.ndarray):
        lengths = np.full(len(payloads), payloads.shape[1], dtype=np.intp)
    else:
        lengths = np.array([len(payload) for payload in payloads], dtype=np.intp)
    remaining = np.arange(len(payloads))
    while remaining.size:
        template = bytes(payloads[remaining[0]])
        try:
            layout = FixedLayout(message_type, template)
        except RecordingError:
            undecodable.append(int(remaining[0]))
            remaining = remaining[1:]
            continue
        same_length = remaining[lengths[remaining] == len(template)]
        if len(batches) >= _MAX_LAYOUTS:
            same_length = remaining[:1]
        if isinstance(payloads, np.ndarray):
            rows = payloads if same_length.size == len(payloads) else payloads[same_length]
        else:
            joined = b"".join([payloads[index] for index in same_length])
            rows = np.frombuffer(joined, np.uint8).reshape(same_length.size, len(template))
        matches = (rows[:, layout.fixed] == rows[0, layout.fixed]).all(axis=1)
        members = same_length
        if not matches.all():
            members, rows = same_length[matches], rows[matches]
        batches.append(Batch(members, layout.like, layout.columns(rows)))
        if members.size == len(payloads):
            break
        remaining = (
            remaining[1:]
            if members.size == 1
            else remaining[~np.isin(remaining, members, assume_unique=True)]
        )
    return batches, undecodable
