"""The folder of a rosbag2 recording: which files it is split into, and what it says of them."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.inputs.document import read_yaml
from wrist_stiffness.inputs.schema import list_of, nullable, record, text, whole

METADATA_FILE = "metadata.yaml"

_NAMED = record({"name": text()}, others=True)
_INFORMATION = record(
    {"storage_identifier": text(), "relative_file_paths": list_of(text())},
    {
        "compression_mode": nullable(text()),
        "topics_with_message_count": list_of(
            record({"topic_metadata": _NAMED, "message_count": whole}, others=True)
        ),
        "files": list_of(
            record(
                {
                    "path": text(),
                    "message_count": whole,
                    "starting_time": record({"nanoseconds_since_epoch": whole}),
                    "duration": record({"nanoseconds": whole}),
                },
                others=True,
            )
        ),
    },
    others=True,
)
_METADATA = record({"rosbag2_bagfile_information": _INFORMATION}, others=True)


@dataclass(frozen=True)
class Bag:
    """Files in their order, what is wrong, and how many messages each topic shall have."""

    files: list[Path]
    flaws: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)


def bag_of(folder: Path) -> Bag:
    """Read what a folder says of its recording.

    Raises `RecordingError` if it holds no recording, one of another storage or compression, or none
    of its files.
    """
    metadata = folder / METADATA_FILE
    if not metadata.exists():
        # The recorder writes it last, so a crash leaves the storage files alone.
        if not (present := sorted(folder.glob("*.mcap"))):
            raise RecordingError(f"{folder} is no recording: neither {METADATA_FILE} nor *.mcap")
        return Bag(present, [f"{METADATA_FILE} is missing, files taken by name"])
    stated = _METADATA(read_yaml(metadata, RecordingError))["rosbag2_bagfile_information"]
    storage, compression = stated["storage_identifier"], stated.get("compression_mode") or ""
    if storage != "mcap":
        raise RecordingError(f"{metadata}: storage {storage!r} is not read, only 'mcap'")
    if compression.lower() not in ("", "none"):
        raise RecordingError(
            f"{metadata}: rosbag2 compression mode {compression!r} is not read, only MCAP's "
            "own chunk compression"
        )
    names = stated["relative_file_paths"]
    if not names:
        raise RecordingError(f"{metadata} lists no files")
    missing = [name for name in names if not os.path.isfile(folder / name)]
    if len(missing) == len(names):
        raise RecordingError(f"{folder}: {', '.join(missing)} of {METADATA_FILE} not found")
    held = {Path(file["path"]).name: _held(file) for file in stated.get("files", ())}
    return Bag(
        [folder / name for name in names if name not in missing],
        [f"{name}{held.get(Path(name).name, '')} of {METADATA_FILE} not found" for name in missing],
        {
            topic["topic_metadata"]["name"]: topic["message_count"]
            for topic in stated.get("topics_with_message_count", ())
        },
    )


def _held(file: dict[str, Any]) -> str:
    start_ns = file["starting_time"]["nanoseconds_since_epoch"]
    end_ns = start_ns + file["duration"]["nanoseconds"]
    return f" ({file['message_count']} messages, {start_ns} to {end_ns} ns)"
