"""Make the recordings of docs/find-the-missing-effect.md again: one wrist on six days.

    python test/data/make_tutorial.py

The days have the names of days on purpose: `HIDDEN`, `Plate` and `DENT` below are the key.  The
same table and program give the same bytes; the first four days are kept as an earlier one wrote
them, and the outputs that the page shows are of those.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness import topics
from wrist_stiffness.commands.simulate import hide, simulate_recording
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.recording import RecordingWriter, open_recording
from wrist_stiffness.recording.messages import Float64, Message, Point, Pose, Quaternion
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings
from wrist_stiffness.simulation.program import Track

FOLDER = Path(__file__).parent / "tutorial"
RATE_HZ, SEED = 10.0, 21

HIDDEN, SIZE = "backlash@motor_2:single", 4.0
"""Of all days; size in units of one sample's noise on the first."""

DENT, DENT_SIZE = "dent@joint_3", 8.0
"""From Friday on, of which its size is; at -6.05 deg of the joint's turn, 3.44 deg wide."""

DAYS = {
    "monday": (180.0, ""),
    "tuesday": (180.0, ""),
    "wednesday": (120.0, "clamp"),
    "thursday": (120.0, "clamp"),
    "friday": (180.0, "dent"),
    "saturday": (180.0, "dent"),
}
"""How long each lasts [s], and what is there beside `HIDDEN`."""


@dataclass(frozen=True)
class Plate:
    """A base plate that a pneumatic clamp lifts.

    Parameters
    ----------
    pressure : Track
        Of the clamp, d = 1 [bar].
    """

    pressure: Track

    HIGHEST_BAR = 6.0
    LIFT = 12e-6 * np.array([0.0, 0.05, 1.0])
    """At the highest pressure, in F [m]."""
    TURN = np.radians([1.5e-3, -1e-3, 0.0])
    """Beside it [rad]."""
    POWER = 1.1
    """The pads yield first: a little more than proportional."""

    def twist(self, bar: float) -> Array:
        """Return how far the wrist's frame stands from its place, (6,) at O in F [m, rad]."""
        share = (bar / self.HIGHEST_BAR) ** self.POWER
        return np.concatenate([self.LIFT, self.TURN]) * share

    def lifted(self, pose: Pose, bar: float) -> Pose:
        """Return the pose that the sensor sees."""
        turn, move = exp_twist(self.twist(bar))
        at = np.array([pose.position.x, pose.position.y, pose.position.z])
        stands = pose.orientation
        before = Rotation.from_quat([stands.x, stands.y, stands.z, stands.w])
        after = (Rotation.from_matrix(turn) * before).as_quat(canonical=True)
        return Pose(Point(*(turn @ at + move).tolist()), Quaternion(*after.tolist()))


def pressures(rng: np.random.Generator, seconds: float) -> Track:
    """Return a clamp that opens and closes in half a second, at pressures of its own."""
    knots, levels = [0.0], [0.0]
    while knots[-1] < seconds:
        level = 0.0 if levels[-1] > 0.0 else rng.uniform(2.0, Plate.HIGHEST_BAR)
        rest = knots[-1] + rng.uniform(2.0, 6.0)
        knots += [rest, rest + 0.5]
        levels += [levels[-1], level]
    return Track(np.array(knots), np.array(levels)[:, None])


def with_plate(path: Path, plate: Plate | None) -> Iterator[tuple[str, Message, int]]:
    """Return the messages of a recording, with the clamp."""
    recording = open_recording(path)
    start_ns = None
    for topic, log_ns, message in recording.messages():
        start_ns = log_ns if start_ns is None else start_ns
        bar = 0.0
        if plate is not None:
            bar = float(plate.pressure((log_ns - start_ns) * 1e-9)[0])
        if topic == topics.PLATFORM_POSE and plate is not None:
            message = replace(message, pose=plate.lifted(message.pose, bar))
        if topic == topics.JOINT_STATES and plate is not None:
            yield f"{topics.COVARIATES}clamp_bar", Float64(round(bar, 2)), log_ns
        yield topic, message, log_ns


def main() -> None:
    """Write all days."""
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    hidden: tuple[HiddenEffect, ...] = ()
    dented = False
    FOLDER.mkdir(exist_ok=True)
    for day, (name, (seconds, beside)) in enumerate(DAYS.items()):
        settings = CellSettings(
            rate_hz=RATE_HZ,
            program_seconds=seconds,
            program_seed=SEED + day,
            hidden=hidden,
            base="wrong",
            base_seed=SEED,
            session=day,
        )
        if not hidden:
            settings = hide(HIDDEN, SIZE, table, settings, seconds)
        if beside == "dent" and not dented:
            settings, dented = hide(DENT, DENT_SIZE, table, settings, seconds), True
        hidden = settings.hidden
        rng = np.random.default_rng([SEED, day])
        plate = Plate(pressures(rng, seconds)) if beside == "clamp" else None
        with TemporaryDirectory() as scratch:
            as_it_was = Path(scratch) / "wrist.mcap"
            simulate_recording(as_it_was, table, settings, seconds, SEED + day)
            with RecordingWriter(FOLDER / f"{name}.mcap", overwrite=True) as writer:
                for topic, message, log_ns in with_plate(as_it_was, plate):
                    writer.write(topic, message, log_ns)
        print(f"{name}: {', '.join(filter(None, (HIDDEN, beside)))}", file=sys.stderr)


if __name__ == "__main__":
    main()
