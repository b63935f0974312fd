"""How probable a set of effects is, given a table: one marginal likelihood for every question.

Residuals r, whitened to N numbers of unit scatter, are linear in all that is unknown about the
point z0 where a fit ended:

    r + J (z - z0) + F b = noise,   noise ~ N(0, v),   z ~ prior,   b ~ N(0, a_g^2)

J holds set-up, tolerances and effects; F what has no name: the slow drift of an instrument, and the
discrepancy of the model over the conditions (Kennedy and O'Hagan 2001).  The amplitudes a_g of its
groups and the excess scatter v are those of the largest evidence (MacKay 1992); everything else is
integrated (Laplace's method, exact where a law is linear).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dpotri, dtrtri
from scipy.special import gammaln

from wrist_stiffness.inference.giving import SPREAD, Give
from wrist_stiffness.inference.point import Background, Group, Point
from wrist_stiffness.inference.possible import TAIL, Possible, within_bounds
from wrist_stiffness.inference.projection import NEGLIGIBLE

Array = NDArray[np.float64]

MISFIT = 0.05
"""Prior probability that units scatter more than is known of their noise (assumed)."""

MOST_MISFIT = 3.0
"""Standard deviation of the logarithm of that excess variance (assumed)."""

SURE_OF_NOISE = 3.0
"""Widths by which noise may be more than is known of it; beyond, it is a misfit."""

SURPRISE = 2.0
"""Standard deviations of the logarithm of a drift's amplitude that no instrument reaches, but one
of 40."""

LEAST_PRIOR = 1e-12
"""Least precision of a prior as a share of the information: what the data cannot tell apart stays
solvable in the rounding of numbers."""

OFF = 1e-3
"""Amplitude of a group that is absent, in scatters of a unit."""


def log_size_prior(square: Any, count: int) -> Any:
    """Return the log density of an effect's `count` unknowns whose squares sum up to `square`."""
    density = gammaln(0.5 * (TAIL + count)) - gammaln(0.5 * TAIL)
    density -= 0.5 * count * np.log(TAIL * np.pi)
    return density - 0.5 * (TAIL + count) * np.log1p(square / TAIL)


def size_weight(square: Any, count: int) -> Any:
    """Return the square of the Gaussian weight that has the slope of that prior."""
    return (TAIL + count) / (TAIL + square)


@dataclass(frozen=True, eq=False)
class Evidence:
    """A set of effects at its best amplitudes."""

    point: Point  # where its fit ended
    background: Background  # of the table
    amplitude: Array  # (g,), of the groups
    # variance of what is left of each number once everything is explained, in units of its known
    # noise
    excess: float

    @cached_property
    def _known(self) -> tuple[Array, Array, float]:
        """Products of all columns, those with what is left, and its square."""
        point, ground = self.point, self.background
        target = point.products(ground, point.left)
        return point.gram(ground), target, float(point.left @ point.left)

    @cached_property
    def _priors(self) -> tuple[Array, Array, float]:
        """Precision and offset of what has a name, and by how much no Gaussian is its prior."""
        point = self.point
        extra = point.inexact.shape[1]
        precision = np.concatenate([point.weight**2, np.ones(extra)])
        offset = np.concatenate([point.z, np.zeros(extra)])
        correction = 0.0
        for places in point.sized.values():
            count, square = len(places), float(np.sum(point.z[places] ** 2))
            own = size_weight(square, count)
            precision[places] = own
            gaussian = 0.5 * (count * np.log(own / (2.0 * np.pi)) - own * square)
            correction += log_size_prior(square, count) - gaussian
        return precision, offset, correction

    @cached_property
    def precision(self) -> Array:
        """Precision of the priors of all columns."""
        return np.concatenate([self._priors[0], 1.0 / self.amplitude[self.background.group] ** 2])

    @cached_property
    def _solved(self) -> tuple[Array, Array, Array, Array]:
        """Scaled Cholesky factor of the information, the scales, the step, and the slope."""
        gram, target, _ = self._known
        precision, offset, _ = self._priors
        information = gram / self.excess
        information[np.diag_indices_from(information)] += self.precision
        slope = target / self.excess
        slope[: len(offset)] += precision * offset
        scale = 1.0 / np.sqrt(np.diag(information))
        factor = _factor(information * scale[:, None] * scale)
        step = -scale * cho_solve((factor, True), scale * slope, check_finite=False)
        return factor, scale, step, slope

    @cached_property
    def log(self) -> float:
        """Natural logarithm of the evidence, up to what all sets of a table share."""
        return self.unbounded + sum(
            self.point.possible[name].gain(self.point.z[own] + self.step[own], self._about(own))
            for name, own in self.point.effects.items()
            if name in self.point.possible
        )

    def _about(self, places: NDArray[np.intp]) -> Array:
        """Covariance of some unknowns, (k, k)."""
        factor, scale, _, _ = self._solved
        unit = np.zeros((len(scale), len(places)))
        unit[places, np.arange(len(places))] = scale[places]
        half = solve_triangular(factor, unit, lower=True, check_finite=False)
        return np.asarray(half.T @ half)

    @cached_property
    def unbounded(self) -> float:
        """The same if every value of the unknowns were possible."""
        factor, scale, step, slope = self._solved
        precision, offset, correction = self._priors
        n, ground = self.point.count, self.background
        cost = self._known[2] / self.excess + float(precision @ offset**2 + slope @ step)
        volume = 2.0 * float(np.sum(np.log(np.diag(factor))) - np.sum(np.log(scale)))
        log = -0.5 * (n * np.log(self.excess) + cost + volume - np.sum(np.log(self.precision)))
        log += correction + log_excess(np.array([self.excess]), ground.noise_width)[0]
        for size, group, count in zip(self.amplitude, ground.groups, ground.sizes, strict=True):
            log += log_amplitude(float(size), group, int(count))
        log += ground.log_odds * np.count_nonzero(ground.optional & (self.amplitude > OFF))
        return float(log)

    @cached_property
    def attainable(self) -> float:
        """Log evidence if the set left noise alone, beside drift as it is known."""
        usual = beside_known(self.point, self.background.whole or self.background)
        precision, offset, _ = usual._priors
        _, _, step, slope = usual._solved
        cost = usual._known[2] + float(precision @ offset**2 + slope @ step)
        return usual.unbounded + 0.5 * (cost - self.point.count)

    def cost(self, point: Point) -> float:
        """Return minus twice the log posterior of a point, up to what all points share.

        What has no name is integrated, at the amplitudes and with the law errors of this set.

        `point`: like this one's, anywhere.
        """
        p = len(self.point.z)
        information = self._known[0][p:, p:] / self.excess + np.diag(self.precision[p:])
        target = self.point.products(self.background, point.left)[p:] / self.excess
        cost = float(point.left @ point.left) / self.excess
        cost += float(np.sum((point.weight * point.z) ** 2))
        cost -= float(target @ np.linalg.solve(information, target))
        for places in point.sized.values():
            square = float(np.sum(point.z[places] ** 2))
            cost -= float(np.sum((point.weight[places] * point.z[places]) ** 2))
            cost -= 2.0 * log_size_prior(square, len(places))
        return cost

    @cached_property
    def covariance_of_fit(self) -> Array:
        """Covariance (p, p) of unknowns that were fitted beside noise and drift as they are known.

        What is known of them once all amplitudes are found, a discrepancy included (White 1980).
        """
        p, known = len(self.point.z), known_noise(self.point, self.background)
        named, prior = self.point.columns, np.diag(np.sqrt(self.precision[:p]))
        beside = np.hstack([self.point.inexact, self.background.columns])
        own = np.hstack([known.point.inexact, known.background.columns])
        # Squares of what lies far above the noise would drown the priors: so their roots are taken.
        apart = np.diag(np.sqrt(np.concatenate([known.precision[p:], self.precision[:p]])))
        rows = np.vstack([np.hstack([own, named]), apart])
        q = own.shape[1]
        root = np.asarray(np.linalg.qr(rows, mode="r"))[q:, q:]
        # Columns by the inverse of the known covariance (Woodbury).
        inner = own.T @ own + np.diag(known.precision[p:])
        weighted = named - own @ np.linalg.solve(inner, own.T @ named)
        mixed = beside.T @ weighted / np.sqrt(self.precision[p:])[:, None]
        filling = np.vstack([np.sqrt(self.excess) * weighted, prior, mixed])
        half = solve_triangular(root, solve_triangular(root, filling.T, trans="T"))
        return np.asarray(half @ half.T)

    @property
    def step(self) -> Array:
        """Most probable change of the unknowns (p,) from where the fit ended."""
        return self._solved[2][: self.point.columns.shape[1]]

    @property
    def given(self) -> dict[Give, tuple[float, float]]:
        """By how much laws give, with one standard uncertainty."""
        first = len(self.point.z)
        sigma = np.sqrt(np.diag(self.covariance))
        return {
            give: (SPREAD * float(self._solved[2][place]), SPREAD * float(sigma[place]))
            for place, give in enumerate(self.point.gives, first)
        }

    @property
    def unnamed(self) -> Array:
        """Most probable values of the columns of the background, (q,)."""
        return self._solved[2][len(self._priors[0]) :]

    @cached_property
    def covariance(self) -> Array:
        """Covariance of all unknowns, those without a name included."""
        factor, scale, _, _ = self._solved
        if not len(scale):
            return np.zeros((0, 0))
        lower, _ = dpotri(factor, lower=1)
        whole = np.tril(lower) + np.tril(lower, -1).T
        return np.asarray(whole * scale[:, None] * scale)

    @cached_property
    def variances(self) -> Array:
        """Diagonal of that covariance, in half the time."""
        factor, scale, _, _ = self._solved
        if not len(scale):
            return np.zeros(0)
        inverse, _ = dtrtri(factor, lower=1)
        return np.asarray(np.sum(np.tril(inverse) ** 2, axis=0) * scale**2)

    @cached_property
    def average_information(self) -> Array:
        """Average of observed and expected information of the logarithms of amplitudes, (g, g)."""
        gram, ground, (factor, scale, _, _) = self._known[0], self.background, self._solved
        values = np.zeros((len(gram), len(ground.groups)))
        own = len(gram) - len(ground.group)
        values[np.arange(own, len(gram)), ground.group] = self.unnamed
        products = gram @ values
        beside = solve_triangular(factor, scale[:, None] * products, lower=True, check_finite=False)
        squares = values.T @ products - beside.T @ beside / self.excess
        return np.asarray(2.0 * squares / self.excess)

    @cached_property
    def square(self) -> float:
        """Sum of squares of what is left when everything is explained."""
        gram, target, own = self._known
        step = self._solved[2]
        return float(own + 2.0 * target @ step + step @ gram @ step)

    @cached_property
    def _beyond(self) -> Array:
        """Products (q, q) of what of the background's columns what has a name could not take up."""
        ground = self.background
        own = len(self.precision) - len(ground.group)
        gram = self._known[0]
        information = gram[:own, :own] + np.diag(self.excess * self.precision[:own])
        scale = 1.0 / np.sqrt(np.diag(information))
        factor = _factor(information * scale[:, None] * scale)
        mixed = scale[:, None] * gram[:own, own:]
        taken = solve_triangular(factor, mixed, lower=True, check_finite=False)
        return np.asarray(ground.gram - taken.T @ taken)

    @cached_property
    def energies(self) -> Array:
        """Sum of squares that each group explains beyond what has a name, (g,)."""
        ground, b = self.background, self.unnamed
        parts = [ground.group == number for number in range(len(ground.groups))]
        return np.array([float(b[on] @ self._beyond[np.ix_(on, on)] @ b[on]) for on in parts])

    @cached_property
    def discrepant(self) -> NDArray[np.bool_]:
        """Which groups say that the model is wrong, (g,).

        Those of the discrepancy that are there, and a drift far beyond that of such an instrument.
        """
        found = []
        for size, group in zip(self.amplitude, self.background.groups, strict=True):
            if group.expected:
                found.append(np.log(size / group.expected) > SURPRISE * group.width)
            else:
                found.append(size > OFF)
        return np.array(found, dtype=bool)

    @cached_property
    def unexplained(self) -> float:
        """Sum of squares that neither what has a name nor the noise explains.

        Only what nothing in the set could take up counts: columns without a name are free to cancel
        what a set-up does.
        """
        ground = self.background
        on = self.discrepant[ground.group]
        b = np.where(on, self.unnamed, 0.0)
        smooth = max(float(b @ self._beyond @ b), 0.0) if on.any() else 0.0
        return smooth + self.misfit * self.point.count

    def left_of(self, quantity: str, rows: NDArray[np.bool_]) -> float:
        """Return the variance of a quantity that is not explained, in units of its known noise.

        `quantity`: name of a quantity of the table; `rows` (N,): its measured numbers.
        """
        own = [each.quantity == quantity for each in self.background.groups]
        parts = self.energies * self.discrepant
        share = float(parts[own].sum() / parts.sum()) if parts.any() else 0.0
        smooth = self.unexplained - self.misfit * self.point.count
        scatter = 0.0
        if self.misfit:
            # There is one excess for all quantities; what is left of each says whose it is.
            square = self._left**2
            scatter = max(self.excess * square[rows].mean() / square.mean() - self.noise, 0.0)
        return smooth * share / np.count_nonzero(rows) + scatter

    @cached_property
    def _left(self) -> Array:
        """What is left of each number once everything is explained, (N,)."""
        point, step = self.point, self._solved[2]
        columns = [point.columns, point.inexact, self.background.columns]
        return np.asarray(point.left + np.concatenate(columns, axis=1) @ step)

    @property
    def noise(self) -> float:
        """Variance of the noise in units of the known one: the excess, where it is no misfit."""
        known = SURE_OF_NOISE * self.background.noise_width
        return self.excess if np.log(self.excess) <= known else 1.0

    @property
    def misfit(self) -> float:
        """Excess of the scatter that no wrongly known noise explains."""
        return self.excess - self.noise

    def rest(self, name: str) -> float:
        """Return how much of an effect is left in its own shape, 0 where its law is right.

        Sum of squares above the noise that the same effect, its size changing with the conditions,
        would still explain where the laws are as wrong as they may be, over that of the effect
        itself; both beyond what everything else with a name could take up.

        `name`: of an effect of the set.
        """
        point, places = self.point, self.point.effects[name]
        wrong = self._solved[2][len(point.z) : len(self._priors[0])]
        left = point.left + point.columns @ self.step + point.inexact @ wrong
        own = point.columns[:, places] @ point.z[places]
        asked = np.column_stack([own, left, point.varied[name]])
        others = np.delete(np.arange(len(point.z)), places)
        beside = point.columns[:, others]
        known = beside.T @ beside + np.diag(point.weight[others] ** 2)
        mixed = beside.T @ asked
        products = asked.T @ asked - mixed.T @ np.linalg.solve(known, mixed)
        sizes, vectors = np.linalg.eigh(products[2:, 2:])
        shapes = sizes > NEGLIGIBLE * sizes.max(initial=0.0)
        along = (vectors.T @ products[2:, 1])[shapes]
        found = float(np.sum(along**2 / sizes[shapes])) - self.excess * np.count_nonzero(shapes)
        return float(max(found, 0.0) / max(products[0, 0], 1e-300))

    def without_discrepancy(self) -> Evidence:
        """Return the set as if all that it leaves were noise."""
        usual = np.array([each.expected or OFF for each in self.background.groups])
        amplitude = np.where(self.discrepant | self.background.optional, usual, self.amplitude)
        left = self.point.left
        return replace(
            self, amplitude=amplitude, excess=max(1.0, float(left @ left) / self.point.count)
        )

    def products(self, columns: Array) -> Array:
        """Return the products (K, k) of all columns of the set with further ones (N, k)."""
        return self.point.products(self.background, columns)

    def strength(self, columns: Array) -> float:
        """Return how many standard deviations unknowns of typical size leave beyond the rest.

        `columns` (N, k): as for `gains`.
        """
        ((information, _),) = self._scores([columns])
        return float(np.sqrt(max(np.linalg.eigvalsh(information)[-1], 0.0)))

    def gains(
        self, blocks: Sequence[Array], possible: Sequence[Possible] | None = None
    ) -> list[tuple[float, Array]]:
        """Return what effects would each add to the log evidence, to first order.

        `blocks` (N, k): change of what is left by the unknowns of each effect, whitened, in
        standard deviations of their priors; `possible`: what these unknowns can be; anything by
        default.
        Returns the gain of each, the amplitudes as they are, and its unknowns (k,).
        """
        scores = self._scores(blocks)
        alike: dict[int, list[int]] = {}
        for place, (_, slope) in enumerate(scores):
            alike.setdefault(len(slope), []).append(place)
        free: dict[int, tuple[float, Array, Array]] = {}
        for places in alike.values():
            own = modes(*(np.array([scores[place][k] for place in places]) for k in (0, 1)))
            free.update(zip(places, zip(*own, strict=True), strict=True))
        bounds: Sequence[Possible | None] = possible or [None] * len(blocks)
        found = []
        for n, (information, slope) in enumerate(scores):
            gain, z, precision = free[n]
            found.append(_gain(information, slope, gain, z, precision, bounds[n]))
        return found

    def _scores(self, blocks: Sequence[Array]) -> list[tuple[Array, Array]]:
        """Return the scores of blocks of further columns (N, k)."""
        columns = np.concatenate(blocks, axis=1)
        grams = [each.T @ each for each in blocks]
        return self.scores(self.products(columns), columns.T @ self.point.left, grams)

    def scores(
        self, mixed: Array, target: Array, blocks: Sequence[Array]
    ) -> list[tuple[Array, Array]]:
        """Return information (k, k) and slope (k,) of blocks of further columns, where they are 0.

        `mixed` (K, q): products of all columns of the set with the q further ones; `target` (q,):
        products of these with what the fit left; `blocks` (k, k): products of the columns of each
        block, q in all.
        """
        factor, scale, step, _ = self._solved
        beside = solve_triangular(factor, scale[:, None] * mixed, lower=True, check_finite=False)
        slope = -(target + mixed.T @ step) / self.excess
        ends = np.cumsum([len(each) for each in blocks])
        found = []
        for own, end in zip(blocks, ends, strict=True):
            at = slice(end - len(own), end)
            information = (own - beside[:, at].T @ beside[:, at] / self.excess) / self.excess
            found.append((information, slope[at]))
        return found


def _factor(scaled: Array) -> Array:
    """Return the lower Cholesky factor of an information of unit diagonal.

    Columns that do the same are told apart by their priors alone, which far above the noise are
    less than the rounding of the products, k times that of a number (Higham 2002, ch. 10).
    """
    rounding = len(scaled) * np.finfo(float).eps * np.eye(len(scaled))
    factor, _ = cho_factor(scaled + rounding, lower=True, check_finite=False)
    return np.asarray(factor)


def _gain(
    information: Array,
    slope: Array,
    gain: float,
    z: Array,
    precision: Array,
    possible: Possible | None,
) -> tuple[float, Array]:
    """Return the gain of an effect and its unknowns within bounds; `modes` tells those without.

    Unknowns that would go beyond what is possible stay at the bound, and their room to move is
    none.
    """
    if possible is None:
        return float(gain), z

    def solve(free: NDArray[np.bool_], z: Array) -> Array:
        nonlocal gain, precision
        if not free.any():
            gain = 0.0
            return z
        z, at = z.copy(), np.flatnonzero(free)
        rest = slope - information @ np.where(free, 0.0, z)
        (gain,), (z[at],), (precision,) = modes(information[np.ix_(at, at)][None], rest[None, at])
        return z

    def inwards(z: Array) -> Array:
        return np.asarray(slope - information @ z - size_weight(z @ z, len(z)) * z)

    z, free = within_bounds(z, possible.lower, possible.upper, solve, inwards)
    if not free.any():
        # What stays at its bounds keeps its prior: data that say no more are no evidence.
        return gain + float(slope @ z - 0.5 * z @ information @ z), z
    covariance = np.eye(len(z))
    covariance[np.ix_(free, free)] = np.linalg.inv(precision)
    held = np.where(free, 0.0, z)
    gain += float(slope @ held - 0.5 * held @ information @ held)
    return gain + possible.gain(z, covariance), z


def modes(information: Array, slope: Array) -> tuple[Array, Array, Array]:
    """Return gains (n,), unknowns (n, k) and their precision (n, k, k) of n effects by themselves.

    Laplace's method at the better of two modes.  The prior has a peak and tails: a large effect is
    found from the side of the tails.

    `information` (n, k, k), `slope` (n, k): of the log likelihood, where the effects are absent.
    """
    count = slope.shape[1]
    # Along its own axes the information is a number each, whatever the prior weighs.
    size, axes = np.linalg.eigh(information)
    size, along = np.maximum(size, 0.0), (slope[:, None] @ axes)[:, 0]
    least = LEAST_PRIOR * size[:, -1:]
    found = []
    for weight in (np.ones((len(slope), 1)), np.full((len(slope), 1), 1e-8)):
        for _ in range(5):
            used = np.maximum(weight, least)
            z = along / (size + used)
            square = np.sum(z**2, axis=1)
            weight = size_weight(square, count)[:, None]
        prior = log_size_prior(square, count) + 0.5 * count * np.log(2.0 * np.pi)
        fits = np.sum((along - 0.5 * size * z) * z - 0.5 * np.log(size + used), axis=1)
        found.append((fits + prior, z, used))
    gains = np.maximum(found[0][0], found[1][0])
    better = (found[0][0] == gains)[:, None]
    z, weight = (np.where(better, *pair) for pair in zip(found[0][1:], found[1][1:], strict=True))
    unknowns = (axes @ z[..., None])[..., 0]
    return gains, unknowns, information + weight[..., None] * np.eye(count)


def known_noise(point: Point, background: Background) -> Evidence:
    """Return a fitted set beside noise and drift as they are known; laws give, nothing else."""
    own = np.arange(point.inexact.shape[1]) < len(point.gives)
    exact = replace(point, inexact=np.where(own, 1.0, OFF) * point.inexact)
    return beside_known(exact, background)


def beside_known(point: Point, background: Background) -> Evidence:
    """Return a set beside drift and noise as they are known, without any discrepancy."""
    drift = background.part(background.always)
    return Evidence(point, drift, np.array([each.expected for each in drift.groups]), 1.0)


def log_amplitude(size: float, group: Group, count: int) -> float:
    """Return the log prior of an amplitude, with the width at which the data know it."""
    if group.expected:
        return -0.5 * float(np.log(size / group.expected) / group.width) ** 2
    if size <= OFF:
        return 0.0
    density = 2.0 / np.pi * size / (1.0 + size**2)
    return float(np.log(density) + 0.5 * np.log(np.pi / count))


def log_excess(excess: Array, width: float) -> Array:
    """Return the log prior of the excess: the noise as known, or something unknown beside it."""
    x = np.log(excess)
    known = np.log((1.0 - MISFIT) / width) - 0.5 * (x / width) ** 2
    other = np.log(2.0 * MISFIT / MOST_MISFIT) - 0.5 * (x / MOST_MISFIT) ** 2
    # Logarithms throughout: far below 1 no density would be left.
    both = np.logaddexp(known, np.where(x > 0.0, other, -np.inf))
    return np.asarray(both - 0.5 * np.log(2.0 * np.pi))
