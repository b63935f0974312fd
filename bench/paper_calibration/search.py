"""Search the paper's unpublished geometry with beams for links and condensed bushings.

    pip install cma
    python bench/paper_calibration/bushing_catalogue.py -o catalogue.npz
    python bench/paper_calibration/search.py --catalogue catalogue.npz -o candidate.yaml

Differential evolution finds the choices (bushings, sides, flanges) and a start; the covariance
matrix adaptation (Hansen) then adapts the sizes with the choices held.  What it writes is judged by
solids: `python -m wrist_stiffness table build candidate.yaml`, and by test/validation.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import cma
import numpy as np
import yaml
from beam_link import link_flexibility
from bushing_catalogue import Condensed, load
from candidate import CHOICES, NAMES, SCHEMES, Candidate, decode, mirrored
from paper_figures import PUBLISHED, Figures, PaperExperiment
from scipy.optimize import differential_evolution

from wrist_stiffness.errors import WristError
from wrist_stiffness.fem.components import place_components
from wrist_stiffness.fem.parts import wrist_parts
from wrist_stiffness.fem.superelement import Superelement
from wrist_stiffness.mechanism.components import LINKS, Array
from wrist_stiffness.mechanism.geometry_file import geometry_from_values

TOLERANCE = np.array(
    [
        [0.6, 0.6, 0.12, 0.12, 0.19],
        [1.0, 1.0, 0.8, 0.8, 1.5],
        [1.2, 1.2, 2.0, 2.2, 5.0],
    ]
)
"""One unit of misfit of each figure: tight on the means of s, phi and s_z, wide on the extremes."""

MAP_TOLERANCE = 0.07
SOLVED_MEANS_WEIGHT = 0.8
SKEW_WEIGHT = 0.5
READ_GRID, SOLVED_GRID, SINGULARITY_GRID = 25, 9, 13
LEAST_SINGULARITY = 0.38
"""|D| nearer to zero in the rectangle makes maps that no table of bearable size follows."""

UNUSABLE = 1e6


@dataclass(frozen=True)
class Search:
    """What stays the same for all candidates.

    Parameters
    ----------
    scheme : str
        One of `SCHEMES`.
    start : dict
        Values of a geometry file for all that is not searched.
    catalogue : dict
        Condensed bushings.
    """

    scheme: str
    start: dict[str, Any]
    catalogue: Condensed

    def experiment(self, candidate: Candidate) -> PaperExperiment:
        """Set up the paper's experiment with beams for links and condensed bushings."""
        geometry = geometry_from_values(candidate.values)
        parts = wrist_parts(geometry)
        condensed = {}
        for part in parts:
            if part.name in LINKS:
                flexibility = link_flexibility(part.solid.dimensions, part.solid.angle)
                condensed[part.solid] = _weightless(flexibility)
            else:
                of = (candidate.bushings[part.name], part.solid.flanges)
                condensed[part.solid] = self.catalogue[of]
        return PaperExperiment(geometry, place_components(geometry, parts, condensed))

    def misfit(self, point: Array) -> float:
        """Sum of squares against the published figures, of a point of the unit cube."""
        candidate = decode(np.clip(point, 0.0, 1.0), self.scheme, self.start)
        skew = sum(s * s for s in _skews(point))
        penalty = 10.0 * candidate.violation_mm2 + SKEW_WEIGHT**2 * skew
        if candidate.violation_mm2 > 50.0:
            return UNUSABLE + penalty
        try:
            return penalty + fit(self.experiment(candidate))[0]
        except WristError:
            return UNUSABLE


def fit(experiment: PaperExperiment) -> tuple[float, tuple[float, float]]:
    """Sum of squares of one wrist, and the mirroring in x and y that suits it best."""
    workspace = experiment.workspace
    lower, upper = workspace.rectangle
    unit_square = np.stack(
        np.meshgrid(*[np.linspace(0.0, 1.0, SINGULARITY_GRID)] * 2, indexing="ij"), axis=-1
    )
    everywhere = lower + unit_square.reshape(-1, 2) * (upper - lower)
    nearest = np.min(np.abs(workspace.mechanism.forward(everywhere).singularity))
    near_singular = 6.3 * max(0.0, LEAST_SINGULARITY - nearest) / 0.05
    spline, poses = experiment.paper_spline(), workspace.grid(READ_GRID)
    read, few = spline(poses), workspace.grid(SOLVED_GRID)
    figures = Figures.of(read, workspace.operative(poses))
    solved = experiment.solve(few[workspace.operative(few)]).mean(axis=0)
    maxima = np.log(figures.map_maximum / PUBLISHED.map_maximum) / MAP_TOLERANCE
    found = []
    for x, y in product((1.0, -1.0), repeat=2):
        sign = np.array([x, y, 1.0, 1.0, 1.0])
        statistics = np.where(sign > 0.0, figures.operative, -figures.operative[[0, 2, 1]])
        terms = (statistics - PUBLISHED.operative) / TOLERANCE
        means = SOLVED_MEANS_WEIGHT * (sign * solved - PUBLISHED.operative[0]) / TOLERANCE[0]
        total = np.sum(terms**2) + np.sum(means**2) + np.sum(maxima**2) + near_singular**2
        found.append((float(total), (x, y)))
    return min(found)


def search(setting: Search, seed: int, seconds: float) -> Array:
    """Return the best point of the unit cube found in a given time [s]."""
    bounds, begin = [(0.0, 1.0)] * len(NAMES), time.monotonic()

    def stop(intermediate_result: Any) -> bool:
        return time.monotonic() - begin > 0.4 * seconds

    broad = differential_evolution(
        setting.misfit,
        bounds,
        popsize=2,
        maxiter=10**6,
        tol=0.0,
        mutation=(0.3, 0.9),
        recombination=0.8,
        strategy="randtobest1bin",
        init="sobol",
        polish=False,
        rng=seed,
        callback=stop,
    )
    sizes = np.array([not name.startswith(CHOICES) for name in NAMES])

    def adapted(part: Array) -> Array:
        point = broad.x.copy()
        point[sizes] = part
        return point

    strategy = cma.CMAEvolutionStrategy(
        np.clip(broad.x[sizes], 0.001, 0.999),
        0.08,
        {
            "bounds": [0, 1],
            "seed": seed + 1,
            "popsize": 16,
            "timeout": 0.6 * seconds,
            "verbose": -9,
        },
    )
    strategy.optimize(lambda part: setting.misfit(adapted(part)))
    return adapted(strategy.result.xbest)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--catalogue", type=Path, required=True)
    parser.add_argument("--start", type=Path, default=Path("config/palmieri2015.yaml"))
    parser.add_argument("--scheme", choices=SCHEMES, default="c_upright")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=400.0)
    parser.add_argument("-o", "--output", type=Path, required=True, help="geometry file to write")
    arguments = parser.parse_args()
    start = yaml.safe_load(arguments.start.read_text(encoding="utf-8"))
    setting = Search(arguments.scheme, start, load(arguments.catalogue))
    point = search(setting, arguments.seed, arguments.seconds)
    candidate = decode(point, arguments.scheme, start)
    misfit, mirror = fit(setting.experiment(candidate))
    print(
        f"misfit {misfit:.2f}, parts overlap by {candidate.violation_mm2:.3g} mm^2", file=sys.stderr
    )
    values = mirrored(candidate.values, *mirror)
    arguments.output.write_text(yaml.safe_dump(values, sort_keys=False), encoding="utf-8")


def _weightless(flexibility: Array) -> Superelement:
    return Superelement(
        flexibility=flexibility,
        weight_motor_side=np.zeros((6, 3)),
        weight_platform_side=np.zeros((6, 3)),
        mass=np.zeros((12, 12)),
        sector_wrench=np.zeros((6, 0)),
        sector_screw=np.zeros((6, 0)),
        sector_approach=np.zeros((0, 0)),
        sector_weight=np.zeros((0, 3)),
    )


def _skews(point: Array) -> list[float]:
    return [value - 0.5 for name, value in zip(NAMES, point, strict=True) if "skew" in name]


if __name__ == "__main__":
    main()
