"""What the paper's figures say of how its bushings were held.

    python bench/paper_calibration/walls.py [-o docs]

The shipped sizes with each wall, and with bushings so much stiffer that the mean of s is the
paper's again: what differs then is all that the published figures have to tell the walls apart.
Writes the block "walls" of docs/paper-and-model.md.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
from paper_page import insert_blocks
from scipy.optimize import brentq

from wrist_stiffness.fem.components import SHIPPED_SIZES, elastic_components
from wrist_stiffness.fem.superelement import Interface
from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.mechanism.components import ELASTIC, JOINTS, Array, ElasticComponents
from wrist_stiffness.mechanism.geometry_file import load_geometry, mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.mechanism.workspace import Workspace

COARSER = 1.5
"""Element sizes over the shipped ones; s then lacks some 0.5 %."""

PAPER = ("paper", 8.73, 12.9, 14.78, 36.1, 70.0, 55.0)


def main() -> None:
    """Compute the block and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default="docs", help="folder of the page")
    arguments = parser.parse_args()
    geometry = load_geometry("config/palmieri2015.yaml")
    sizes = SHIPPED_SIZES.times(COARSER)
    workspace = Workspace(mechanism_of(geometry), geometry.limits)
    poses = workspace.grid(41)
    inside = workspace.operative(poses)
    configuration = mechanism_of(geometry).forward(poses)

    def figures(components: ElasticComponents) -> Array:
        operators = contact_operators(configuration, components, np.zeros(3))
        s, phi = rated_map(configuration, operators, geometry)[:, 3:].T
        s, phi = 1e6 * s, 1e3 * np.degrees(phi)
        return np.array(
            [
                s[inside].mean(),
                phi[inside].mean(),
                s[inside].max(),
                phi[inside].max(),
                s.max(),
                phi.max(),
            ]
        )

    rows = [row(*PAPER)]
    for interface in get_args(Interface):
        components, _ = elastic_components(geometry, sizes, interface)
        rows.append(row(f"`{interface}`, shipped sizes", *figures(components)))
        times = brentq(
            lambda k, own=components: figures(stiffer(own, k))[0] - PAPER[1], 0.2, 100.0, xtol=1e-3
        )
        name = f"`{interface}`, bushings {times:.2f} times as stiff"
        rows.append(row(name, *figures(stiffer(components, times))))
    head = "| walls | mean s | mean phi | max s | max phi | map max s | map max phi |"
    block = "\n".join([head, "| --- " * 7 + "|", *rows])
    print(block)
    page = Path(arguments.output) / "paper-and-model.md"
    page.write_text(insert_blocks(page.read_text(), {"walls": block}))


def stiffer(components: ElasticComponents, times: float) -> ElasticComponents:
    """Return the parts with all bushings, flanges included, so many times as stiff."""
    flexibility = components.flexibility.copy()
    flexibility[[ELASTIC.index(joint) for joint in JOINTS]] /= times
    contact = {
        joint: replace(flanges, screw=flanges.screw / times, approach=flanges.approach / times)
        for joint, flanges in components.contact.items()
    }
    return replace(components, flexibility=flexibility, contact=contact)


def row(name: str, *values: float) -> str:
    """Return one line of the table."""
    cells = [f"{value:.{digits}f}" for value, digits in zip(values, (2, 1) * 3, strict=True)]
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
