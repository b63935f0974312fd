"""Where pins come to rest in their play, when flanges may hold them off the wall.

Inside its play a pin is free, so a flange that touches pushes it away instead of being pressed by
it.  The ends of all pins find the least of a convex energy (load, walls, flanges) together, by
Newton's method with Armijo's rule:

    Phi(x) = -F x + sum over ends wall(|x_end|) + 1/2 lambda' A lambda
    0 <= lambda  perpendicular to  gap + B x + A lambda >= 0,       grad Phi = wall - F - B' lambda
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.contact import forces_of, solve_contacts

SMALL_FORCE = 1e-2
"""An end that carries less radial force than this does not reach its wall altogether [N]."""

OF_ALL = ("radial", "small_force")
"""Fields of `Play` that all samples share."""

WALL = 1e10
"""Stiffness of the walls [N/m]: 100 N press an end into one by 10 nm."""

FORCE_TOLERANCE = 1e-8
"""Force out of balance at which a pin rests, against the largest on it and 1 N."""

MAX_STEPS, MAX_HALVINGS = 100, 40
"""Of a search, and of a step (58,000 rests in case 1066 of `bench/hidden_effects/fresh.py` took
less than 30 steps each, five pins with a millimetre of play 58)."""

ARMIJO, ROUNDING = 1e-4, 1e-10
"""Armijo's rule, or Wolfe's for an energy that is as low but for so much (Hager and Zhang 2005)."""


@dataclass(frozen=True)
class Play:
    """Pins with e ends at n samples: of each pin the upper and the lower one."""

    radial: float | Array  # how far an end, or each (e,), may move from the middle [m], above 0
    force: Array  # (n, 2 e), radial force on each end with all flanges open [N]
    gap: Array  # (n, m), openings of the flange sectors with the pins in the middle [m]
    opening: Array  # (n, m, 2 e), B, what the ends' displacements open
    approach: Array  # (n, m, m), A, flexibility of the flanges [m/N]
    # an end that carries less does not reach its wall altogether [N]
    small_force: float = field(default=SMALL_FORCE, kw_only=True)

    def resting(self, near: Array | None = None) -> Array:
        """Return the displacements of the ends across their axes, (n, 2 e) [m].

        `near` (n, 2 e): where the search begins.  The energy is convex, so it changes the cost and
        not the result beyond rounding [m].
        """
        new = self._unlike_the_one_before()
        if not new.all():
            # A rest is told by many samples.
            once = self.take(new).resting(None if near is None else near[new])
            return np.asarray(once[np.cumsum(new) - 1])
        return self._resting(near)

    def _resting(self, near: Array | None) -> Array:
        """Return the same, every sample on its own."""
        x = self._unhindered()
        gap = self.gap + (self.opening @ x[..., None])[..., 0]
        held = np.flatnonzero((gap < 0.0).any(axis=1))
        if len(held):
            x[held] = self.take(held)._hindered(x[held] if near is None else near[held])
        return x

    def softness(self, x: Array) -> Array:
        """Return how pins at x give way to further forces on their ends, (n, 2 e, 2 e) [m/N]."""
        active = self._state(x, None)[2]
        return np.asarray(np.linalg.inv(Play._hessian(self, x, active)))

    def _unlike_the_one_before(self) -> NDArray[np.bool_]:
        """Tell which samples differ from the one before in anything, (n,)."""
        new = np.zeros(len(self.force), dtype=bool)
        new[:1] = True
        for each in self._of_samples.values():
            flat = each.reshape(len(new), -1)
            new[1:] |= (flat[1:] != flat[:-1]).any(axis=1)
        return new

    def _hindered(self, begin: Array) -> Array:
        """Return where the ends rest against walls and flanges, from a first guess (n, 2 e).

        Steps are bent along the walls: straight ones would run into them.
        """
        x, rows, left = begin.copy(), np.arange(len(begin)), self
        energy, gradient, active = self._state(x, None)
        slopes, touching = gradient.copy(), active.copy()
        for _ in range(MAX_STEPS):
            bound = FORCE_TOLERANCE * (1.0 + np.abs(left.force).max(axis=1))
            moving = np.abs(gradient).max(axis=1) > bound
            if not moving.any():
                break
            if not moving.all():
                rows, left = rows[moving], left.take(moving)
                energy, gradient, active = energy[moving], gradient[moving], active[moving]
            step = left._step(x[rows], gradient, active)
            slope = np.einsum("ni,ni->n", gradient, step)
            as_much = ROUNDING * np.abs(left.force * x[rows]).sum(axis=1)
            start, size, far = energy.copy(), np.ones(len(rows)), np.arange(len(rows))
            tried = np.empty_like(step)
            depth = np.linalg.norm(_ends(gradient), axis=-1) / WALL
            for halved in range(MAX_HALVINGS):
                size[far] *= 0.5 if halved else 1.0
                part = left if len(far) == len(rows) else left.take(far)
                tried[far] = part._along(x[rows[far]], size[far, None] * step[far], depth[far])
                energy[far], gradient[far], active[far] = part._state(tried[far], active[far])
                # Of terms that nearly cancel little more than rounding is left; slopes tell then.
                there = np.einsum("ni,ni->n", gradient[far], step[far])
                less = energy[far] <= (start + ARMIJO * size * slope)[far]
                as_low = energy[far] <= (start + as_much)[far]
                far = far[~(less | as_low & (there <= (2.0 * ARMIJO - 1.0) * slope[far]))]
                if len(far) == 0:
                    break
            x[rows], slopes[rows], touching[rows] = tried, gradient, active
        # One more step, so that no trace of the way is left.
        return x + self._step(x, slopes, touching)

    def _step(self, x: Array, gradient: Array, active: NDArray[np.bool_]) -> Array:
        """Return Newton's step, (n, 2 e)."""
        hessian = self._hessian(x, active)
        return np.asarray(np.linalg.solve(hessian, -gradient[..., None])[..., 0], dtype=float)

    def _along(self, x: Array, step: Array, depth: Array) -> Array:
        """Return where a step leads, (n, 2 e), with ends as far in their walls as it says.

        Ends off their walls, of which it knows nothing, go into them by at most `depth` (n, e).
        """
        size, into, direction = self._at_walls(x)
        outward = size + (direction * _ends(step)).sum(axis=-1)
        most = np.where(into > 0.0, np.maximum(outward, 0.5 * self.radial), self.radial + depth)
        ends = _ends(x + step)
        length = np.linalg.norm(ends, axis=-1)
        share = np.divide(most, length, out=np.ones_like(length), where=length > most)
        return (share[..., None] * ends).reshape(x.shape)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Return some of the samples."""
        chosen: dict[str, Any] = {name: each[rows] for name, each in self._of_samples.items()}
        return replace(self, **chosen)

    @property
    def _of_samples(self) -> dict[str, Array]:
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in OF_ALL}

    @property
    def _centring(self) -> Array:
        return np.asarray(self.small_force / self.radial)

    def _unhindered(self) -> Array:
        """Return the displacements with all flanges open: along the forces."""
        ends = _ends(self.force)
        size = np.linalg.norm(ends, axis=-1)
        pressed = self.radial + (size - self.small_force) / (self._centring + WALL)
        moved = np.where(size < self.small_force, size / self._centring, pressed)[..., None]
        size = size[..., None]
        direction = np.divide(ends, size, out=np.zeros_like(ends), where=size > 0.0)
        return (moved * direction).reshape(self.force.shape)

    def _state(
        self, x: Array, guess: NDArray[np.bool_] | None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return energy (n,), its gradient (n, 2 e) and the touching sectors at displacements x."""
        gap = self.gap + (self.opening @ x[..., None])[..., 0]
        flange, active = solve_contacts(self.approach, gap, guess)
        size, into, direction = self._at_walls(x)
        wall = self._centring[..., None] * _ends(x) + WALL * into[..., None] * direction
        pressed = 0.5 * (self._centring * size**2 + WALL * into**2).sum(axis=1)
        bent = 0.5 * np.einsum("ni,nij,nj->n", flange, self.approach, flange)
        pushed = (np.swapaxes(self.opening, -1, -2) @ flange[..., None])[..., 0]
        energy = pressed + bent - np.einsum("ni,ni->n", self.force, x)
        return energy, wall.reshape(x.shape) - self.force - pushed, active

    def _hessian(self, x: Array, active: NDArray[np.bool_]) -> Array:
        opened = np.swapaxes(self.opening, -1, -2)
        hessian: Array = -forces_of(self.approach, opened, active) @ self.opening
        size, into, direction = self._at_walls(x)
        along = direction[..., :, None] * direction[..., None, :]
        share = np.divide(into, size, out=np.zeros_like(into), where=size > 0.0)
        normal = np.where(into > 0.0, WALL, 0.0)[..., None, None] * along
        across = WALL * share[..., None, None] * (np.eye(2) - along)
        blocks = self._centring[..., None, None] * np.eye(2) + across + normal
        for end in range(blocks.shape[1]):
            own = slice(2 * end, 2 * end + 2)
            hessian[:, own, own] += blocks[:, end]
        return hessian

    def _at_walls(self, x: Array) -> tuple[Array, Array, Array]:
        """Return how far each end is off the middle, how far in its wall, and its direction."""
        ends = _ends(x)
        size = np.linalg.norm(ends, axis=-1)
        direction = np.divide(
            ends, size[..., None], out=np.zeros_like(ends), where=size[..., None] > 0.0
        )
        return size, np.maximum(size - self.radial, 0.0), direction


def _ends(x: Array) -> Array:
    """Return vectors (n, 2 e) by the ends, (n, e, 2)."""
    return x.reshape(len(x), x.shape[1] // 2, 2)
