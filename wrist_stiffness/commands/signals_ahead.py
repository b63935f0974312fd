"""Loads, frames and slow signals of a recording, heard before the samples they belong to."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.compensation.intake import transform_of
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import WristError
from wrist_stiffness.recording.batch import decode_batches
from wrist_stiffness.recording.messages import (
    Float64,
    Message,
    Temperature,
    TFMessage,
    WrenchStamped,
)
from wrist_stiffness.recording.raw_block import RawBlock
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.topics import COVARIATES

LOOKAHEAD_NS = 1_000_000_000
"""Signals are read this far ahead: by stamp they may belong to a sample logged before them."""

Integers = NDArray[np.int64]


@dataclass
class _Run:
    """Messages of one topic, one after the other: loads as arrays, others one by one."""

    topic: str
    time_ns: Integers  # (k,), log times [ns]
    # `stamps`, `frame_id`, `wrenches`: of loads that share their frame, (k,) [ns] and (k, 6) [N, N
    # m]
    stamps: Integers | None = None
    frame_id: str = ""
    wrenches: NDArray[np.float64] | None = None
    messages: Sequence[Message] = ()  # all others
    next: int = 0


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
        self._runs: deque[_Run] = deque()
        self._read_to_ns = -1
        self._names = names
        self._streams = streams
        self._refuse = refuse

    def read_for(self, log_time_ns: int) -> None:
        """Hear what may belong to a sample logged at this time [ns]."""
        end_ns = log_time_ns + LOOKAHEAD_NS
        self._fetch(end_ns)
        while self._runs and self._runs[0].time_ns[self._runs[0].next] <= end_ns:
            run = self._runs[0]
            begin, run.next = run.next, int(np.searchsorted(run.time_ns, end_ns, side="right"))
            if run.next == len(run.time_ns):
                self._runs.popleft()
            self._hear(run, slice(begin, run.next))

    def rises_until(self, log_time_ns: int, first_ns: int, slow: bool) -> bool:
        """Tell whether `read_for` can be called once for many samples.

        `log_time_ns`: of the last one [ns]; `first_ns`: the least of their stamps [ns]; `slow`:
        whether temperatures and covariates count.  Gives whether all that would be heard is newer
        than what was before, and drives nothing out that may belong to a sample.
        """
        end_ns = log_time_ns + LOOKAHEAD_NS
        self._fetch(end_ns)
        stamps = [
            run.stamps[run.next : np.searchsorted(run.time_ns, end_ns, side="right")]
            for run in self._runs
            if run.stamps is not None
        ]
        together = np.concatenate([np.empty(0, dtype=np.int64), *stamps])
        return (not slow or self._slow_rise(end_ns, first_ns)) and all(
            stream.loads.rises_with(together) and stream.loads.keeps(together, first_ns)
            for stream in self._streams
        )

    def _slow_rise(self, end_ns: int, first_ns: int) -> bool:
        heard: dict[tuple[str, str], list[int]] = {}
        for run in self._runs:
            end = int(np.searchsorted(run.time_ns, end_ns, side="right"))
            times = run.time_ns[run.next : end].tolist()
            for at_ns, message in zip(times, run.messages[run.next : end], strict=False):
                if isinstance(message, Temperature):
                    of = "temperatures", message.header.frame_id
                    heard.setdefault(of, []).append(message.header.stamp_ns)
                elif isinstance(message, Float64):
                    of = "covariates", self._names[run.topic].removeprefix(COVARIATES)
                    heard.setdefault(of, []).append(at_ns)
        return all(
            getattr(stream, kind).rises_with(name, stamps, first_ns)
            for (kind, name), stamps in heard.items()
            for stream in self._streams
        )

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


def _runs_of(source: Recording, block: RawBlock) -> list[_Run]:
    """Return the messages of a block in their order, loads in batches."""
    decoded: list[_Run] = []
    rows: list[Integers] = []
    for topic, own in block.topics().items():
        channel = block.channels[int(block.channel[own[0]])]
        if channel.message_type is None:
            continue
        if channel.message_type is WrenchStamped:
            batches, undecodable = decode_batches(WrenchStamped, block.payloads(own))
            for batch in batches:
                columns = batch.columns
                names = ("force", "torque")
                wrenches = [columns[f"wrench.{name}.{axis}"] for name in names for axis in "xyz"]
                decoded.append(
                    _Run(
                        topic,
                        block.time_ns[own[batch.indices]],
                        columns["header.stamp_ns"],
                        _frame_of(batch.first),
                        np.stack(wrenches, axis=1),
                    )
                )
                rows.append(own[batch.indices])
            source.undecodable(topic, len(undecodable))
            continue
        messages, places = source.decoded(block, own)
        decoded.append(_Run(topic, block.time_ns[places], messages=messages))
        rows.append(places)
    return _in_order(decoded, rows)


def _frame_of(message: Message) -> str:
    return message.header.frame_id if isinstance(message, WrenchStamped) else ""


def _in_order(runs: list[_Run], rows: list[Integers]) -> list[_Run]:
    """Cut runs where messages of other runs stand between theirs."""
    if len(runs) < 2:
        return runs
    number = np.concatenate([np.full(len(own), i) for i, own in enumerate(rows)])
    within = np.concatenate([np.arange(len(own)) for own in rows])
    order = np.argsort(np.concatenate(rows))
    number, within = number[order], within[order]
    cuts = np.flatnonzero(np.diff(number)) + 1
    return [
        _part(runs[int(of[0])], slice(int(place[0]), int(place[-1]) + 1))
        for of, place in zip(np.split(number, cuts), np.split(within, cuts), strict=True)
        if len(of)
    ]


def _part(run: _Run, part: slice) -> _Run:
    return _Run(
        run.topic,
        run.time_ns[part],
        None if run.stamps is None else run.stamps[part],
        run.frame_id,
        None if run.wrenches is None else run.wrenches[part],
        run.messages[part],
    )


def _hear(stream: Stream, standard: str, log_time_ns: int, message: Message) -> None:
    if isinstance(message, TFMessage):
        for step in message.transforms:
            stream.on_static_transforms([transform_of(step)])
    elif isinstance(message, Temperature):
        stream.temperatures.add(
            message.header.frame_id, message.header.stamp_ns, message.temperature
        )
    elif isinstance(message, Float64):
        # It has no stamp of its own: a node takes the time of arrival.
        stream.covariates.add(standard.removeprefix(COVARIATES), log_time_ns, message.data)
