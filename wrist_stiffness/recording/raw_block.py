"""Some thousand stored messages at a time, in log-time order, undecoded.

Two million a second: five times what rosbags reads, thirteen times what mcap does
(`bench/recording_speed.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wrist_stiffness.recording.channel import Channel
from wrist_stiffness.recording.mcap_chunk import (
    MESSAGE,
    MESSAGE_HEAD_SIZE,
    Contents,
    Integers,
    Payloads,
    from_each_byte,
)


class RawMessage(NamedTuple):
    """A message as stored: channel, log time and undecoded payload."""

    channel: Channel
    log_time_ns: int
    payload: bytes


@dataclass(frozen=True)
class RawBlock:
    """n stored messages."""

    buffer: bytes  # holds their payloads
    channels: tuple[Channel, ...]  # of the file or files
    channel: Integers  # (n,), place of each message's channel among them
    time_ns: Integers  # (n,), log times, not falling [ns]
    # `begin`, `size`: (n,), where each payload is in the buffer
    begin: Integers
    size: Integers

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.time_ns)

    def take(self, rows: slice | Integers) -> RawBlock:
        """Return some of the messages, in their order."""
        own = (self.channel[rows], self.time_ns[rows], self.begin[rows], self.size[rows])
        return RawBlock(self.buffer, self.channels, *own)

    def topics(self) -> dict[str, Integers]:
        """Return which messages each topic has."""
        names = [channel.topic for channel in self.channels]
        found: dict[str, list[Integers]] = {}
        for place in np.flatnonzero(np.bincount(self.channel)).tolist():
            found.setdefault(names[place], []).append(np.flatnonzero(self.channel == place))
        return {name: np.sort(np.concatenate(rows)) for name, rows in found.items()}

    def payloads(self, rows: Integers) -> Payloads:
        """Return the payloads of some messages, as an array where all have one size."""
        begin, size = self.begin[rows], self.size[rows]
        if len(rows) and size[0] and (size == size[0]).all():
            own = from_each_byte(self.buffer, np.dtype(f"V{int(size[0])}"))[begin]
            return own.view(np.uint8).reshape(len(rows), -1)
        return [
            self.buffer[a:b] for a, b in zip(begin.tolist(), (begin + size).tolist(), strict=True)
        ]

    def messages(self) -> Iterator[RawMessage]:
        """Iterate over the messages one by one."""
        columns = self.channel.tolist(), self.time_ns.tolist(), self.begin.tolist()
        ends = (self.begin + self.size).tolist()
        for channel, time_ns, begin, end in zip(*columns, ends, strict=True):
            yield RawMessage(self.channels[channel], time_ns, self.buffer[begin:end])

    @classmethod
    def joined(cls, blocks: list[RawBlock]) -> RawBlock:
        """Return blocks of one recording, one after the other, as one."""
        if len(blocks) == 1:
            return blocks[0]
        channels: dict[Channel, int] = {}
        columns = []
        shift = 0
        for block in blocks:
            place = [channels.setdefault(channel, len(channels)) for channel in block.channels]
            columns.append(
                (np.array(place)[block.channel], block.time_ns, block.begin + shift, block.size)
            )
            shift += len(block.buffer)
        own = (np.concatenate(column) for column in zip(*columns, strict=True))
        return cls(b"".join([block.buffer for block in blocks]), tuple(channels), *own)

    @classmethod
    def of_contents(cls, contents: Contents, channels: dict[int, Channel]) -> RawBlock:
        """Return the messages of a chunk that have a channel, by log time."""
        places = np.full(1 << 16, -1)
        places[list(channels)] = np.arange(len(channels))
        heads, begins = contents.heads, contents.begins
        channel = places[heads["channel"]]
        if (channel < 0).any():
            rows = np.flatnonzero(channel >= 0)
            heads, begins, channel = heads[rows], begins[rows], channel[rows]
        block = cls(
            contents.buffer,
            tuple(channels.values()),
            channel,
            heads["log_time"].astype(np.int64),
            begins + MESSAGE.itemsize,
            heads["length"].astype(np.int64) - MESSAGE_HEAD_SIZE,
        )
        if (np.diff(block.time_ns) < 0).any():
            block = block.take(np.argsort(block.time_ns, kind="stable"))
        return block
