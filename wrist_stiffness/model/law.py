"""What an effect is: a law that turns a block of samples and a state into a contribution."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.parameters import Parameter

if TYPE_CHECKING:
    from wrist_stiffness.model.situation import Situation

Stage = Literal["parts", "load", "geometry", "reaction", "sensor"]
STAGES: tuple[Stage, ...] = ("parts", "load", "geometry", "reaction", "sensor")
"""What a law changes, in the order of evaluation: elastic parts; wrenches on the bodies; screws and
gaps that no force decides; screws and wrenches that follow the forces through the components; what
the pose sensor says."""


@dataclass(frozen=True)
class Contribution:
    """What one effect adds at n samples; everything at O in F, None for nothing.

    Parameters
    ----------
    limb_1, limb_2 : (n, 6) float, optional
        Screw in a limb, carried by its G and its rows of the slides [m, rad].
    both : (n, 6) float, optional
        Screw under or behind both limbs [m, rad].
    wrench : (n, 6) float, optional
        On the platform [N, N m].
    through : (n, 8, 6) float, optional
        Further wrench through the elastic components, in the order of `ELASTIC` [N, N m].
    gap : (n, m) float, optional
        Opening of the flange sectors [m].
    sensor_left, sensor_right : (n, 6) float, optional
        Twists X and Y of the pose sensor, T_measured = exp(X) T_err exp(Y) T_nominal [m, rad].
    """

    limb_1: Array | None = None
    limb_2: Array | None = None
    both: Array | None = None
    wrench: Array | None = None
    through: Array | None = None
    gap: Array | None = None
    sensor_left: Array | None = None
    sensor_right: Array | None = None

    def __add__(self, other: Contribution) -> Contribution:
        """Return both together; to first order they do not know of each other."""
        return Contribution(
            *(_added(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        )

    def check(self, samples: int, sectors: int) -> None:
        """Refuse arrays of other shapes than n samples and m sectors ask for, or not finite.

        Raises
        ------
        InputError
            The message names the field.
        """
        shapes = {"through": (samples, 8, 6), "gap": (samples, sectors)}
        for name in (f.name for f in fields(self)):
            value, shape = getattr(self, name), shapes.get(name, (samples, 6))
            if value is not None and np.shape(value) != shape:
                raise InputError(f"{name} has shape {np.shape(value)}, not {shape}")
            if value is not None and not np.isfinite(value).all():
                raise InputError(f"{name} is not finite")


def _added(a: Array | None, b: Array | None) -> Array | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


NOTHING = Contribution()


class MissingSignalError(Exception):
    """A law asks for a signal that the samples do not have; the evaluation turns it to a warning.

    Parameters
    ----------
    signal : str
        What is missing.
    """

    def __init__(self, signal: str) -> None:
        super().__init__(signal)
        self.signal = signal


class Law(ABC):
    """A physical effect that may sit at one of several places.

    A law has no state of its own: what it must remember between blocks goes out as the state and
    comes back with the next block.  The state None means that nothing was before: the law starts
    settled under the first sample.

    Attributes
    ----------
    id : str
        Name in the model file.
    stage : str
        What it changes, one of `STAGES`.
    places : tuple of str
        Components where it may be.
    sentence : str
        What it is, for a technician; `{place}` is replaced.
    check : str
        What to swap, tighten or indicate on the machine to be sure.
    signals : tuple of str
        What it needs beyond angles and load.
    excited_by : str
        What a recording must hold to show it.
    file : path or None
        The Python file of a user's own law.
    """

    id: str
    stage: Stage
    places: tuple[str, ...]
    sentence: str
    check: str
    signals: tuple[str, ...] = ()
    excited_by: str
    file: Path | None = None

    @property
    def foreign(self) -> bool:
        """Whether the law is a user's own Python."""
        return not type(self).__module__.startswith("wrist_stiffness.model.")

    @abstractmethod
    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the parameters that the law has at a place."""

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return what the effect adds at every sample of a block, and the state after it.

        Parameters
        ----------
        at : Situation
            n samples and what follows from them.
        place : str
            One of `places`.
        values : dict of str to float
            Parameters in SI units by their full names.
        state : object
            What the call for the block before returned, None at first.

        Returns
        -------
        Contribution
            For n samples.
        object
            State for the next block.

        Raises
        ------
        MissingSignalError
            If a signal that it needs is absent.
        """
        return NOTHING, None

    def stage_at(self, place: str) -> Stage:
        """Return what the law changes at a place."""
        return self.stage

    def changed(
        self,
        parts: ElasticComponents,
        geometry: Geometry,
        place: str,
        values: Mapping[str, float],
    ) -> ElasticComponents:
        """Return the elastic parts with the effect; only laws of the stage `parts` change them."""
        return parts

    def part_factor(self, values: Mapping[str, float]) -> float:
        """Return by how much a law of the stage `parts` scales the flexibility of its part."""
        return 1.0
