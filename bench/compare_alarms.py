"""How often `compare` tells a dependence where nothing is wrong.

Run as ``python bench/compare_alarms.py [RECORDINGS]`` (default 40): so many sound wrists in the
virtual cell, two minutes each, with the scatter of the instrument stated and without, compared with
the model that is right.  Prints how many got a sentence, and the largest probability of one.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import SENSED, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument

CELLS = (("interferometer", 10.0), ("interferometer", 100.0), ("tracker", 10.0))


def sound(table: Table, name: str, rate_hz: float, seed: int) -> MeasuredSession:
    """Return two minutes of a sound wrist."""
    settings = CellSettings(rate_hz=rate_hz, program_seed=41 + seed, instrument=name)
    cell = VirtualCell(table, settings, np.random.default_rng(seed))
    time = np.arange(round(rate_hz * settings.program_seconds)) / rate_hz
    sample = cell.run(time, cell.desired(time))
    warm = {body: sample.temperature[:, place] for place, body in enumerate(SENSED)}
    return MeasuredSession(
        "day",
        Block(time, sample.encoder, sample.wrench, sample.speed, temperatures=warm),
        sample.measured_shift,
        sample.measured_rotation,
        np.diag(instrument(name).sigma ** 2),
    )


def main() -> None:
    """Print the alarms of each cell."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    for name, rate_hz in CELLS:
        alarms, largest = {"stated": 0, "not stated": 0}, 0.0
        for seed in range(count):
            session = sound(model.table, name, rate_hz, seed)
            for noise, own in (
                ("stated", session),
                ("not stated", replace(session, covariance=None)),
            ):
                found = compare_models([("m", model)], [own]).models[0].explained
                alarms[noise] += bool(found.every)
                largest = max([largest, *found.answer.chances.values()])
        told = ", ".join(f"{number} with noise {noise}" for noise, number in alarms.items())
        print(
            f"{name} at {rate_hz:g} Hz, {count} sound wrists: alarms {told}; "
            f"largest probability of a condition {100.0 * largest:.0f} %"
        )


if __name__ == "__main__":
    main()
