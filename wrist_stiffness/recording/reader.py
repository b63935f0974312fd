"""Reading of recordings: rosbag2 folders with MCAP storage, and bare MCAP files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.bag_folder import METADATA_FILE, Bag, bag_of
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.mcap_chunk import (
    LAST_TIME_NS,
    Chunk,
    Contents,
    Integers,
    Payloads,
    Span,
    contents_of,
)
from wrist_stiffness.recording.mcap_index import McapIndex, index_mcap
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.raw_block import RawBlock, RawMessage


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a recording."""

    # `name`, `ros_type`: topic and ``package/msg/Type``
    name: str
    ros_type: str
    count: int  # number of messages
    # `first_ns`, `last_ns`: log time of the first and last message; None without messages
    first_ns: int | None
    last_ns: int | None


def topics_of(indices: list[McapIndex]) -> tuple[TopicInfo, ...]:
    """Return the topics of files that belong together, by name."""
    spans: dict[tuple[str, str], Span | None] = {}
    for index in indices:
        own = index.spans
        for channel_id, channel in index.channels.items():
            key = channel.topic, channel.ros_type
            known = spans.setdefault(key, None)
            if span := own.get(channel_id):
                spans[key] = span.joined(known)
    return tuple(
        TopicInfo(
            name=name,
            ros_type=ros_type,
            count=span.count if span else 0,
            first_ns=span.first_ns if span else None,
            last_ns=span.last_ns if span else None,
        )
        for (name, ros_type), span in sorted(spans.items(), key=lambda item: item[0])
    )


MOST_OPENED_BYTES = 256 << 20
"""Of chunks that overlap in time.  A recorder's overlap by as much as a message is late."""

RECENT_BYTES = 3 << 20
"""Of chunks that stay unpacked: more than two of the usual size."""

MESSAGES_AT_A_TIME = 4096
"""A block of messages: enough that a step for all of them costs little for each one."""

PAYLOADS_AT_A_TIME = 10_000
"""The same for what is only decoded: each step costs as much for a hundred as for a thousand."""

MOST_BYTES_AT_A_TIME = 32 << 20
"""Where messages are large, a block is fewer of them."""


class Recording:
    """An opened recording; made by `open_recording`.

    No file stays open between two reads, and any number of iterations may run side by side.
    """

    def __init__(self, path: Path, indices: list[McapIndex], bag: Bag):
        self.path = path
        self._indices = indices
        # Texts in order of discovery; a second reading meets the same flaws again.
        self._flaws: dict[str, None] = {}
        self._undecodable: Counter[str] = Counter()
        self._recent: dict[Chunk, Contents] = {}
        self.topics = topics_of(indices)  # by name; also those that cannot be decoded
        flaws = [flaw for index in indices for flaw in index.flaws]
        for flaw in [*bag.flaws, *flaws, *_check_counts(self.topics, bag.counts)]:
            self._flaws[flaw] = None

    @property
    def damage(self) -> str:
        """What is wrong with the recording, empty where nothing is known to be.

        Cuts are known from the start; chunks that fail their checksum and payloads that cannot be
        decoded are known as soon as they have been read.
        """
        undecodable = (
            f"{topic}: {count} messages cannot be decoded"
            for topic, count in self._undecodable.items()
            if count
        )
        return "; ".join([*self._flaws, *undecodable])

    def raw_messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Iterate over the stored messages, in log-time order, without decoding.

        `topics`: names to keep; None keeps all.  Ties in log time come in the order of the file.
        Memory is bounded by the chunks that overlap in time; too many are a `RecordingError`.
        """
        for part in self._parts(topics):
            yield from part.messages()

    def blocks(
        self, topics: Collection[str] | None = None, least: int = MESSAGES_AT_A_TIME
    ) -> Iterator[RawBlock]:
        """Iterate over the stored messages in log-time order, many at a time, without decoding.

        They are those of `raw_messages`, in the same order.

        `topics`: names to keep; None keeps all; `least`: so many messages at a time or up to a
        chunk more, or fewer that are large.
        """
        waiting: list[RawBlock] = []
        for part in self._parts(topics):
            waiting.append(part)
            size = sum(len(block.buffer) for block in waiting)
            if sum(map(len, waiting)) >= least or size >= MOST_BYTES_AT_A_TIME:
                yield RawBlock.joined(waiting)
                waiting = []
        if waiting:
            yield RawBlock.joined(waiting)

    def decoded(self, block: RawBlock, rows: Integers) -> tuple[list[Message], Integers]:
        """Decode messages of a block one by one, of types that are known.

        `rows` (k,): which ones.  Gives list of Message, (l,): those that can be decoded, and which
        they are; the others count as damage.
        """
        messages, places = [], []
        for place, payload in zip(rows.tolist(), block.payloads(rows), strict=True):
            channel = block.channels[int(block.channel[place])]
            if channel.message_type is None:
                continue
            try:
                messages.append(decode(channel.message_type, bytes(payload)))
                places.append(place)
            except RecordingError:
                self._undecodable[channel.topic] += 1
        return messages, np.array(places, dtype=np.int64)

    def undecodable(self, topic: str, count: int) -> None:
        """Count payloads of a topic that somebody could not decode as damage."""
        self._undecodable[topic] += count

    def _parts(self, topics: Collection[str] | None) -> Iterator[RawBlock]:
        """Yield messages by log time, ties in the order of the file, about a chunk at a time."""
        chunks = [(chunk, index) for index in self._indices for chunk in index.chunks]
        # Chunks that were opened, by their place in the recording: what is left of them.
        opened: dict[int, RawBlock] = {}
        for order in sorted(range(len(chunks)), key=lambda order: chunks[order][0].start_ns):
            chunk, index = chunks[order]
            yield from _earlier(opened, chunk.start_ns, order)
            if (contents := self._contents(index, chunk)) is None:
                continue
            channels = {
                number: channel
                for number, channel in index.channels.items()
                if topics is None or channel.topic in topics
            }
            opened[order] = RawBlock.of_contents(contents, channels)
            if (size := sum(len(block.buffer) for block in opened.values())) > MOST_OPENED_BYTES:
                raise RecordingError(
                    f"{self.path}: {len(opened)} chunks of {size} bytes overlap at "
                    f"{chunk.start_ns} ns, more than {MOST_OPENED_BYTES}: sort it "
                    "by time ('mcap sort')"
                )
        yield from _earlier(opened, LAST_TIME_NS, len(chunks))

    def payloads(self, topics: Collection[str]) -> Iterator[tuple[str, Integers, Payloads]]:
        """Iterate over topic, log times [ns] and payloads, many of one topic at a time."""
        for block in self.blocks(topics, PAYLOADS_AT_A_TIME):
            for topic, rows in block.topics().items():
                yield topic, block.time_ns[rows], block.payloads(rows)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, Message]]:
        """Iterate over topic, log time [ns] and decoded message, in log-time order.

        `topics`: names to keep; None keeps all whose type is known.
        """
        self._undecodable.clear()
        for part in self._parts(topics):
            messages, places = self.decoded(part, np.arange(len(part)))
            for message, place in zip(messages, places.tolist(), strict=True):
                channel = part.channels[int(part.channel[place])]
                yield channel.topic, int(part.time_ns[place]), message

    def _contents(self, index: McapIndex, chunk: Chunk) -> Contents | None:
        """Unpack a chunk; report what is wrong with it, None where it cannot be read.

        Those of late stay at hand: a replay reads the loads of a chunk some time before the rest.
        """
        if (contents := self._recent.get(chunk)) is not None:
            return contents
        try:
            contents = contents_of(chunk)
            if flaw := index.disagreement(contents, chunk):
                self._flaws[flaw] = None
        except RecordingError as error:
            self._flaws[f"{error}, left out: {index.told(chunk.spans)}"] = None
            return None
        self._recent[chunk] = contents
        while sum(kept.uncompressed_size for kept in self._recent) > RECENT_BYTES:
            del self._recent[next(iter(self._recent))]
        return contents


def open_recording(path: str | PathLike[str]) -> Recording:
    """Open a recording for reading.

    `path`: a rosbag2 folder or an MCAP file.  Gives `Recording`: its topics are known; messages are
    read when asked for.  Raises `RecordingError` if the path is missing, empty, no recording, or of
    a storage other than MCAP.
    """
    path = Path(path)
    # Unlike Path.exists, this one takes a name that is too long or has a zero byte.
    if not os.path.exists(path):
        raise RecordingError(f"{path} does not exist")
    bag = bag_of(path) if path.is_dir() else Bag([path])
    return Recording(path, [index_mcap(file) for file in bag.files], bag)


def _earlier(opened: dict[int, RawBlock], start_ns: int, order: int) -> Iterator[RawBlock]:
    """Take what comes before the first message of a chunk out of those that were opened."""
    parts = []
    for number in sorted(opened):
        block = opened.pop(number)
        side: Literal["left", "right"] = "right" if number < order else "left"
        end = int(np.searchsorted(block.time_ns, start_ns, side=side))
        if end:
            parts.append(block.take(slice(0, end)))
        if end < len(block):
            opened[number] = block.take(slice(end, None))
    if parts:
        found = RawBlock.joined(parts)
        yield found if len(parts) == 1 else found.take(np.argsort(found.time_ns, kind="stable"))


def _check_counts(topics: tuple[TopicInfo, ...], stated: dict[str, int]) -> Iterator[str]:
    """Yield how the messages found differ from those stated by the metadata."""
    found = {info.name: info.count for info in topics}
    for name, count in stated.items():
        if (there := found.get(name, 0)) != count:
            yield f"{METADATA_FILE} states {count} messages of {name}, {there} found"
