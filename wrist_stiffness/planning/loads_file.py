"""Which loads a user can put on the platform: read from a file, turned into wrenches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.inputs.document import Node, read_yaml
from wrist_stiffness.inputs.schema import (
    Keys,
    Quantity,
    list_of,
    mapping_of,
    number,
    record,
    text,
    vector,
    version,
)
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import cross

SCHEMA = 1
KINDS = ("weight", "actuator")
FRAMES = ("wrist_base", "wrist_platform")


@dataclass(frozen=True, eq=False)
class AppliedLoad:
    """One load as it is put on."""

    name: str  # of the weight or actuator; empty for no load
    # `force`, `moment`: (3,), in U if it turns with the platform, else in F; the moment is about
    # the point [N, N m]
    force: Array
    moment: Array
    point: Array  # (3,), where the force acts, in U unless the actuator stands on the base [m]
    turns: bool  # whether force and moment turn with the platform
    point_turns: bool  # whether the point moves with the platform
    change_s: float  # time that it takes to put it on or to take it off [s]

    def wrench(self, platform: Array) -> Array:
        """Return the wrench at O in F, (..., 6) [N, N m], for rotations U -> F (..., 3, 3)."""
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
    """A mass that hangs at a point of the platform: it pulls along gravity at every pose."""

    name: str  # what the user calls it
    mass: float  # [kg]
    point: Array  # (3,), where it hangs, in U [m]
    change_s: float  # to put it on or take it off [s]

    def draw(self, gravity: Array, rng: np.random.Generator) -> AppliedLoad:
        """Return the load; gravity (3,) in F [m/s^2].  A weight leaves nothing to draw."""
        force = self.mass * gravity
        return AppliedLoad(self.name, force, np.zeros(3), self.point, False, True, self.change_s)


@dataclass(frozen=True, eq=False)
class Actuator:
    """A gripper, a pusher: any force and moment between its limits."""

    name: str  # what the user calls it
    # `lower`, `upper`: (6,), limits of force and moment in the actuator's frame [N, N m]
    lower: Array
    upper: Array
    point: Array  # (3,), where the force acts, in the actuator's frame [m]
    on_platform: bool  # whether it turns with the platform
    change_s: float  # to change the load [s]

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
    """Read the loads that a user can apply; none where the file lists none.

    `gravity` (3,): in F [m/s^2]; `force_limit`: largest force of the table [N].  Raises
    `InputError` if the file cannot be read, a key is missing, unknown or wrong, a name is there
    twice, or a force is beyond the table's range.
    """
    root = read_yaml(path, InputError)
    sources: list[Source] = []
    for node in LOADS(root)["loads"]:
        source = _source(node, gravity, force_limit)
        if source.name in (known.name for known in sources):
            raise node["name"].refuse(f"{source.name!r} is there twice")
        sources.append(source)
    return tuple(sources)


def _name(node: Node) -> str:
    name = text()(node)
    if not name.strip():
        raise node.refuse("is empty")
    return name


def _weight(kind: str, **values: Any) -> Weight:
    return Weight(**values)


def _actuator(
    kind: str, name: str, frame: str, point: Array, change_s: float, **ends: Array
) -> Actuator:
    lower, upper = (
        np.concatenate([ends[f"force_{end}"], ends[f"moment_{end}"]]) for end in ("min", "max")
    )
    return Actuator(name, lower, upper, point, frame == "wrist_platform", change_s)


COMMON: Keys = {
    "kind": text(*KINDS),
    "name": _name,
    "point_mm": Quantity(vector()),
    "change_s": number(at_least=0.0),
}
WEIGHT = record({**COMMON, "mass_kg": Quantity(number(above=0.0))}, make=_weight)
ACTUATOR = record(
    {
        **COMMON,
        "frame": text(*FRAMES),
        **dict.fromkeys(
            ("force_min_N", "force_max_N", "moment_min_Nm", "moment_max_Nm"), Quantity(vector())
        ),
    },
    make=_actuator,
)
LOADS = record({"schema": version(SCHEMA), "loads": list_of(lambda node: node)})


def _source(node: Node, gravity: Array, force_limit: float) -> Source:
    # Which keys a load has depends on one of them.
    kind = mapping_of(lambda inner: inner.value)(node).get("kind")
    if kind != "actuator":
        weight = WEIGHT(node)
        if (pull := weight.mass * float(np.linalg.norm(gravity))) > force_limit:
            raise node["mass_kg"].refuse(
                f"{weight.mass:g} weighs {pull:.3g} N, the table ends at {force_limit:g} N"
            )
        return weight
    actuator = ACTUATOR(node)
    lower, upper = actuator.lower, actuator.upper
    for part, key, unit in ((slice(0, 3), "force", "N"), (slice(3, 6), "moment", "Nm")):
        if np.any(lower[part] > upper[part]):
            raise node[f"{key}_min_{unit}"].refuse(
                f"{lower[part].tolist()} exceeds {key}_max_{unit} {upper[part].tolist()}"
            )
    if not np.any(lower) and not np.any(upper):
        raise node.refuse(f"{actuator.name} can apply neither a force nor a moment")
    reach = np.abs(np.concatenate([lower[:3], upper[:3]])).max()
    if reach > force_limit:
        raise node.refuse(f"{reach:g} N is beyond the table's {force_limit:g} N")
    return actuator
