"""Condense every bushing of the catalogue once with solid elements, for all ends with a flange.

    python bench/paper_calibration/bushing_catalogue.py -o catalogue.npz

Sizes are those in which flanged polymer sleeves are commonly sold; no product is meant.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from wrist_stiffness.fem.components import SHIPPED_SIZES
from wrist_stiffness.fem.parts import Solid, assemble_body
from wrist_stiffness.fem.superelement import Superelement, condense
from wrist_stiffness.mechanism.geometry import BushingDimensions
from wrist_stiffness.mechanism.material import Material


@dataclass(frozen=True)
class CatalogueBushing:
    """One size [mm]; `total_mm` includes the flange."""

    inner_mm: float
    outer_mm: float
    flange_diameter_mm: float
    total_mm: float
    flange_thickness_mm: float

    @property
    def sleeve_mm(self) -> float:
        """Length without the flange [mm]."""
        return self.total_mm - self.flange_thickness_mm

    @property
    def wall_mm(self) -> float:
        """Wall thickness [mm]."""
        return (self.outer_mm - self.inner_mm) / 2.0


CATALOGUE = tuple(
    CatalogueBushing(*row)
    for row in (
        (3.0, 4.5, 7.5, 3.0, 0.75),
        (3.0, 4.5, 7.5, 5.0, 0.75),
        (4.0, 5.5, 9.5, 3.0, 0.75),
        (4.0, 5.5, 9.5, 4.0, 0.75),
        (4.0, 5.5, 9.5, 6.0, 0.75),
        (5.0, 7.0, 11.0, 3.5, 1.0),
        (5.0, 7.0, 11.0, 5.0, 1.0),
        (6.0, 8.0, 12.0, 4.0, 1.0),
        (6.0, 8.0, 12.0, 6.0, 1.0),
        (6.0, 8.0, 12.0, 8.0, 1.0),
        (8.0, 10.0, 15.0, 5.5, 1.0),
        (8.0, 10.0, 15.0, 9.0, 1.0),
    )
)

POLYMER = Material(young=2.4e9, poisson=0.35, density=1490.0, expansion=1e-4)

ENDS: tuple[tuple[str, ...], ...] = ((), ("inner",), ("outer",))
"""Flanges that take part in contact: none at a motor, one at a passive joint."""

Condensed = dict[tuple[int, tuple[str, ...]], Superelement]


def condense_catalogue() -> Condensed:
    """Condense every size and flange side, by the size's number and its flanged ends."""
    return {
        (number, ends): condense(assemble_body(_solid(size, ends), SHIPPED_SIZES), "rigid")
        for number, size in enumerate(CATALOGUE)
        for ends in ENDS
    }


def save(condensed: Condensed, path: Path) -> None:
    """Write condensed bushings to an `.npz` file."""
    arrays = {
        f"{number}/{'+'.join(ends)}/{field.name}": getattr(element, field.name)
        for (number, ends), element in condensed.items()
        for field in fields(Superelement)
    }
    np.savez_compressed(path, **arrays)


def load(path: Path) -> Condensed:
    """Read what `save` wrote."""
    parts: dict[tuple[int, tuple[str, ...]], dict[str, np.ndarray]] = {}
    with np.load(path, allow_pickle=False) as archive:
        for key in archive.files:
            number, ends, name = key.split("/")
            of = (int(number), tuple(end for end in ends.split("+") if end))
            parts.setdefault(of, {})[name] = archive[key]
    return {of: Superelement(**arrays) for of, arrays in parts.items()}


def _solid(size: CatalogueBushing, ends: tuple[str, ...]) -> Solid:
    dimensions = BushingDimensions(
        radius=0.0,
        pin_diameter=1e-3 * size.inner_mm,
        length=1e-3 * size.sleeve_mm,
        wall=1e-3 * size.wall_mm,
        flange_diameter=1e-3 * size.flange_diameter_mm,
        flange_thickness=1e-3 * size.flange_thickness_mm,
        inner_gap=0.0 if "inner" in ends else None,
        outer_gap=0.0 if "outer" in ends else None,
        material=POLYMER,
    )
    walls = ("pin_wall", "hub_wall") if ends else ("hub_wall", "pin_wall")
    return Solid(dimensions, 0.0, *walls, ends)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="catalogue file (.npz)")
    save(condense_catalogue(), parser.parse_args().output)


if __name__ == "__main__":
    main()
