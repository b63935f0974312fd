"""What the laws of the true wrist see of a run of samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.statics import component_rotations
from wrist_stiffness.simulation.heat import HEATED

Samples = TypeVar("Samples")
"""A dataclass of which every field is an array (n, ...)."""


def taken(samples: Samples, rows: int | slice) -> Samples:
    """Return some of n samples."""
    whole: Any = samples
    some: Samples = type(whole)(*(getattr(whole, each.name)[rows] for each in fields(whole)))
    return some


def joined(parts: Sequence[Samples]) -> Samples:
    """Return samples in a row as one."""
    like: Any = parts[0]
    names = [each.name for each in fields(like)]
    whole: Samples = type(like)(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in names)
    )
    return whole


class Rate:
    """How fast values change from sample to sample, block after block."""

    def __init__(self) -> None:
        self._past: tuple[float, Array] | None = None

    def __call__(self, time_s: Array, values: Array) -> Array:
        """Return the change of the next values (n, ...) over that of their times (n,) [s].

        Zero at the very first sample and where time stands still.
        """
        before, last = self._past or (time_s[0], values[0])
        self._past = float(time_s[-1]), values[-1]
        change = np.diff(values, axis=0, prepend=last[None])
        steps = np.diff(time_s, prepend=before).reshape(-1, *[1] * (values.ndim - 1))
        return np.divide(change, steps, out=np.zeros_like(change), where=steps > 0.0)


@dataclass(frozen=True)
class Block:
    """A run of n samples in the order of time."""

    time_s: Array  # (n,), time since the start [s]
    # the rigid wrist at the true angles of the links that the motors turn
    configuration: Configuration
    load: Array  # (n, 6), wrench on the platform at O in F, own weight aside [N, N m]
    flexibility: Array  # (n, 8, 6, 6), of each elastic component at O in F
    temperature: Array  # (n, 7), of each of `HEATED` above the reference temperature [K]

    def __getitem__(self, rows: slice) -> Block:
        """Return some of the samples."""
        return Block(
            self.time_s[rows],
            taken(self.configuration, rows),
            self.load[rows],
            self.flexibility[rows],
            self.temperature[rows],
        )

    @cached_property
    def rotations(self) -> Array:
        """Rotation from home of the body that carries each component, (n, 8, 3, 3)."""
        return component_rotations(self.configuration)

    def rotation(self, component: str) -> Array:
        """Rotation from home of the body that carries one component, (n, 3, 3)."""
        return self.rotations[:, ELASTIC.index(component)]

    def temperature_of(self, body: str) -> Array:
        """Temperature of a body above the reference temperature, (n,) [K]."""
        return self.temperature[:, HEATED.index(body)]
