"""What the laws of the true wrist see of a run of samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.statics import component_rotations
from wrist_stiffness.simulation.heat import HEATED

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Samples = TypeVar("Samples", bound="DataclassInstance")


def taken(samples: Samples, rows: int | slice) -> Samples:
    """Return some of n samples, of which every field is an array (n, ...)."""
    return type(samples)(*(getattr(samples, each.name)[rows] for each in fields(samples)))


def joined(parts: Sequence[Samples]) -> Samples:
    """Return such samples in a row as one."""
    names = [each.name for each in fields(parts[0])]
    return type(parts[0])(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


Past = tuple[float, Array]
"""Time [s] and values (...) of the sample before."""


def rates(time_s: Array, values: Array, past: Past | None) -> tuple[Array, Past]:
    """Return how fast values (n, ...) change, and the past of the next block.

    Zero at the very first sample and where time (n,) [s] stands still.
    """
    before, last = past or (time_s[0], values[0])
    change = np.diff(values, axis=0, prepend=last[None])
    steps = np.diff(time_s, prepend=before).reshape(-1, *[1] * (values.ndim - 1))
    rate = np.divide(change, steps, out=np.zeros_like(change), where=steps > 0.0)
    return rate, (float(time_s[-1]), values[-1])


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
