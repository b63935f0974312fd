"""Which recordings an argument names: one, or all of a folder."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.recording.bag_folder import METADATA_FILE

STORAGE = ".mcap"


def is_recording(path: Path) -> bool:
    """Tell whether a path is one recording: an MCAP file, or a rosbag2 folder.

    A recorder that was killed leaves no `metadata.yaml`; its files still bear the folder's name and
    a number.
    """
    if not path.is_dir():
        return path.suffix.lower() == STORAGE
    if (path / METADATA_FILE).is_file():
        return True
    storage = list(path.glob(f"*{STORAGE}"))
    own = re.compile(re.escape(path.name) + r"_\d+")
    return bool(storage) and all(own.fullmatch(file.stem) for file in storage)


def recordings_in(paths: Iterable[str | Path]) -> Counter[Path]:
    """Return the recordings that paths name, and how often: a folder stands for all that it holds.

    Raises `RecordingError` if a path does not exist, or a folder holds no recording.
    """
    found = Counter[Path]()
    for path in map(Path, paths):
        if not os.path.exists(path):
            raise RecordingError(f"{path} does not exist")
        if path.suffix in (".yaml", ".yml"):
            raise RecordingError(
                f"{path} is no recording; if it is a model: compare, diagnose and replay take it "
                "after --model, other commands first"
            )
        if is_recording(path) or not path.is_dir():
            found[path] += 1
            continue
        inside = sorted(entry for entry in path.iterdir() if is_recording(entry))
        if not inside:
            raise RecordingError(
                f"{path} holds no recording: neither rosbag2 folders nor {STORAGE} files"
            )
        found.update(inside)
    return found
