"""Where the pins of joints rest in their play: among flanges, and held by joints that rub.

A joint that sticks holds a pin off its wall, for the pin cannot move without the joint's slide and
turn.  What the bristles of that joint hold, slip included, has a convex energy, so the pin rests
where it and the energy of walls and flanges are least together.  Budget and feet of the bristles
depend on where the pin rests in turn; they follow in passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import ELASTIC, PASSIVE_JOINTS, Array
from wrist_stiffness.model.contribution import NOTHING, Contribution
from wrist_stiffness.model.pin_play import Play
from wrist_stiffness.model.places import end_screws
from wrist_stiffness.model.rubbing import Rubbing, dragged, slip
from wrist_stiffness.model.situation import Situation

PASSES = 4
"""In which a pin and the joints that rub find each other.  Each pass has a history of its own, so
any blocks give the same."""


@dataclass(frozen=True)
class Rest:
    """Where a pin rested at n samples."""

    # (n, 4), of one pin with nothing that rubs, in units of the play; where a search may begin
    ends: Array
    # (PASSES, j, 2), where the bristles of j joints that rub stand after the last sample, in each
    # pass [m]
    feet: Array | None = None

    @property
    def last(self) -> Rest:
        """What the next block gets."""
        return replace(self, ends=self.ends[-1:])

    def after(self, before: Rest | None) -> Rest:
        """Return where to begin to look, with the past of another one."""
        return replace(self, feet=None if before is None else before.feet)


@dataclass(frozen=True)
class HeldPlay(Play):
    """Pins that cannot move without j joints that rub."""

    bent: Array  # (n, j, 2), from the bristles' feet to the surface, with the pin in the middle [m]
    drag: Array  # (n, j, 2, 2 e), what the ends' displacements add to it
    compliance: Array  # (n, j, 2), of the bristles [m/N]
    budget: Array  # (n, j), their largest force [N]

    def held(self, x: Array) -> tuple[Array, Array, Array]:
        """Return energy (n, j), forces (n, j, 2), stiffness (n, j, 2, 2) of the bristles."""
        return dragged(self.bent + _dragged_by(self.drag, x), self.compliance, self.budget)

    def _resting(self, near: Array | None) -> Array:
        x = self._hindered(self._unhindered() if near is None else near)
        # Bristles that slip are less straight than flanges: a step more leaves no trace of the way.
        return x + self._step(x, *self._state(x, None)[1:])

    def _state(
        self, x: Array, guess: NDArray[np.bool_] | None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        energy, gradient, active = super()._state(x, guess)
        own, force, _ = self.held(x)
        return energy + own.sum(axis=1), gradient + _on_ends(self.drag, force), active

    def _hessian(self, x: Array, active: NDArray[np.bool_]) -> Array:
        bristles = np.swapaxes(self.drag, -1, -2) @ self.held(x)[2] @ self.drag
        whole: Array = super()._hessian(x, active) + bristles.sum(axis=1)
        return whole


@dataclass(frozen=True, eq=False)
class Pins:
    """The p pins with play in a situation."""

    at: Situation  # n samples
    places: Sequence[str]
    radial: Array  # (p,), how far an end may move from the middle [m], above 0

    def rest(self, before: Sequence[Rest | None]) -> list[tuple[Contribution, Rest]]:
        """Return what the play of each adds, and where it rests.

        `before`: of the block before, with a place for the search to begin.
        """
        known = [each for each in before if each is not None]
        near, feet = None, known[0].feet if known else None
        if all(each is not None and len(each.ends) == len(self.at.block) for each in before):
            # In units of the play: with a little more of it the pin rests at its wall still.
            near = self._ends_scale * np.concatenate([each.ends for each in known], axis=1)
        x = self._free.resting(near)
        if self.at.given.rubbing is None:
            moved, more = x, NOTHING
        else:
            moved, more, feet = self._held(x, feet)
        # What joints that rub do besides is told with the first pin.
        screws = self._screws(moved)
        screws[0] = more + screws[0]
        ends = np.split(x / self._ends_scale, len(self.places), axis=1)
        return [(screw, Rest(each, feet)) for screw, each in zip(screws, ends, strict=True)]

    def _held(self, x: Array, before: Array | None) -> tuple[Array, Contribution, Array]:
        """Return where the held pins rest, how the joints that rub push more, and their feet.

        `x` (n, 4 p): where they would rest if nothing rubbed [m]; `before` (PASSES, j, 2): feet
        before the first sample [m].
        """
        at, rubbing = self.at, self.at.given.rubbing
        drag = np.stack([self._drag(each) for each in rubbing], axis=1)
        force = known = np.stack([np.asarray(each.force) for each in rubbing], axis=1)
        more, feet = NOTHING, []
        for number in range(PASSES):
            rubbed = at.with_more(more)
            loose = rubbed.with_more(sum(self._screws(x), NOTHING))
            surface = _dragged_by(drag, x)
            bristles = [
                replace(each, force=force[:, j]).bristles(loose) for j, each in enumerate(rubbing)
            ]
            moved = np.stack([each.moved for each in bristles], axis=1)
            # The pin's tilt; slides are told with it.
            moved[..., 0] += surface[..., 0]
            if before is None:
                # Settled under the first sample.
                before = np.tile(moved[0], (PASSES, 1, 1))
            free = replace(self, at=rubbed)._free
            give = drag @ free.softness(x)[:, None] @ np.swapaxes(drag, -1, -2)
            yielding = moved + (give @ force[..., None])[..., 0]
            stood = [
                slip(replace(each, moved=yielding[:, j]), before[number, j], give[:, j])[1]
                for j, each in enumerate(bristles)
            ]
            feet.append([each[-1] for each in stood])
            held = HeldPlay(
                free.radial,
                free.force + _on_ends(drag, force),
                free.gap,
                free.opening,
                free.approach,
                moved - surface - np.stack([each[:-1] for each in stood], axis=1),
                drag,
                np.stack([each.compliance for each in bristles], axis=1),
                np.stack([each.budget for each in bristles], axis=1),
            )
            x = held.resting(x)
            force = held.held(x)[1]
            pushes = (each.push(at, force[:, j] - known[:, j]) for j, each in enumerate(rubbing))
            more = sum(pushes, NOTHING)
        return x, more, np.array(feet)

    def _screws(self, x: Array) -> list[Contribution]:
        geometry, every = self.at.table.geometry, np.split(x, len(self.places), axis=1)
        return [
            self.at.screw(place, own @ end_screws(geometry, place))
            for place, own in zip(self.places, every, strict=True)
        ]

    @property
    def _ends_scale(self) -> Array:
        return np.repeat(self.radial, 4)

    @property
    def _free(self) -> Play:
        """The play with what is in the situation, and nothing that holds it but flanges."""
        at = self.at
        opening, carried = [], []
        for place in self.places:
            ends = end_screws(at.table.geometry, place)
            opening += [at.carried(at.screw(place, end))[1] for end in ends]
            carried.append(at.at_home(place, at.through_place(place)) @ ends.T)
        opens = np.stack(opening, axis=-1)
        flanges = (np.swapaxes(opens, -1, -2) @ at.contact_force[..., None])[..., 0]
        gap, approach = at.free[1], at.operators.approach
        force = np.concatenate(carried, axis=1) - flanges
        return Play(np.repeat(self.radial, 2), force, gap, opens, approach)

    def _drag(self, rubbing: Rubbing) -> Array:
        """Return how a joint turns (radius times angle) and slides with the pins' ends."""
        at, joint = self.at, PASSIVE_JOINTS.index(rubbing.joint)
        rows = at.influence.slides()[..., joint, :]
        radius, turn, slide = rubbing.radius(at.table.geometry), [], []
        for place in self.places:
            row = rows[:, ELASTIC.index(place)]
            ends = [at.in_base(place, end) for end in end_screws(at.table.geometry, place)]
            slide += [(row * end[:, :3]).sum(axis=1) for end in ends]
            turn += [(row * end[:, 3:]).sum(axis=1) for end in ends]
        return np.stack([radius * np.stack(turn, axis=1), np.stack(slide, axis=1)], axis=1)


def _dragged_by(drag: Array, x: Array) -> Array:
    """Return how far surfaces go (n, j, 2) with the ends of pins (n, 2 e)."""
    return np.asarray((drag @ x[:, None, :, None])[..., 0])


def _on_ends(drag: Array, force: Array) -> Array:
    """Return what forces (n, j, 2) on bristles are at the ends of pins, (n, 2 e)."""
    return np.asarray((np.swapaxes(drag, -1, -2) @ force[..., None])[..., 0].sum(axis=1))
