"""Which loads a user can put on the platform: read from a file, turned into wrenches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.mechanism.yaml_block import Block, read_yaml

SCHEMA = 1
KINDS = ("weight", "actuator")
FRAMES = ("wrist_base", "wrist_platform")


@dataclass(frozen=True, eq=False)
class AppliedLoad:
    """One load as it is put on.

    Parameters
    ----------
    name : str
        Of the weight or actuator; empty for no load.
    force, moment : (3,) float
        In U if it turns with the platform, else in F; the moment is about the point [N, N m].
    point : (3,) float
        Where the force acts, in U unless the actuator stands on the base [m].
    turns : bool
        Whether force and moment turn with the platform.
    point_turns : bool
        Whether the point moves with the platform.
    change_s : float
        Time that it takes to put it on or to take it off [s].
    """

    name: str
    force: Array
    moment: Array
    point: Array
    turns: bool
    point_turns: bool
    change_s: float

    def wrench(self, platform: Array) -> Array:
        """Return the wrench on the platform at O in F.

        Parameters
        ----------
        platform : (..., 3, 3) float
            Rotation U -> F.

        Returns
        -------
        (..., 6) float
            [N, N m]
        """
        shape = (*platform.shape[:-2], 3)
        force, moment = (
            platform @ vector if self.turns else np.broadcast_to(vector, shape)
            for vector in (self.force, self.moment)
        )
        arm = platform @ self.point if self.point_turns else np.broadcast_to(self.point, shape)
        return np.concatenate([force, moment + cross(arm, force)], axis=-1)


NO_LOAD = AppliedLoad("", np.zeros(3), np.zeros(3), np.zeros(3), False, False, 0.0)


@dataclass(frozen=True, eq=False)
class Weight:
    """A mass that hangs at a point of the platform: it pulls along gravity at every pose.

    Parameters
    ----------
    name : str
        What the user calls it.
    mass : float
        [kg]
    point : (3,) float
        Where it hangs, in U [m].
    change_s : float
        To put it on or take it off [s].
    """

    name: str
    mass: float
    point: Array
    change_s: float

    def draw(self, gravity: Array, rng: np.random.Generator) -> AppliedLoad:
        """Return the load; gravity (3,) in F [m/s^2].  A weight leaves nothing to draw."""
        force = self.mass * gravity
        return AppliedLoad(self.name, force, np.zeros(3), self.point, False, True, self.change_s)


@dataclass(frozen=True, eq=False)
class Actuator:
    """A gripper, a pusher: any force and moment between its limits.

    Parameters
    ----------
    name : str
        What the user calls it.
    lower, upper : (6,) float
        Limits of force and moment in the actuator's frame [N, N m].
    point : (3,) float
        Where the force acts, in the actuator's frame [m].
    on_platform : bool
        Whether it turns with the platform.
    change_s : float
        To change the load [s].
    """

    name: str
    lower: Array
    upper: Array
    point: Array
    on_platform: bool
    change_s: float

    def draw(self, gravity: Array, rng: np.random.Generator) -> AppliedLoad:
        """Return a load between the limits: half the time along one axis to its end, else any."""
        free = np.flatnonzero(self.upper > self.lower)
        wrench = rng.uniform(self.lower, self.upper)
        if len(free) and rng.uniform() < 0.5:
            axis = rng.choice(free)
            wrench = np.clip(0.0, self.lower, self.upper)
            wrench[axis] = rng.choice([self.lower[axis], self.upper[axis]])
        turns = self.on_platform
        return AppliedLoad(
            self.name, wrench[:3], wrench[3:], self.point, turns, turns, self.change_s
        )


Source = Weight | Actuator


def read_loads(path: str | Path, gravity: Array, force_limit: float) -> tuple[Source, ...]:
    """Read the loads that a user can apply.

    Parameters
    ----------
    path : path
        A YAML file.
    gravity : (3,) float
        In F [m/s^2].
    force_limit : float
        Largest force of the table [N].

    Returns
    -------
    tuple of Weight or Actuator
        Empty where the file lists none.

    Raises
    ------
    InputError
        If the file cannot be read, a key is missing, unknown or wrong, a name is there twice, or a
        force is beyond the table's range.
    """
    root = Block(read_yaml(path, InputError), str(path), InputError, sources=())
    schema = root.number("schema")
    if schema != SCHEMA:
        raise InputError(f"{path}.schema: {schema:g} is not {SCHEMA}, the version that is read")
    entries = root.take("loads")
    root.no_more_keys()
    if not isinstance(entries, list):
        raise InputError(f"{path}.loads: {entries!r} is not a list; write [] for none")
    sources: list[Source] = []
    for number, values in enumerate(entries):
        block = Block(values, f"{path}.loads[{number}]", InputError, sources=())
        weight = block.text("kind", KINDS) == "weight"
        source = _weight(block, gravity, force_limit) if weight else _actuator(block, force_limit)
        block.no_more_keys()
        if source.name in (known.name for known in sources):
            raise InputError(f"{block.place}.name: {source.name!r} is there twice")
        sources.append(source)
    return tuple(sources)


def _name(block: Block) -> str:
    name = block.text("name")
    if not name.strip():
        raise InputError(f"{block.place}.name: is empty")
    return name


def _weight(block: Block, gravity: Array, force_limit: float) -> Weight:
    weight = Weight(
        _name(block),
        block.number("mass_kg", above=0.0),
        block.vector("point_mm", 1e-3),
        block.number("change_s", at_least=0.0),
    )
    if (pull := weight.mass * float(np.linalg.norm(gravity))) > force_limit:
        raise InputError(
            f"{block.place}.mass_kg: {weight.mass:g} weighs {pull:.3g} N, "
            f"the table ends at {force_limit:g} N"
        )
    return weight


def _actuator(block: Block, force_limit: float) -> Actuator:
    name, frame = _name(block), block.text("frame", FRAMES)
    limits = [
        np.concatenate([block.vector(f"force_{end}_N"), block.vector(f"moment_{end}_Nm")])
        for end in ("min", "max")
    ]
    lower, upper = limits
    for place, kind in ((0, "force"), (3, "moment")):
        part = slice(place, place + 3)
        if np.any(lower[part] > upper[part]):
            raise InputError(
                f"{block.place}.{kind}_min: {lower[part].tolist()} exceeds "
                f"{kind}_max {upper[part].tolist()}"
            )
    if not np.any(lower) and not np.any(upper):
        raise InputError(f"{block.place}: {name} can apply neither a force nor a moment")
    reach = np.abs(np.concatenate([lower[:3], upper[:3]])).max()
    if reach > force_limit:
        raise InputError(
            f"{block.place}.force: {reach:g} N is beyond the table's {force_limit:g} N"
        )
    point, change_s = block.vector("point_mm", 1e-3), block.number("change_s", at_least=0.0)
    return Actuator(name, lower, upper, point, frame == "wrist_platform", change_s)
