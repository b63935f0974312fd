"""How a model came about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Step:
    """One step from a parent model to its child."""

    command: str  # what was run
    date: str  # when, ISO 8601
    parent_sha256: str  # of the parent's model file
    recordings: Mapping[str, str]  # SHA-256 of each recording by its name
    # SHA-256 of what was measured in each, which a replay or another copy has as well
    measured: Mapping[str, str] = field(default_factory=dict)
    added: str = ""  # `law@component` of the effect that the step added; empty for none

    def as_values(self) -> dict[str, Any]:
        """Return the step as the model file holds it."""
        return {
            name: dict(value) if isinstance(value, Mapping) else value
            for name, value in vars(self).items()
            if value or name not in ("measured", "added")
        }
