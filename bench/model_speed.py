"""What effects cost: one sample of a stream, a recording at once, and a row of candidates.

Times depend on the machine, so each stands beside its ratio to the prediction of one sample without
effects in the same run.  Run as `python bench/model_speed.py [SAMPLES]`.
"""

from __future__ import annotations

import resource
import sys
import time
import timeit
from collections.abc import Callable

import numpy as np

from wrist_stiffness.identification.free_effects import commissioning
from wrist_stiffness.model.block import Block, Load, Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import catalogue
from wrist_stiffness.shipped import shipped_file

REPEATS = 7
TYPICAL = ("axis_misalignment@joint_1", "joint_clearance@joint_3", "backlash@motor_1")
STREAM = 400
"""Samples of the streams."""

CANDIDATES = 2048
"""Samples of the comparison of all candidates."""


def plausible(name: str) -> Effect:
    """Return an effect with values away from nothing, without uncertainties."""
    law_name, place = name.split("@")
    law = catalogue()[law_name]
    values = {p.key: Estimate(p.mean or min(p.scale, p.upper)) for p in law.parameters(place)}
    return Effect(law, place, values)


def recording(n: int) -> Block:
    """Return n samples at 1 kHz."""
    t = 1e-3 * np.arange(n)
    theta = np.radians(30.0) * np.stack([np.sin(2.0 * t), np.cos(3.0 * t)], axis=1)
    load = np.zeros((n, 6))
    load[:, :3] = np.stack([0.3 * np.sin(t), 0.2 * np.cos(2.0 * t), -np.ones(n)], axis=1)
    warm = {"ambient": 20.0 + 5.0 * np.sin(0.1 * t)}
    return Block(t, theta, load, temperatures=warm)


def microseconds(call: Callable[[], object]) -> float:
    """Return the least mean time of a call over a few repeats."""
    return 1e6 * min(timeit.repeat(call, number=20, repeat=REPEATS)) / 20


def streamed_microseconds(model: ErrorModel, block: Block) -> float:
    """Return the median time of a sample of a stream that moves: what remembers must look anew."""
    session, times = model.session(), []
    for now in map(block.take, (slice(i, i + 1) for i in range(len(block)))):
        warm = {name: float(value[0]) for name, value in now.temperatures.items()}
        sample = Sample(float(now.time[0]), now.theta[0], Load(now.load[0]), temperatures=warm)
        start = time.perf_counter()
        session.advance(sample)
        times.append(time.perf_counter() - start)
    return 1e6 * float(np.median(times))


def batch_microseconds(model: ErrorModel, block: Block) -> float:
    """Return the time of a batch per sample."""
    start = time.perf_counter()
    model.batch(block)
    return 1e6 * (time.perf_counter() - start) / len(block)


def main(samples: int) -> None:
    """Print the table."""
    plain = load_model(shipped_file("config/palmieri2015_model.yaml"))
    typical = plain.with_effects(*map(plausible, TYPICAL))
    block = recording(samples)
    theta, load = block.theta[7], Load(block.load[7])
    stream = block.take(slice(0, STREAM))
    free, _ = commissioning(plain)
    calibrated = plain.with_effects(*(plausible(each.effect.name) for each in free))
    extended = calibrated.with_effects(*calibrated.effects, plausible("backlash@motor_1"))
    one = microseconds(lambda: plain.predict(theta, load))
    print(f"{'':48}{'us':>9}{'ratio':>8}")

    def line(name: str, value: float) -> None:
        print(f"{name:48}{value:9.1f}{value / one:8.2f}", flush=True)

    line("one sample without effects, predict", one)
    for name, model in (
        ("one sample without effects", plain),
        *(
            (f"one sample with {name}", plain.with_effects(plausible(name)))
            for name in (TYPICAL[1], "joint_friction@joint_4")
        ),
        ("one sample with three effects", typical),
        (f"one sample with the {len(free)} of a calibration", calibrated),
        ("the same and backlash", extended),
    ):
        line(f"{name}, session", streamed_microseconds(model, stream))
    line(f"recording of {samples}, per sample", batch_microseconds(plain, block))
    line("the same with three effects", batch_microseconds(typical, block))
    few = block.take(slice(0, CANDIDATES))
    everything = [(plausible(f"{law.id}@{p}"),) for law in catalogue().values() for p in law.places]
    start = time.perf_counter()
    plain.batch_with(few, [(), *everything])
    total = 1e6 * (time.perf_counter() - start) / len(few)
    line(f"each of {len(everything)} candidates, per sample", total / len(everything))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MB")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50_000)
