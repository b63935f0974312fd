"""Loads, frames and slow signals of a recording, heard before the samples they belong to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.intake import transform_of
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import WristError
from wrist_stiffness.recording import messages as msg
from wrist_stiffness.recording.fixed_layout import Batch, decode_batches
from wrist_stiffness.recording.raw_block import RawBlock
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.topics import COVARIATES

LOOKAHEAD_NS = 1_000_000_000
"""Signals are read this far ahead: by stamp they may belong to a sample logged before them."""

Integers = NDArray[np.int64]


@dataclass
class _Run:
    """Messages of one topic: loads of one layout as arrays, others one by one."""

    topic: str
    time_ns: Integers  # (k,), log times [ns]
    messages: Sequence[msg.Message] = ()
    # `stamps`, `frame_id`, `wrenches`: of loads as arrays, (k,) [ns] and (k, 6) [N, N m]
    stamps: Integers | None = None
    frame_id: str = ""
    wrenches: NDArray[np.float64] | None = None
    next: int = 0

    def until(self, end_ns: int) -> slice:
        """Return those that were not heard yet, up to a log time [ns]."""
        return slice(self.next, int(np.searchsorted(self.time_ns, end_ns, side="right")))


class SignalsAhead:
    """Feeds the signals of a recording to streams, a fixed time ahead of their samples.

    `names`: standard by actual topic name: the load, static transforms, temperatures and
    covariates; `streams`: all hear the same; `refuse`: called with topic and reason for each
    message that a stream cannot use.
    """

    def __init__(
        self,
        source: Recording,
        names: Mapping[str, str],
        streams: Sequence[Stream],
        refuse: Callable[[str, object], None],
    ) -> None:
        self._source = source
        self._blocks = source.blocks(tuple(names))
        self._runs: list[_Run] = []
        self._read_to_ns = -1
        self._names = names
        self._streams = streams
        self._refuse = refuse

    def read_for(self, log_time_ns: int) -> None:
        """Hear what may belong to a sample logged at this time [ns]."""
        end_ns = log_time_ns + LOOKAHEAD_NS
        self._fetch(end_ns)
        for run in self._runs:
            part = run.until(end_ns)
            if part.stop > part.start:
                self._hear(run, part)
                run.next = part.stop
        self._runs = [run for run in self._runs if run.next < len(run.time_ns)]

    def rises_until(self, log_time_ns: int, first_ns: int, slow: bool) -> bool:
        """Tell whether `read_for` can be called once for many samples.

        `log_time_ns`: of the last one [ns]; `first_ns`: the least of their stamps [ns]; `slow`:
        whether temperatures and covariates count.  Gives whether all that would be heard is newer
        than what was before, and drives nothing out that may belong to a sample.
        """
        end_ns = log_time_ns + LOOKAHEAD_NS
        self._fetch(end_ns)
        heard: dict[tuple[str, str], list[int]] = {}
        load_stamps = [np.empty(0, dtype=np.int64)]
        for run in self._runs:
            part = run.until(end_ns)
            if run.stamps is not None:
                load_stamps.append(run.stamps[part])
            times = run.time_ns[part].tolist()
            for at_ns, message in zip(times, run.messages[part], strict=False):
                if isinstance(message, msg.WrenchStamped):
                    load_stamps.append(np.array([message.header.stamp_ns]))
                elif isinstance(message, msg.Temperature):
                    of = "temperatures", message.header.frame_id
                    heard.setdefault(of, []).append(message.header.stamp_ns)
                elif isinstance(message, msg.Float64):
                    of = "covariates", self._names[run.topic].removeprefix(COVARIATES)
                    heard.setdefault(of, []).append(at_ns)
        together = np.concatenate(load_stamps)
        for stream in self._streams:
            loads = stream.loads
            if not (loads.rises_with(together) and loads.keeps(together, first_ns)):
                return False
            for (kind, name), stamps in heard.items() if slow else ():
                if not getattr(stream, kind).rises_with(name, stamps, first_ns):
                    return False
        return True

    def _fetch(self, end_ns: int) -> None:
        while self._read_to_ns <= end_ns:
            block = next(self._blocks, None)
            if block is None:
                self._read_to_ns = 2**63 - 1
                return
            self._runs.extend(_runs_of(self._source, block))
            self._read_to_ns = int(block.time_ns[-1])

    def _hear(self, run: _Run, part: slice) -> None:
        if run.stamps is not None and run.wrenches is not None:
            heard = run.stamps[part], run.frame_id, run.wrenches[part]
            # What one stream cannot use the others cannot either.
            faults = [stream.loads.add_block(*heard) for stream in self._streams]
            for reason in max(faults, key=len):
                self._refuse(run.topic, reason)
            return
        for at_ns, message in zip(run.time_ns[part].tolist(), run.messages[part], strict=True):
            try:
                for stream in self._streams:
                    _hear(stream, self._names[run.topic], at_ns, message)
            except WristError as error:
                self._refuse(run.topic, error)


def _runs_of(source: Recording, block: RawBlock) -> Iterator[_Run]:
    """Yield the messages of a block by topic, cut where a frame is told: loads need it before."""
    frames = [
        place for place, each in enumerate(block.channels) if each.message_type is msg.TFMessage
    ]
    cuts = np.flatnonzero(np.diff(np.isin(block.channel, frames))) + 1
    for part in np.split(np.arange(len(block)), cuts):
        piece = block.take(part)
        for topic, rows in piece.topics().items():
            channel = piece.channels[int(piece.channel[rows[0]])]
            if channel.message_type is msg.WrenchStamped:
                batches, undecodable = decode_batches(msg.WrenchStamped, piece.payloads(rows))
                if len(batches) == 1:
                    source.undecodable(topic, len(undecodable))
                    yield _loads(topic, piece.time_ns[rows], batches[0])
                    continue
            if channel.message_type is not None:
                messages, places = source.decoded(piece, rows)
                yield _Run(topic, piece.time_ns[places], messages)


def _loads(topic: str, time_ns: Integers, batch: Batch) -> _Run:
    names = [f"wrench.{part}.{axis}" for part in ("force", "torque") for axis in "xyz"]
    wrenches = np.stack([batch.columns[name] for name in names], axis=1)
    stamps = batch.columns["header.stamp_ns"]
    frame_id = batch.first.header.frame_id  # type: ignore[attr-defined]
    return _Run(topic, time_ns[batch.indices], (), stamps, frame_id, wrenches)


def _hear(stream: Stream, standard: str, log_time_ns: int, message: msg.Message) -> None:
    if isinstance(message, msg.TFMessage):
        for step in message.transforms:
            stream.on_static_transforms([transform_of(step)])
    elif isinstance(message, msg.WrenchStamped):
        header, force, torque = message.header, message.wrench.force, message.wrench.torque
        parts = (force.x, force.y, force.z), (torque.x, torque.y, torque.z)
        stream.loads.add(header.stamp_ns, header.frame_id, *parts)
    elif isinstance(message, msg.Temperature):
        stream.temperatures.add(
            message.header.frame_id, message.header.stamp_ns, message.temperature
        )
    elif isinstance(message, msg.Float64):
        # It has no stamp of its own: a node takes the time of arrival.
        stream.covariates.add(standard.removeprefix(COVARIATES), log_time_ns, message.data)
