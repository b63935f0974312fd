"""Built-in examples: recordings of the virtual cell, made when somebody first opens them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from wrist_stiffness.commands.simulate import hide, on_day, simulate_recording
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.simulation.cell import CellSettings

RATE_HZ, SEED = 10.0, 21


@dataclass(frozen=True)
class Example:
    """A wrist that hides something."""

    name: str
    title: str
    story: str
    hidden: str  # `law@component:form`
    size: float  # in units of one sample's noise
    days: int = 2  # recordings; the last one judges
    seconds: float = 90.0  # duration of each [s]
    instrument: str = "interferometer"  # pose sensor


EXAMPLES = (
    Example(
        "known_fault",
        "A fault that the program knows",
        "Two days of a wrist that turns by some hundredths of a degree too little or too much.",
        "backlash@motor_2:single",
        4.0,
        seconds=60.0,
    ),
    Example(
        "unknown_fault",
        "A fault that is on no list",
        "Two days of a wrist that errs in a few poses, as no effect of the catalogue would.",
        "dent@joint_3",
        4.0,
    ),
    Example(
        "cannot_tell",
        "Data that cannot tell",
        "Fifty seconds with a laser tracker: two causes look alike in them.",
        "link_stiffness@link_2:uniform",
        0.5,
        days=1,
        seconds=50.0,
        instrument="tracker",
    ),
)


def recordings_of(
    example: Example, folder: Path, table: Table, tell: Callable[[str], None]
) -> list[Path]:
    """Return the recordings of an example, made in a folder where they are not there."""
    own = folder / example.name
    paths = [own / f"day_{day}.mcap" for day in range(1, example.days + 1)]
    if all(path.is_file() for path in paths):
        return paths
    tell("simulating the recordings of this example")
    own.mkdir(parents=True, exist_ok=True)
    settings = CellSettings(
        rate_hz=RATE_HZ,
        program_seconds=example.seconds,
        program_seed=SEED,
        base="wrong",
        base_seed=SEED,
        instrument=example.instrument,
    )
    settings = hide(example.hidden, example.size, table, settings, example.seconds)
    for day, path in enumerate(paths, 1):
        simulate_recording(path, table, on_day(day, settings), example.seconds, day, overwrite=True)
    return paths
