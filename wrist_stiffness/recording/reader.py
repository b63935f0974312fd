"""Reading of recordings: rosbag2 folders with MCAP storage, and bare MCAP files."""

from __future__ import annotations

import heapq
import os
from collections import Counter
from collections.abc import Collection, Iterator
from itertools import islice, pairwise
from os import PathLike
from pathlib import Path

import numpy as np

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.bag_folder import METADATA_FILE, Bag, bag_of
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.mcap_chunk import (
    Chunk,
    Contents,
    Payloads,
    StoredMessage,
    Times,
    contents_of,
)
from wrist_stiffness.recording.mcap_index import McapIndex, index_mcap
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.raw_block import Integers, RawBlock, RawMessage
from wrist_stiffness.recording.topic_info import TopicInfo, topics_of

MOST_OPENED_BYTES = 256 << 20
"""Of chunks that overlap in time.  A recorder's overlap by as much as a message is late."""

RECENT_BYTES = 3 << 20
"""Of chunks that stay unpacked: more than two of the usual size."""

MESSAGES_AT_A_TIME = 4096
"""A block of messages: enough that a step for all of them costs little for each one."""

PAYLOADS_AT_A_TIME = 10_000
"""So many of one topic are given together: a chunk has some hundred, and each step of decoding them
costs as much for a hundred as for a thousand."""


class Recording:
    """An opened recording; made by `open_recording`.

    No file stays open between two reads, and any number of iterations may run side by side.

    Attributes
    ----------
    path : Path
        Folder or file.
    topics : tuple[TopicInfo, ...]
        By name; also those that cannot be decoded.
    """

    def __init__(self, path: Path, indices: list[McapIndex], bag: Bag, strict: bool):
        self.path = path
        self._indices = indices
        self._strict = strict
        # Texts in order of discovery; a second reading meets the same flaws again.
        self._flaws: dict[str, None] = {}
        self._undecodable: Counter[str] = Counter()
        self._recent: dict[Chunk, Contents] = {}
        self.topics = topics_of(indices)
        flaws = [flaw for index in indices for flaw in index.flaws]
        for flaw in [*bag.flaws, *flaws, *_check_counts(self.topics, bag.counts)]:
            self._report(flaw)

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

        Parameters
        ----------
        topics : Collection[str], optional
            Names to keep; None keeps all.

        Yields
        ------
        RawMessage
            Ties in log time come in the order of the file.  Memory is bounded by the chunks that
            overlap in time.

        Raises
        ------
        RecordingError
            If the recording was opened as strict and a chunk is damaged.
        """
        chunks = [
            (chunk, index, position)
            for index in self._indices
            for position, chunk in enumerate(index.chunks)
        ]
        waiting = sorted(
            ((chunk.start_ns, order) for order, (chunk, *_) in enumerate(chunks)), reverse=True
        )
        # Each entry: time and position in the recording of the next message of an opened chunk.
        opened: list[tuple[int, int, int, list[StoredMessage]]] = []
        while waiting or opened:
            while waiting and (not opened or waiting[-1][0] <= opened[0][0]):
                _, order = waiting.pop()
                stored = self._load(*chunks[order][1:], topics)
                if stored:
                    overlapping = sum(chunks[other][0].uncompressed_size for _, other, *_ in opened)
                    if overlapping > MOST_OPENED_BYTES:
                        raise RecordingError(
                            f"{self.path}: {len(opened)} chunks of {overlapping} bytes overlap at "
                            f"{stored[0].log_time_ns} ns, more than {MOST_OPENED_BYTES}: sort it "
                            "by time ('mcap sort')"
                        )
                    heapq.heappush(opened, (stored[0].log_time_ns, order, 0, stored))
            if not opened:
                return
            time_ns, order, position, stored = opened[0]
            channels = chunks[order][1].channels
            if len(opened) == 1 and (not waiting or stored[-1].log_time_ns < waiting[-1][0]):
                # No other chunk reaches into this one: the rest of it needs no comparing.
                for log_time_ns, channel_id, payload in stored[position:]:
                    yield RawMessage(channels[channel_id], log_time_ns, payload)
                opened.clear()
                continue
            yield RawMessage(channels[stored[position].channel_id], time_ns, stored[position][2])
            position += 1
            if position < len(stored):
                following = (stored[position].log_time_ns, order, position, stored)
                heapq.heapreplace(opened, following)
            else:
                heapq.heappop(opened)

    def blocks(
        self, topics: Collection[str] | None = None, least: int = MESSAGES_AT_A_TIME
    ) -> Iterator[RawBlock]:
        """Iterate over the stored messages in log-time order, many at a time, without decoding.

        Parameters
        ----------
        topics : Collection[str], optional
            Names to keep; None keeps all.
        least : int
            So many messages at a time, or up to a chunk more.

        Yields
        ------
        RawBlock
            The same messages in the same order as `raw_messages`.

        Raises
        ------
        RecordingError
            As `raw_messages`.
        """
        waiting: list[RawBlock] = []
        for part in self._parts(least):
            if topics is not None:
                wanted = [channel.topic in topics for channel in part.channels]
                part = part.take(np.flatnonzero(np.array(wanted)[part.channel]))
            waiting.append(part)
            if sum(map(len, waiting)) >= least:
                yield RawBlock.joined(waiting)
                waiting = []
        if sum(map(len, waiting)):
            yield RawBlock.joined(waiting)

    def decoded(self, block: RawBlock, rows: Integers) -> tuple[list[Message], Integers]:
        """Decode messages of a block one by one, of types that are known.

        Parameters
        ----------
        block : RawBlock
            Of this recording.
        rows : (k,) int
            Which ones.

        Returns
        -------
        list of Message, (l,) int
            Those that can be decoded, and which they are; the others count as damage.
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

    def _parts(self, size: int) -> Iterator[RawBlock]:
        chunks = [chunk for index in self._indices for chunk in index.chunks]
        if all(before.end_ns <= after.start_ns for before, after in pairwise(chunks)):
            for index in self._indices:
                for position in range(len(index.chunks)):
                    contents = self._contents(index, position)
                    if contents is not None:
                        yield RawBlock.of_contents(contents, index.channels)
            return
        # Chunks that reach into each other are merged message by message.
        messages = self.raw_messages()
        while part := list(islice(messages, size)):
            yield RawBlock.of(part)

    def payloads(self, topics: Collection[str]) -> Iterator[tuple[str, Times, Payloads]]:
        """Iterate over the payloads of topics, many of one topic at a time.

        Parameters
        ----------
        topics : Collection[str]
            Names.

        Yields
        ------
        tuple[str, array, Payloads]
            Topic, log times [ns] and payloads, in the order of the file.

        Raises
        ------
        RecordingError
            If the recording was opened as strict and a chunk is damaged.
        """
        for index in self._indices:
            wanted = {
                number: channel.topic
                for number, channel in index.channels.items()
                if channel.topic in topics
            }
            runs: dict[int, list[tuple[Times, Payloads]]] = {number: [] for number in wanted}
            for position in range(len(index.chunks)):
                contents = self._contents(index, position)
                for number, part in contents.payloads(wanted).items() if contents else ():
                    run = runs[number]
                    if run and not _one_more(run, part):
                        yield wanted[number], *_joined(run)
                        run.clear()
                    if len(part[1]):
                        run.append(part)
            for number, run in runs.items():
                if run:
                    yield wanted[number], *_joined(run)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, Message]]:
        """Iterate over the decoded messages in log-time order.

        Parameters
        ----------
        topics : Collection[str], optional
            Names to keep; None keeps all whose type is known.

        Yields
        ------
        tuple[str, int, Message]
            Topic, log time [ns], message.

        Raises
        ------
        RecordingError
            If the recording was opened as strict and a chunk or a payload is damaged.
        """
        self._undecodable.clear()
        for channel, log_time_ns, payload in self.raw_messages(topics):
            message_type = channel.message_type
            if message_type is None:
                continue
            try:
                message = decode(message_type, payload)
            except RecordingError as error:
                if self._strict:
                    place = f"{self.path}: {channel.topic} at log time {log_time_ns} ns"
                    raise RecordingError(f"{place}: {error}") from error
                self._undecodable[channel.topic] += 1
                continue
            yield channel.topic, log_time_ns, message

    def _load(
        self, index: McapIndex, position: int, topics: Collection[str] | None
    ) -> list[StoredMessage]:
        contents = self._contents(index, position)
        if contents is None:
            return []
        known = index.channels
        orphans = [number for number in contents.spans if number not in known]
        unwanted = [
            number
            for number, channel in known.items()
            if topics is not None and channel.topic not in topics
        ]
        return contents.messages([*orphans, *unwanted])

    def _contents(self, index: McapIndex, position: int) -> Contents | None:
        """Unpack a chunk; report what is wrong with it, None where it cannot be read.

        Those of late stay at hand: a replay reads the loads of a chunk some time before the rest.
        """
        chunk = index.chunks[position]
        if (contents := self._recent.get(chunk)) is not None:
            return contents
        try:
            contents = contents_of(chunk)
            if flaw := index.disagreement(contents, position):
                self._report(flaw)
        except RecordingError as error:
            self._report(f"{error}, left out: {index.told(index.chunk_spans[position])}")
            return None
        self._recent[chunk] = contents
        while sum(kept.uncompressed_size for kept in self._recent) > RECENT_BYTES:
            del self._recent[next(iter(self._recent))]
        return contents

    def _report(self, flaw: str) -> None:
        if self._strict:
            raise RecordingError(f"{self.path}: {flaw}")
        self._flaws[flaw] = None


def open_recording(path: str | PathLike[str], *, strict: bool = False) -> Recording:
    """Open a recording for reading.

    Parameters
    ----------
    path : str or PathLike
        A rosbag2 folder or an MCAP file.
    strict : bool
        Raise at the first damage instead of giving what is there.

    Returns
    -------
    Recording
        Its topics are known; messages are read when asked for.

    Raises
    ------
    RecordingError
        If the path is missing, empty, no recording, or of a storage other than MCAP; with `strict`
        also if it is cut.
    """
    path = Path(path)
    # Unlike Path.exists, this one takes a name that is too long or has a zero byte.
    if not os.path.exists(path):
        raise RecordingError(f"{path} does not exist")
    bag = bag_of(path) if path.is_dir() else Bag([path])
    return Recording(path, [index_mcap(file) for file in bag.files], bag, strict)


def _one_more(run: list[tuple[Times, Payloads]], part: tuple[Times, Payloads]) -> bool:
    """Tell whether payloads go on with those of chunks before: of one form, and not too many."""
    if sum(len(payloads) for _, payloads in run) >= PAYLOADS_AT_A_TIME:
        return False
    return _size(run[-1][1]) == _size(part[1])


def _size(payloads: Payloads) -> int | None:
    """Return the size of payloads that all have one, None of others."""
    return payloads.shape[1] if isinstance(payloads, np.ndarray) else None


def _joined(run: list[tuple[Times, Payloads]]) -> tuple[Times, Payloads]:
    """Return the payloads of several chunks as those of one."""
    times = np.concatenate([times for times, _ in run])
    rows = [payloads for _, payloads in run if isinstance(payloads, np.ndarray)]
    if rows:
        return times, np.concatenate(rows)
    return times, [payload for _, payloads in run for payload in payloads]


def _check_counts(topics: tuple[TopicInfo, ...], stated: dict[str, int]) -> Iterator[str]:
    """Yield how the messages found differ from those stated by the metadata."""
    found = {info.name: info.count for info in topics}
    for name, count in stated.items():
        if (there := found.get(name, 0)) != count:
            yield f"{METADATA_FILE} states {count} messages of {name}, {there} found"
