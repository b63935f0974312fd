"""What the laws of the true wrist see of a run of samples."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

from wrist_stiffness.mechanism.components import ELASTIC, Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.statics import component_rotations
from wrist_stiffness.simulation.heat import HEATED


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
        whole = self.configuration
        configuration = Configuration(*(getattr(whole, f.name)[rows] for f in fields(whole)))
        return Block(
            self.time_s[rows],
            configuration,
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
