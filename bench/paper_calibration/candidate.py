"""What the calibration may choose: a point of the unit cube becomes the values of a geometry file.

Built in, so that every candidate could be made: the three bars lie in disjoint spherical shells
around the platform, link_2 and link_3 outside of link_1; the hub of joint_4 is the bore of link_3
and the bushing fits into it; the platform's hubs lie inside the shells; the lower platform joint
lies below the plate; motor 1's shaft leaves on the other side than the joint that it would meet.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from bushing_catalogue import CATALOGUE

from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.vectors import unit

BOUNDS: dict[str, tuple[float, float]] = {
    "shell_mm": (27.0, 40.0),
    **{f"radial_{k}_mm": (3.0, 8.0) for k in (1, 2, 3)},
    **{f"axial_{k}": (0.0, 1.0) for k in (1, 2, 3)},
    "link_3_outside": (0.0, 1.0),
    **{f"motor_{j}_offset_mm": (0.0, 14.0) for j in (1, 5)},
    **{f"hub_{j}": (0.0, 1.0) for j in (2, 3)},
    **{f"bushing_{j}": (0.0, len(CATALOGUE) - 1e-6) for j in (1, 2, 3, 4, 5)},
    **{f"outer_flange_{j}": (0.0, 1.0) for j in (2, 3, 4)},
    **{f"gap_{j}_um": (-10.0, 12.0) for j in (2, 3, 4)},
    **{f"side_{j}": (-1.0, 1.0) for j in (1, 2, 5)},
    "depth_mm": (10.0, 22.0),
    "load_at_centre": (0.0, 1.0),
    "map_margin": (1.0, 1.4),
    **{f"skew_{k}": (-0.5, 0.5) for k in range(1, 8)},
}
"""Parameters and their limits.  Those in `CHOICES` are read as a number or a yes; a gap below zero
is a touching flange; `axial` and `hub` place a size between its least and its largest value."""

NAMES = tuple(BOUNDS)
LOWER, UPPER = (np.array([limits[i] for limits in BOUNDS.values()]) for i in (0, 1))
CHOICES = ("link_3_outside", "load_at_centre", "bushing_", "outer_flange_", "side_")

SCHEMES = ("c_level", "c_upright")
"""Home axis c of joint_3 level, or (nearly) along the platform's normal."""

CLEARANCE_MM = 1.0
"""Between neighbouring shells, and around hubs."""

LARGEST_AXIAL_MM = 16.0
WALL_MM = 2.5
CUBE_MM = 149.0
PLATE_RADIUS_MM, PLATE_THICKNESS_MM = 25.0, 3.0


@dataclass(frozen=True)
class Candidate:
    """One choice.

    Parameters
    ----------
    values : dict
        As a geometry file reads.
    bushings : dict of str to int
        Number in the catalogue by joint.
    violation_mm2 : float
        Sum of squares by which the parts do not fit [mm^2]; zero where they do.
    """

    values: dict[str, Any]
    bushings: dict[str, int]
    violation_mm2: float


def decode(point: Array, scheme: str, start: dict[str, Any]) -> Candidate:
    """Turn a point of the unit cube into a wrist.

    Parameters
    ----------
    point : (n,) float
        In the order of `NAMES`, each from 0 to 1.
    scheme : str
        One of `SCHEMES`.
    start : dict
        Values of a geometry file for all that is not chosen.

    Returns
    -------
    Candidate
        The wrist; it may still be unable to reach its workspace.
    """
    p = dict(zip(NAMES, (LOWER + point * (UPPER - LOWER)).tolist(), strict=True))
    number = {j: int(p[f"bushing_{j}"]) for j in range(1, 6)}
    size = {j: CATALOGUE[number[j]] for j in number}
    side = {j: 1.0 if p[f"side_{j}"] >= 0.0 else -1.0 for j in (1, 2, 5)}
    below, beside = (3, 4) if scheme == "c_upright" else (4, 3)
    side |= {below: -1.0, beside: -side[1]}

    order = (1, 2, 3) if p["link_3_outside"] >= 0.5 else (1, 3, 2)
    gap_after = {order[0]: CLEARANCE_MM, order[1]: size[4].flange_thickness_mm + 0.5}
    arc, outside = {}, p["shell_mm"]
    for link in order:
        arc[link] = outside + p[f"radial_{link}_mm"] / 2.0
        outside += p[f"radial_{link}_mm"] + gap_after.get(link, 0.0)

    violation = 2.0 * max(0.0, size[4].sleeve_mm - p["radial_3_mm"]) ** 2
    plate_corner = math.hypot(PLATE_RADIUS_MM, p["depth_mm"] + PLATE_THICKNESS_MM)
    violation += max(0.0, plate_corner + 0.5 - p["shell_mm"]) ** 2
    radius = {4: arc[3]}
    for j in (1, 5):
        radius[j] = outside + CLEARANCE_MM + size[j].sleeve_mm / 2.0 + p[f"motor_{j}_offset_mm"]
        violation += max(0.0, radius[j] + size[j].sleeve_mm / 2.0 + outside - CUBE_MM) ** 2
    for j in (2, 3):
        half = size[j].sleeve_mm / 2.0 + size[j].flange_thickness_mm + 0.5
        least = p["depth_mm"] + PLATE_THICKNESS_MM + half if j == below else 12.0
        largest = p["shell_mm"] - half
        violation += max(0.0, least + 0.5 - largest) ** 2
        radius[j] = largest - (1.0 - p[f"hub_{j}"]) * max(0.0, largest - least)

    values = copy.deepcopy(start)
    values["axes"] = {**home_axes(p, scheme), "source": "calibrated"}
    bores = {
        1: (size[1].inner_mm, size[2].inner_mm),
        2: (size[5].inner_mm, size[4].inner_mm),
        3: (size[4].outer_mm, size[3].inner_mm),
    }
    for k, (motor_bore, platform_bore) in bores.items():
        widest = max(motor_bore, platform_bore)
        least = widest + 2.0
        values["links"][f"link_{k}"] |= {
            "arc_radius_mm": arc[k],
            "section_radial_mm": p[f"radial_{k}_mm"],
            "section_axial_mm": least + p[f"axial_{k}"] * (LARGEST_AXIAL_MM - least),
            "overhang_mm": widest / 2.0 + WALL_MM,
            "motor_bore_mm": motor_bore,
            "platform_bore_mm": platform_bore,
        }
    for j in range(1, 6):
        block = values["bushings"][f"joint_{j}"]
        block |= {
            "radius_mm": side[j] * radius[j],
            "pin_diameter_mm": size[j].inner_mm,
            "length_mm": size[j].sleeve_mm,
            "wall_mm": size[j].wall_mm,
            "flange_diameter_mm": size[j].flange_diameter_mm,
            "flange_thickness_mm": size[j].flange_thickness_mm,
        }
        if j in (2, 3, 4):
            gap = max(0.0, p[f"gap_{j}_um"])
            outer = p[f"outer_flange_{j}"] >= 0.5
            block |= {
                "inner_gap_um": None if outer else gap,
                "outer_gap_um": gap if outer else None,
            }
    depth = p["depth_mm"]
    platform = values["platform"]
    platform["centre_mm"] = [0.0, 0.0, -depth]
    platform["load_at"] = "P0" if p["load_at_centre"] >= 0.5 else "O"
    platform["readout_points_mm"] = [
        [0.0, 0.0, -depth],
        [22.0, 0.0, -depth],
        [-11.0, 19.0526, -depth],
        [-11.0, -19.0526, -depth],
        [0.0, 24.0, 0.0],
        [24.0, 0.0, 0.0],
        [0.0, 0.0, -depth - PLATE_THICKNESS_MM],
    ]
    values["limits"]["map_margin"] = p["map_margin"]
    choice = {f"joint_{j}": number[j] for j in number}
    return Candidate(values, choice, violation)


def home_axes(p: dict[str, float], scheme: str) -> dict[str, list[float]]:
    """Return the home axes by joint: the orthogonal scheme, skewed."""
    t = [p[f"skew_{k}"] for k in range(1, 8)]
    if scheme == "c_upright":
        c, d = [t[2], t[3], 1.0], [1.0, t[4], t[5]]
    else:
        c, d = [1.0, t[2], t[3]], [t[4], t[5], 1.0]
    axes = ([1.0, 0.0, 0.0], [t[0], 1.0, t[1]], c, d, [t[6], 1.0, 0.0])
    return {f"joint_{j}": unit(np.array(a)).tolist() for j, a in enumerate(axes, start=1)}


def mirrored(values: dict[str, Any], x: float, y: float) -> dict[str, Any]:
    """Mirror a wrist in x and y (factors +1 or -1): the paper does not say which way they point."""
    reflected = copy.deepcopy(values)
    for j in range(1, 6):
        joint = f"joint_{j}"
        axis = np.array(values["axes"][joint]) * (x, y, 1.0)
        # An axis keeps its sense, so that positive angles stay positive; the bushing changes side.
        sense = np.sign(axis[np.argmax(np.abs(axis))])
        reflected["axes"][joint] = (sense * axis + 0.0).tolist()
        reflected["bushings"][joint]["radius_mm"] *= float(sense)
    return reflected
