"""Loads, frames and slow signals of a recording, heard before the samples they belong to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from wrist_stiffness.compensation.static_transforms import static_transform
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import WristError
from wrist_stiffness.recording.messages import (
    Float64,
    Message,
    Temperature,
    TFMessage,
    WrenchStamped,
)
from wrist_stiffness.recording.reader import Recording
from wrist_stiffness.topics import COVARIATES

LOOKAHEAD_NS = 1_000_000_000
"""Signals are read this far ahead: by stamp they may belong to a sample logged before them."""


class SignalsAhead:
    """Feeds the signals of a recording to streams, a fixed time ahead of their samples.

    Parameters
    ----------
    source : Recording
        Where the signals are.
    names : mapping
        Standard by actual topic name: the load, static transforms, temperatures and covariates.
    streams : sequence of Stream
        All hear the same.
    refuse : callable
        Called with topic and reason for each message that a stream cannot use.
    """

    def __init__(
        self,
        source: Recording,
        names: Mapping[str, str],
        streams: Sequence[Stream],
        refuse: Callable[[str, object], None],
    ) -> None:
        self._messages: Iterator[tuple[str, int, Message]] = source.messages(tuple(names))
        self._next = next(self._messages, None)
        self._names = names
        self._streams = streams
        self._refuse = refuse

    def read_for(self, log_time_ns: int) -> None:
        """Hear what may belong to a sample logged at this time [ns]."""
        while self._next is not None and self._next[1] <= log_time_ns + LOOKAHEAD_NS:
            topic, at_ns, message = self._next
            self._next = next(self._messages, None)
            try:
                for stream in self._streams:
                    _hear(stream, self._names[topic], at_ns, message)
            except WristError as error:
                self._refuse(topic, error)


def _hear(stream: Stream, standard: str, log_time_ns: int, message: Message) -> None:
    if isinstance(message, WrenchStamped):
        force, torque = message.wrench.force, message.wrench.torque
        stream.loads.add(
            message.header.stamp_ns,
            message.header.frame_id,
            (force.x, force.y, force.z),
            (torque.x, torque.y, torque.z),
        )
    elif isinstance(message, TFMessage):
        for step in message.transforms:
            place, turn = step.transform.translation, step.transform.rotation
            found = static_transform(
                step.header.frame_id,
                step.child_frame_id,
                (place.x, place.y, place.z),
                (turn.x, turn.y, turn.z, turn.w),
            )
            stream.on_static_transforms([found])
    elif isinstance(message, Temperature):
        stream.temperatures.add(
            message.header.frame_id, message.header.stamp_ns, message.temperature
        )
    elif isinstance(message, Float64):
        # It has no stamp of its own: a node takes the time of arrival.
        stream.covariates.add(standard.removeprefix(COVARIATES), log_time_ns, message.data)
