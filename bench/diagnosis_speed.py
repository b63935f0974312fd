"""Cost of a diagnosis: 600,000 samples of 6 components, 60 candidates.

Prints seconds (elapsed, and of the processor), peak memory, and the ratio of the cost between
recordings of different length (linear = the ratio of the lengths).  Set ``OMP_NUM_THREADS=2`` or
less.
"""

import resource
import time
from dataclasses import replace

import numpy as np
from diagnosis_arm import Candidate, Observations, base, campaign, catalogue, hide

from wrist_stiffness.diagnosis import averaged, compress, diagnose, dwell_groups

SAMPLES_PER_DWELL = 1200
CANDIDATES = 60
MEMORY_EFFECTS = 6
"""So many candidates are evaluated on all samples, the others on dwells."""


def sampled(dwells: Observations, rng: np.random.Generator) -> Observations:
    """Spread dwells over samples at 1 kHz, with a fifth of the time spent moving."""
    rows = np.repeat(np.arange(dwells.n_units), SAMPLES_PER_DWELL)
    samples = dwells.take(rows)
    jitter = rng.normal(0, 0.7e-6, samples.values.shape)
    return replace(
        samples,
        values=samples.values + jitter,
        time_s=np.arange(len(rows)) / 1e3,
        covariance=None,
        samples=None,
    )


def widened() -> tuple[Candidate, ...]:
    """Sixty candidates: the catalogue, and its effects in proportion to other conditions."""
    found = list(catalogue())
    for factor in ("q1", "q3", "humidity"):
        for candidate in catalogue():
            if len(found) < CANDIDATES:

                def columns(table, shape, inner=candidate, factor=factor):
                    return inner.evaluate(table, shape) * table.covariate(factor)[:, None, None]

                name = f"{candidate.effect}_by_{factor}"
                found.append(replace(candidate, effect=name, columns=columns))
    return tuple(found)


def cost(n_samples: int) -> dict[str, float]:
    """Seconds of each step."""
    rng = np.random.default_rng(1)
    candidates = widened()
    truth = candidates[0]
    dwells = hide(campaign(rng, n_samples // SAMPLES_PER_DWELL), [(truth, 3.0)], rng, 0.05)
    samples = sampled(dwells, rng)
    moving = np.arange(samples.n_units) % SAMPLES_PER_DWELL < SAMPLES_PER_DWELL // 5
    start, busy = time.perf_counter(), time.process_time()
    group = dwell_groups(moving, samples.sessions)
    units = compress(samples, group)
    compressed = time.perf_counter()
    on_units = (
        *(averaged(candidate, samples, group) for candidate in candidates[:MEMORY_EFFECTS]),
        *candidates[MEMORY_EFFECTS:],
    )
    result = diagnose(units, on_units, base(), rng)
    done, worked = time.perf_counter(), time.process_time()
    named = [finding.names for finding in result.findings]
    print(f"{n_samples} samples, {units.n_units} dwells: {result.verdict} {named}")
    return {
        "compress": compressed - start,
        "diagnose": done - compressed,
        "processor": worked - busy,
    }


def main() -> None:
    """Print cost and ratios."""
    lengths = (150_000, 300_000, 600_000)
    costs = [cost(length) for length in lengths]
    for length, seconds in zip(lengths, costs, strict=True):
        ratio = seconds["processor"] / costs[0]["processor"]
        print(f"{length}: processor time {ratio:.2f} x the shortest")
        print("   " + ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items()))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"peak memory {peak:.2f} GB")


if __name__ == "__main__":
    main()
