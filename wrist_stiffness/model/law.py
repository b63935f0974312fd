"""What an effect is: a law that turns a block of samples and a state into a contribution."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array, ElasticComponents
from wrist_stiffness.mechanism.geometry import Geometry
from wrist_stiffness.model.columns import Recipe, tangents
from wrist_stiffness.model.contribution import NOTHING, Contribution, MissingSignalError
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

Stage = Literal["parts", "load", "geometry", "friction", "reaction", "sensor"]
STAGES: tuple[Stage, ...] = ("parts", "load", "geometry", "friction", "reaction", "sensor")
"""What a law changes, in the order of evaluation: elastic parts; wrenches on the bodies; screws and
gaps that no force decides; forces of joints that rub; screws and wrenches that follow the forces
through the components; what the pose sensor says."""


SIValues = Mapping[str, float]
"""Values of a law's parameters in SI units, by their full names."""

Outcome = tuple[Contribution, Any]
"""What a law adds, and its state for the next block."""


class Law:
    """A physical effect that may sit at one of several places.

    A law has no state of its own: what it must remember between blocks goes out as the state and
    comes back with the next block.  The state None means that nothing was before: the law starts
    settled under the first sample.

    Attributes
    ----------
    id : str
        Name in the model file.
    stage : str
        What it changes, one of `STAGES`.  Laws of `friction` are asked several times for a block,
        each time beside what all of them added the last time, and with a state of its own; one that
        adds `rubbing` finds its own force acting, any other one does not.
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
    constant : bool
        Whether it adds the same at every moment: a screw fixed in the body of its place, a wrench
        in F, gaps, X in F or Y in U.  Such effects are put together once for all samples.
    many_waves : bool
        Whether half a second of motion may go through more than one of its waves, so that no mean
        angle stands for what it did.
    own : tuple of Parameter
        Its parameters where they are the same at all places; else it overrides `parameters`.
    state_is_a_guess : bool
        Whether its state tells where the search for its answer begins, which changes the cost
        alone: it gets the state of the sample before, or what another model has at the same
        samples.  Such a state has `last`, what the next block gets of it, and `after(before)`, the
        same beginning with the past of another state: see `pin_rest.Rest`.
    rests_together : bool
        Whether its effects at several places act on each other, so that `together` advances them at
        once; of laws of the catalogue alone.
    smooth : bool
        Whether its columns show it as it is.  Not where it sticks, or where walls and flanges touch
        or do not: there a search tries the law itself.
    inexactness : float
        Share of its own effect by which it is wrong on a real machine (assumed), the same for units
        under like conditions: a second effect no larger than that is no evidence.
    tared : bool
        Whether a tare of the load sensor takes it away.
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
    constant: bool = False
    own: tuple[Parameter, ...]
    many_waves: bool = False
    state_is_a_guess: bool = False
    rests_together: bool = False
    smooth: bool = True
    inexactness: float = 0.1
    tared: bool = False
    file: Path | None = None

    @property
    def foreign(self) -> bool:
        """Whether the law is a user's own Python."""
        return not type(self).__module__.startswith("wrist_stiffness.model.")

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the parameters that the law has at a place."""
        return self.own

    def sized_by(self, place: str) -> tuple[str, ...]:
        """Return the parameters that may be large together, because the effect is: by default all.

        The others lie within their typical magnitudes, however large the effect is.
        """
        return tuple(each.key for each in self.parameters(place))

    def possible(self, values: Mapping[str, Array]) -> NDArray[np.bool_]:
        """Tell which of n sets of values, in SI units, a machine can have, (n,).

        By default all within the bounds of each parameter.
        """
        return np.ones(len(next(iter(values.values()))), dtype=bool)

    def linearised(self, place: str, signals: frozenset[str]) -> Recipe:
        """Return how the law becomes columns, and where a fit of it begins.

        By default the tangents of all parameters without a grid, at the points of the grids of the
        others.  `columns` has recipes for other laws.

        Parameters
        ----------
        place : str
            One of `places`.
        signals : frozenset of str
            Components with a thermometer.
        """
        return tangents(self.parameters(place))

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return what the effect adds at every sample of a block, and the state after it.

        A law without memory overrides `added` instead.

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
        return self.added(at, place, values), None

    def together(
        self,
        at: Situation,
        places: Sequence[str],
        values: Sequence[SIValues],
        states: Sequence[Any],
    ) -> list[Outcome]:
        """Return the same of effects at several places, which may act on each other."""
        return [self.advance(at, *own) for own in zip(places, values, states, strict=True)]

    def added(self, at: Situation, place: str, values: SIValues) -> Contribution:
        """Return the same of a law that remembers nothing."""
        return NOTHING

    def as_drawn(self, geometry: Geometry, place: str) -> Array:
        """Return how parameters scatter over wrists as a drawing allows them, (p, p).

        A covariance in typical magnitudes, which are the limits of the drawing.
        """
        return np.eye(len(self.parameters(place)))

    def stage_at(self, place: str) -> Stage:
        """Return what the law changes at a place."""
        return self.stage

    def of_measurement(self, place: str) -> bool:
        """Return whether it is in what sensors say of the motion; the wrist itself is right."""
        return self.stage_at(place) == "sensor"

    def changed(self, parts: ElasticComponents, place: str, values: SIValues) -> ElasticComponents:
        """Return the elastic parts with the effect; only laws of the stage `parts` change them."""
        return parts

    def load_share(self, values: SIValues) -> float | None:
        """Return the share of the said load that the law adds; None where it adds anything else."""
        return None


def require_id(name: str) -> None:
    """Refuse an id that cannot stand in NAME@COMPONENT, as arguments and reports have it.

    Raises `InputError` if it holds anything but letters, digits, '_', '-' and '.'.
    """
    if not re.fullmatch(r"[\w.-]+", name):
        raise InputError(f"effect {name!r}: a name has letters, digits, '_', '-' and '.' only")


__all__ = [
    "NOTHING",
    "STAGES",
    "Contribution",
    "Law",
    "MissingSignalError",
    "Outcome",
    "SIValues",
    "Situation",
    "Stage",
    "require_id",
]
