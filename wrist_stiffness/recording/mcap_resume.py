"""Where an MCAP file can be read again behind damage."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode

from wrist_stiffness.recording.mcap_chunk import MESSAGE, RECORD_HEAD

_HEAD = np.dtype([("opcode", "u1"), ("length", "<u8")])
_LEAST_BYTES = np.full(256, 2**63, dtype=np.uint64)
"""Length of a record by opcode; none of one that is not known."""
for _opcode, _least in {
    Opcode.FOOTER: 20,
    Opcode.SCHEMA: 14,
    Opcode.CHANNEL: 16,
    Opcode.MESSAGE: MESSAGE.itemsize - RECORD_HEAD.size,
    Opcode.CHUNK: 40,
    Opcode.MESSAGE_INDEX: 6,
    Opcode.CHUNK_INDEX: 64,
    Opcode.ATTACHMENT: 36,
    Opcode.ATTACHMENT_INDEX: 48,
    Opcode.STATISTICS: 46,
    Opcode.METADATA: 8,
    Opcode.METADATA_INDEX: 20,
    Opcode.SUMMARY_OFFSET: 17,
    Opcode.DATA_END: 4,
}.items():
    _LEAST_BYTES[_opcode] = _least
_WINDOW_BYTES = 1 << 20
_MOST_CANDIDATES = 10_000


def next_record(stream: BinaryIO, position: int, size: int) -> int | None:
    """Return where the next record begins: one that is followed by another, or by the end.

    `position`, `size`: from which byte to search, and how many the file has.
    """
    left = _MOST_CANDIDATES
    while position + RECORD_HEAD.size <= size and left > 0:
        stream.seek(position)
        window = stream.read(_WINDOW_BYTES)
        count = len(window) - RECORD_HEAD.size + 1
        heads = np.ndarray((count,), _HEAD, window, strides=(1,))
        ends = np.arange(count) + position + RECORD_HEAD.size + heads["length"].astype(float)
        possible = (heads["length"] >= _LEAST_BYTES[heads["opcode"]]) & (ends <= size)
        for place in np.flatnonzero(possible)[:left].tolist():
            left -= 1
            if _goes_on(stream, int(ends[place]), int(heads["opcode"][place]), size):
                return position + place
        position += count
    return None


def _goes_on(stream: BinaryIO, end: int, opcode: int, size: int) -> bool:
    """Tell whether a record may stand at the end of another one, or nothing has to."""
    if opcode == Opcode.FOOTER or end == size:
        return True
    stream.seek(end)
    head = stream.read(RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size:
        return False
    opcode, length = RECORD_HEAD.unpack(head)
    return _LEAST_BYTES[opcode] <= length <= size
