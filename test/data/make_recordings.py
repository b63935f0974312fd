"""Make the four recordings of this folder again; each hides one effect.

    python test/data/make_recordings.py

The names tell nothing on purpose: `ANSWERS` below is the key.  The same table gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

from wrist_stiffness.commands.simulate import hide, simulate_recording
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import CellSettings

SECONDS, RATE_HZ = 120.0, 20.0

ANSWERS = {
    "wrist_a": ("joint_clearance@joint_3:algebraic", 5.0, 11),
    "wrist_b": ("backlash@motor_2:single", 4.0, 12),
    "wrist_c": ("platform_compliance@platform:plain", 3.0, 13),
    "wrist_d": ("loose_seat@platform:plain", 4.0, 14),
}
"""Effect, size in units of one sample's noise, and seed of each recording."""


def main() -> None:
    """Write all four beside this file."""
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    for name, (effect, size, seed) in ANSWERS.items():
        settings = CellSettings(
            rate_hz=RATE_HZ, program_seconds=SECONDS, program_seed=seed, base_seed=seed
        )
        settings = hide(effect, size, table, settings, SECONDS)
        path = Path(__file__).parent / f"{name}.mcap"
        simulate_recording(path, table, settings, SECONDS, seed, overwrite=True)
        print(f"{path.name}: {effect}, magnitude {settings.hidden[0].magnitude:.4g}")


if __name__ == "__main__":
    main()
