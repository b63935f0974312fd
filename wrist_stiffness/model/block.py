"""What the laws are told: a block of samples, in the order of time.

A recording is one large block, a live stream is blocks of one sample; so both are the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.configuration import Configuration
from wrist_stiffness.mechanism.vectors import both_halves


@dataclass(frozen=True)
class Block:
    """Signals of n samples.

    Parameters
    ----------
    time : (n,) float
        Stamps, not falling [s].
    theta : (n, 2) float
        Motor angles [rad].
    load : (n, 6) float
        Wrench on the platform at O as the load sensor says it [N, N m].
    theta_dot : (n, 2) float, optional
        Motor speeds [rad/s]; where absent they are backward differences.
    load_on_platform : bool
        Whether the load's components are in U instead of F.
    temperatures : dict of str to (n,) float
        By component or `ambient` [degC].
    covariates : dict of str to (n,) float
        Anything else, by name.

    Raises
    ------
    InputError
        If lengths differ, the time falls, or a temperature or covariate is not finite.
    """

    time: Array
    theta: Array
    load: Array
    theta_dot: Array | None = None
    load_on_platform: bool = False
    temperatures: Mapping[str, Array] = field(default_factory=dict)
    covariates: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the shapes."""
        n = len(self.time)
        wanted = {"time": (n,), "theta": (n, 2), "load": (n, 6), "theta_dot": (n, 2)}
        for name, shape in wanted.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(f"block: {name} has shape {np.shape(value)}, not {shape}")
        for name, value in {**self.temperatures, **self.covariates}.items():
            if np.shape(value) != (n,):
                raise InputError(f"block: {name} has shape {np.shape(value)}, not ({n},)")
            if not np.isfinite(value).all():
                raise InputError(f"block: {name} is not finite everywhere; hold its last value")
        if n > 1 and (step := np.diff(self.time)).min() < 0.0:
            at = int(np.argmin(step))
            raise InputError(
                f"block: time falls from {self.time[at]:.6f} to {self.time[at + 1]:.6f} s"
            )

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time)

    def take(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Block:
        """Return some of the samples, in their order."""
        return self.mapped(lambda values: values[rows])

    def mapped(self, function: Callable[[Array], Array]) -> Block:
        """Return what a function along the samples makes of every signal."""
        return Block(
            function(self.time),
            function(self.theta),
            function(self.load),
            None if self.theta_dot is None else function(self.theta_dot),
            self.load_on_platform,
            {name: function(value) for name, value in self.temperatures.items()},
            {name: function(value) for name, value in self.covariates.items()},
        )


class Load(NamedTuple):
    """Wrench on the platform at O, fixed in F or turning with the platform.

    Attributes
    ----------
    wrench : (6,) float
        Force and moment at O [N, N m].
    on_platform : bool
        True if the components are in U (`wrist_platform`), else in F (`wrist_base`).
    """

    wrench: Array
    on_platform: bool = False

    def in_base(self, configuration: Configuration) -> Array:
        """Return the wrench in F at a configuration, (6,) [N, N m]."""
        if not self.on_platform:
            return self.wrench
        return both_halves(configuration.platform, self.wrench)


@dataclass(frozen=True)
class Sample:
    """Signals of one moment.

    Parameters
    ----------
    time : float
        Stamp [s].
    theta : (2,) float
        Motor angles [rad].
    load : Load
        As the load sensor says it.
    theta_dot : (2,) float, optional
        Motor speeds [rad/s]; where absent the difference to the sample before.
    temperatures : dict of str to float
        By component or `ambient` [degC].
    covariates : dict of str to float
        Anything else, by name.
    """

    time: float
    theta: Array
    load: Load
    theta_dot: Array | None = None
    temperatures: Mapping[str, float] = field(default_factory=dict)
    covariates: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def block(self) -> Block:
        """The same as a block of one sample."""
        return Block(
            np.array([self.time]),
            np.asarray(self.theta, dtype=float)[None],
            np.asarray(self.load.wrench, dtype=float)[None],
            None if self.theta_dot is None else np.asarray(self.theta_dot, dtype=float)[None],
            self.load.on_platform,
            {name: np.array([value]) for name, value in self.temperatures.items()},
            {name: np.array([value]) for name, value in self.covariates.items()},
        )
