"""What a replay did."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from wrist_stiffness.mechanism.components import Array

NUMBER = re.compile(r"(?<!\w)-?\d+(\.\d+)?(e[-+]?\d+)?")
"""A value in a message; not the digits of a name such as motor_1_joint."""


@dataclass
class Sizes:
    """Mean and maximum of what was never kept."""

    count: int = 0
    total: float = 0.0
    most: float = 0.0

    def add(self, values: Array) -> None:
        """Count values (n,), not negative."""
        if len(values):
            self.count += len(values)
            self.total += float(values.sum())
            self.most = max(self.most, float(values.max()))

    @property
    def mean(self) -> float:
        """Mean of all."""
        return self.total / self.count


@dataclass
class ReplaySummary:
    """What a replay did."""

    # `joint_states`, `predictions`: joint states read, predictions written
    joint_states: int = 0
    predictions: int = 0
    # `commands`, `corrections`: commands read, commands that were changed
    commands: int = 0
    corrections: int = 0
    # `trajectories`, `corrected_trajectories`: the same of trajectories
    trajectories: int = 0
    corrected_trajectories: int = 0
    # samples without a result. Reasons that differ only in their numbers are one, told by the first
    # of them
    refused: Counter[str] = field(default_factory=Counter)
    # predictions by what the model had to leave out of them, such as an effect whose temperature
    # the recording lacks
    warnings: Counter[str] = field(default_factory=Counter)
    replaced: int = 0  # outputs of an earlier run in the input, left out
    # `shift_um`, `phi_mdeg`: predicted |s| [um] and phi [mdeg]
    shift_um: Sizes = field(default_factory=Sizes)
    phi_mdeg: Sizes = field(default_factory=Sizes)
    damage: str = ""  # what is wrong with the input; empty if nothing
    _first_of_kind: dict[str, str] = field(default_factory=dict, repr=False)

    def refuse(self, topic: str, reason: object) -> None:
        """Count a message of a topic that gave no result."""
        text = f"{topic}: {reason}"
        self.refused[self._first_of_kind.setdefault(NUMBER.sub("#", text), text)] += 1

    def as_values(self) -> dict[str, Any]:
        """Return the counts and reasons as programs read them."""
        return {
            "joint_states": self.joint_states,
            "predictions": self.predictions,
            "commands": self.commands,
            "corrections": self.corrections,
            "trajectories": self.trajectories,
            "corrected_trajectories": self.corrected_trajectories,
            "warnings": dict(self.warnings),
            "refused": dict(self.refused),
            "damage": self.damage,
        }
