"""What a result was made from: files with checksums, versions, command."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from wrist_stiffness import __version__
from wrist_stiffness.commands.read_sessions import measured_sha256, sha256_by_name
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.model_file import file_sha256
from wrist_stiffness.sessions.measured_session import MeasuredSession


@dataclass(frozen=True)
class Run:
    """What a result says of the run that made it."""

    command: str  # as it was typed
    date: str  # ISO 8601

    def step(self, parent: str | Path, recordings: Mapping[Path, MeasuredSession]) -> Step:
        """Return the step from a parent's file to its child."""
        measured = {session.name: measured_sha256(session) for session in recordings.values()}
        return Step(
            self.command, self.date, file_sha256(parent), sha256_by_name(recordings), measured
        )


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from."""

    command: str
    date: str  # when, ISO 8601
    # `models`, `recordings`: SHA-256 by file name
    models: Mapping[str, str]
    recordings: Mapping[str, str]

    @property
    def versions(self) -> dict[str, str]:
        """Versions of this package, of Python and of the libraries that compute."""
        return {
            "wrist_stiffness": __version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        }

    def as_values(self) -> dict[str, Any]:
        """Return what programs read."""
        return {**asdict(self), "versions": self.versions}
