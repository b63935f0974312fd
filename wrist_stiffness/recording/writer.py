"""Writing of recordings that ``ros2 bag``, Foxglove, PlotJuggler and rosbags open unchanged."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EEXIST
from functools import cache
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import yaml

from wrist_stiffness.atomic_file import partial_of, remove, remove_orphans
from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.bag_folder import METADATA_FILE
from wrist_stiffness.recording.cdr import encode
from wrist_stiffness.recording.channel import Channel, channel_of
from wrist_stiffness.recording.chunk_writer import ChunkWriter, Messages
from wrist_stiffness.recording.mcap_chunk import LAST_TIME_NS
from wrist_stiffness.recording.messages import Message
from wrist_stiffness.recording.reader import open_recording

METADATA_VERSION = 9
_UNLIMITED = {"sec": 9223372036, "nsec": 854775807}
# rclpy's default profile; "unlimited" is the largest duration that rmw knows.
_QOS_PROFILE = {
    "history": "keep_last",
    "depth": 10,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": _UNLIMITED,
    "lifespan": _UNLIMITED,
    "liveliness": "automatic",
    "liveliness_lease_duration": _UNLIMITED,
    "avoid_ros_namespace_conventions": False,
}


class RecordingWriter:
    """Context manager that writes a rosbag2 folder, or one file where the path ends in ``.mcap``.

    Messages go to a hidden neighbour of the path, which takes the final name when the ``with``
    block ends without an exception; otherwise it is removed and nothing is left, unless
    `keep_partial` says so; what a killed process left there goes as well.  Memory is bounded by one
    chunk.  The same messages give the same bytes: nothing in the file depends on clock, path or
    host.

    Parameters
    ----------
    path : str or PathLike
        Folder or file to make; its parent must exist.
    overwrite : bool
        Replace an existing recording.  Anything else under that name is never replaced.
    keep_partial : bool
        Keep what was written when the disk refuses more, as `NAME.partial` or `NAME.partial.mcap`:
        what was live comes only once.  Of an earlier one that was killed nothing is removed then.

    Raises
    ------
    RecordingError
        At the beginning of the ``with`` block, if the path exists or its parent does not.
    """

    def __init__(
        self, path: str | PathLike[str], *, overwrite: bool = False, keep_partial: bool = False
    ):
        self.path = Path(path)
        self._overwrite = overwrite
        self._keep_partial = keep_partial
        self._is_folder = self.path.suffix != ".mcap"
        self._partial = partial_of(self.path)
        self._stream: BinaryIO | None = None
        self._refused: OSError | None = None
        self._channels: dict[str, tuple[Channel, int]] = {}

    def __enter__(self) -> RecordingWriter:
        """Begin the recording under its temporary name."""
        self.check_target()
        if not self._keep_partial:
            remove_orphans(self.path)
        try:
            if self._is_folder:
                self._partial.mkdir()
            self._stream = self._storage_path.open("xb")
            self._mcap = ChunkWriter(self._stream)
        except BaseException as error:
            # A signal may end the program here, before the `with` block has begun.
            self.__exit__(type(error), error, error.__traceback__)
            if isinstance(error, OSError):
                raise self._refusal(error) from error
            raise
        return self

    def check_target(self) -> None:
        """Refuse a path under which no recording can be written, as the ``with`` block does.

        Raises `RecordingError` if the path exists, or its parent does not or is a recording itself,
        or an earlier part is where this one's would be kept.
        """
        if not self.path.parent.is_dir():
            raise RecordingError(f"{self.path}: folder {self.path.parent} does not exist")
        if (self.path.parent / METADATA_FILE).exists():
            raise RecordingError(f"{self.path}: folder {self.path.parent} is a recording itself")
        if self._keep_partial and self._kept_path.exists():
            raise RecordingError(
                f"{self._kept_path} exists already, a part of an earlier recording: move it away"
            )
        if not self.path.exists():
            return
        if not self._overwrite:
            raise RecordingError(
                f"{self.path} exists already and is not overwritten; choose another name or remove "
                "it"
            )
        if self.path.is_dir() != self._is_folder or not is_only_recording(self.path):
            raise RecordingError(f"{self.path} is not only a recording and is never overwritten")

    def write(self, topic: str, message: Message, log_time_ns: int) -> None:
        """Append a message.

        `message`: class of `wrist_stiffness.recording.messages`; one class for each topic.
        `log_time_ns`: time of reception [ns]; need not increase.  Raises `RecordingError` if the
        message cannot be encoded, the topic has another type, the time is out of range or the disk
        refuses.
        """
        self.write_raw(channel_of(topic, type(message)), encode(message), log_time_ns)

    def write_raw(self, channel: Channel, payload: bytes, log_time_ns: int) -> None:
        """Append a payload as it is, of any type: copies from another recording, or from DDS.

        `log_time_ns`: time of reception [ns]; need not increase.  Raises `RecordingError` if the
        topic has another type, the time is out of range or the disk refuses, or has refused a
        message before.
        """
        if not 0 <= log_time_ns <= LAST_TIME_NS:
            raise RecordingError(
                f"{channel.topic}: log time {log_time_ns} ns is outside 0 … {LAST_TIME_NS}"
            )
        with self._writing():
            self._mcap.add_message(self.channel_id(channel), log_time_ns, payload)

    def channel_id(self, channel: Channel) -> int:
        """Return the number of a channel, for `write_block`; it is made known where it is new.

        Raises `RecordingError` if its topic has another type.
        """
        known, number = self._channels.get(channel.topic, (channel, 0))
        if known is not channel and known.ros_type != channel.ros_type:
            raise RecordingError(
                f"{channel.topic} carries {known.ros_type}, not {channel.ros_type}"
            )
        if not number:
            if not channel.topic.startswith("/"):
                raise RecordingError(f"topic {channel.topic!r} does not begin with '/'")
            metadata = {
                "offered_qos_profiles": _offered(),
                "topic_type_hash": channel.type_hash,
            }
            number = self._mcap.register(channel, metadata)
            self._channels[channel.topic] = (channel, number)
        return number

    def write_block(self, messages: Messages) -> None:
        """Append many messages, with log times as `write_raw` takes them.

        Raises `RecordingError` if the disk refuses, or has refused a message before.
        """
        with self._writing():
            self._mcap.add_messages(messages)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        if self._stream is None:
            raise RecordingError(f"{self.path}: written to outside of its `with` block")
        if self._refused is not None:
            # Nothing behind a torn chunk can be read.
            raise self._refusal(self._refused) from self._refused
        try:
            yield
        except OSError as error:
            self._refused = error
            raise self._refusal(error) from error

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give the recording its name, or remove what was written of it.

        Raises `RecordingError` if the disk refuses the end, or has refused a message before; says
        where the part is that was kept.
        """
        kept = ""
        try:
            # What was refused may be written in part: an end behind it makes no whole file.
            if exception_type is None and self._refused is None:
                self._finish()
        except OSError as error:
            self._refused = error
        finally:
            if self._stream is not None:
                # Of a finished recording nothing is left to write.
                with suppress(OSError):
                    self._stream.close()
                self._stream = None
            if self._refused is not None and self._keep_partial:
                kept = self._keep()
            # A disk that is read-only refuses to remove even what is not there.
            with suppress(OSError):
                remove(self._partial)
        told = exception is None or exception.__cause__ is self._refused
        if self._refused is not None and told:
            raise self._refusal(self._refused, kept) from self._refused

    def _keep(self) -> str:
        """Give what can be read of a refused recording a name that is seen, and say which."""
        with suppress(RecordingError, OSError):
            if self._is_folder:
                # It is written last: if at all, then not whole.
                (self._partial / METADATA_FILE).unlink(missing_ok=True)
            if count := sum(topic.count for topic in open_recording(self._partial).topics):
                self._partial.rename(self._kept_path)
                return f"; the first {count} messages are kept in {self._kept_path}"
        return ""

    def _refusal(self, error: OSError, kept: str = "") -> RecordingError:
        return RecordingError(f"{self.path} cannot be written: {error.strerror}{kept}")

    @property
    def _kept_path(self) -> Path:
        name = self.path.name
        return self.path.with_name(
            f"{name}.partial" if self._is_folder else f"{self.path.stem}.partial.mcap"
        )

    @property
    def _storage_path(self) -> Path:
        return self._partial / f"{self.path.name}_0.mcap" if self._is_folder else self._partial

    def _finish(self) -> None:
        assert self._stream is not None  # only called inside the `with` block
        self._mcap.finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        if self._is_folder:
            text = yaml.dump(self._metadata(), Dumper=_PlainDumper, sort_keys=False)
            (self._partial / METADATA_FILE).write_text(text, encoding="utf-8")
        there = self.path.exists()
        if there and not self._overwrite:
            raise FileExistsError(EEXIST, "another program has written it meanwhile")
        if there and self._is_folder:
            # A folder cannot replace another in one step; the old one steps aside first.
            replaced = self._partial.with_suffix(".replaced")
            self.path.rename(replaced)
            try:
                self._partial.rename(self.path)
            except OSError:
                replaced.rename(self.path)
                raise
            remove(replaced)
        else:
            os.replace(self._partial, self.path)

    def _metadata(self) -> dict[str, Any]:
        counts = self._mcap.counts
        total = counts.total()
        first_ns, last_ns = self._mcap.times_ns
        times = {
            "duration": {"nanoseconds": last_ns - first_ns},
            "starting_time": {"nanoseconds_since_epoch": first_ns},
            "message_count": total,
        }
        name = self._storage_path.name
        return {
            "rosbag2_bagfile_information": {
                "version": METADATA_VERSION,
                "storage_identifier": "mcap",
                **times,
                "topics_with_message_count": [
                    {
                        "topic_metadata": {
                            "name": channel.topic,
                            "type": channel.ros_type,
                            "serialization_format": channel.message_encoding,
                            "offered_qos_profiles": [_QOS_PROFILE],
                            "type_description_hash": channel.type_hash,
                        },
                        "message_count": counts[channel_id],
                    }
                    for channel, channel_id in self._channels.values()
                ],
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [name],
                "files": [{"path": name, **times}],
                "custom_data": None,
                "ros_distro": "jazzy",
            }
        }


@cache
def _offered() -> str:
    return yaml.dump([_QOS_PROFILE], Dumper=_PlainDumper).strip()


class _PlainDumper(yaml.SafeDumper):
    """Writes repeated values in full: yaml-cpp's readers need no anchors then."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def is_only_recording(path: Path) -> bool:
    """Tell whether an existing path holds nothing but a recording and may be replaced."""
    if path.is_file():
        return True
    return all(entry.name == METADATA_FILE or entry.suffix == ".mcap" for entry in path.iterdir())
