"""The rigid wrist at given motor angles: its axes and how its bodies are turned."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import vee

BODIES = ("frame", "link_1", "link_2", "platform", "link_3")
"""Rigid bodies, in the order of `Configuration.bodies`."""

TURNING = {
    "joint_2": ("link_1", "platform"),
    "joint_3": ("link_3", "platform"),
    "joint_4": ("link_2", "link_3"),
}
"""Body on the motor side and on the platform side of each passive joint."""


@dataclass(frozen=True)
class Configuration:
    """The wrist at given motor angles, rigid, origin at O, everything in F."""

    theta: Array  # (..., 2), motor angles [rad]
    # `b`, `c`, `d`: (..., 3), unit axes of joint_2, joint_3 and joint_4
    b: Array
    c: Array
    d: Array
    singularity: Array  # (...), D = b . (d x c), zero where the platform gains a freedom (type 2)
    # (..., 3, 3), rows d x c, b x d and c x b over D, the basis dual to (b, c, d): they hold the
    # influence
    dual: Array
    bodies: Array  # (..., 5, 3, 3), rotation of each of `BODIES` from home
    if TYPE_CHECKING:
        row: ClassVar[Array]
        """The numbers of each pose, (..., 66)."""

    @classmethod
    def of_row(cls, row: Array) -> Configuration:
        """Return the configuration that the numbers (..., 66) of all fields, in order, stand for.

        Its fields are views, made where they are asked for: a stream needs few of them.
        """
        made = object.__new__(cls)
        vars(made)["row"] = row
        return made

    def __getattr__(self, name: str) -> Array:
        """Return a field of `of_row`, or the row of the fields."""
        if name == "row":
            shape = np.shape(self.singularity)
            parts = [np.reshape(getattr(self, each.name), (*shape, -1)) for each in fields(self)]
            value = np.concatenate(parts, axis=-1)
        elif name in _PLACES and "row" in vars(self):
            begin, end, shape = _PLACES[name]
            value = self.row[..., begin:end].reshape((*self.row.shape[:-1], *shape))
        else:
            raise AttributeError(name)
        vars(self)[name] = value
        return value

    @property
    def as_block(self) -> Configuration:
        """One pose as a stack of one."""
        return Configuration.of_row(self.row[None])

    @property
    def rotations(self) -> dict[str, Array]:
        """Rotation of each body from home by its name, (..., 3, 3)."""
        return {name: self.bodies[..., i, :, :] for i, name in enumerate(BODIES)}

    @property
    def platform(self) -> Array:
        """Rotation U -> F of the rigid platform, (..., 3, 3)."""
        return self.bodies[..., 3, :, :]

    def turn(self, joint: str, axis: Array) -> Array:
        """Turn of a passive joint from home, platform side against motor side, (...) [rad].

        `joint`: one of `TURNING`; `axis` (3,): of the joint at home.
        """
        before, after = (self.rotations[body] for body in TURNING[joint])
        relative = np.swapaxes(before, -1, -2) @ after
        about = vee(relative) @ axis
        return np.asarray(np.arctan2(about, np.trace(relative, axis1=-2, axis2=-1) - 1.0))


_SHAPES: dict[str, tuple[int, ...]] = {
    "theta": (2,),
    "b": (3,),
    "c": (3,),
    "d": (3,),
    "singularity": (),
    "dual": (3, 3),
    "bodies": (len(BODIES), 3, 3),
}
_ENDS = np.cumsum([int(np.prod(shape)) for shape in _SHAPES.values()]).tolist()
_PLACES = {
    name: (end - int(np.prod(shape)), end, shape)
    for (name, shape), end in zip(_SHAPES.items(), _ENDS, strict=True)
}
"""Where each field begins and ends in a row, and its shape."""
