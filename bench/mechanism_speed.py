"""What one pose costs: kinematics, influence, compliance, contact; alone and in a stack of poses.

Times depend on the machine, so each stands beside its ratio to a 48 x 48 matrix product of the same
run.  Run as `python bench/mechanism_speed.py`; the costs do not depend on the components' values.
"""

from __future__ import annotations

import timeit
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wrist_stiffness.mechanism.components import (
    ELASTIC,
    PASSIVE_JOINTS,
    ElasticComponents,
    FlangeContact,
)
from wrist_stiffness.mechanism.contact import solve_contact
from wrist_stiffness.mechanism.geometry_file import load_geometry, mechanism_of
from wrist_stiffness.mechanism.influence import influence
from wrist_stiffness.mechanism.statics import component_shares, contact_operators, weight_wrench

SECTORS = 8
POSES = 1000
SECONDS = 0.2
REPEATS = 5


def random_components(rng: np.random.Generator) -> ElasticComponents:
    """Return components with 8 sectors at each passive joint."""
    root = rng.normal(size=(len(ELASTIC), 6, 6)) + 3.0 * np.eye(6)
    flange = FlangeContact(
        sign=np.ones(SECTORS),
        screw=1e-9 * rng.normal(size=(6, SECTORS)),
        approach=1e-6 * np.eye(SECTORS),
        weight_approach=np.zeros((SECTORS, 3)),
        gap=1e-6 * rng.normal(size=SECTORS),
    )
    weights = 0.01 * rng.normal(size=(2, len(ELASTIC), 6, 3))
    return ElasticComponents(
        flexibility=1e-7 * root @ np.swapaxes(root, -1, -2),
        weight_motor_side=weights[0],
        weight_platform_side=weights[1],
        platform_weight=0.01 * rng.normal(size=(6, 3)),
        contact=dict.fromkeys(PASSIVE_JOINTS, flange),
    )


def microseconds(call: Callable[[], object]) -> float:
    """Return the least mean time of a call over a few repeats."""
    once = timeit.timeit(call, number=1)
    number = max(1, int(SECONDS / max(once, 1e-6)))
    return 1e6 * min(timeit.repeat(call, number=number, repeat=REPEATS)) / number


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(0)
    geometry = load_geometry(Path(__file__).parents[1] / "config" / "palmieri2015.yaml")
    mechanism, gravity = mechanism_of(geometry), geometry.gravity
    components = random_components(rng)
    matrix = rng.normal(size=(48, 48))
    reference = microseconds(lambda: matrix @ matrix)

    columns = []
    for theta in (np.array([0.3, -0.4]), rng.uniform(-0.8, 0.8, (POSES, 2))):
        at = mechanism.forward(theta)
        calls: dict[str, Callable[[], object]] = {
            "forward": lambda theta=theta: mechanism.forward(theta),
            "influence": lambda at=at: influence(at),
            "compliance, influence included": lambda at=at: component_shares(at, components).sum(
                axis=-3
            ),
            "forward to compliance": lambda theta=theta: component_shares(
                mechanism.forward(theta), components
            ).sum(axis=-3),
            "own weight": lambda at=at: weight_wrench(at, components, gravity, influence(at)),
            "contact operators, 24 sectors": lambda at=at: contact_operators(
                at, components, gravity
            ),
        }
        poses = theta.size // 2
        columns.append({name: microseconds(call) / poses for name, call in calls.items()})

    operators = contact_operators(mechanism.forward(np.array([0.3, -0.4])), components, gravity)
    closed = solve_contact(operators.approach, operators.gap)[1]
    contact = {
        "contact solve, cold": lambda: solve_contact(operators.approach, operators.gap),
        "contact solve, warm": lambda: solve_contact(operators.approach, operators.gap, closed),
    }

    print(f"48 x 48 matrix product: {reference:.2f} us")
    print(f"{'':32} {'one pose':>18} {f'stack of {POSES}':>20}")
    print(f"{'':32} {'us':>9} {'products':>8} {'us/pose':>11} {'products':>8}")
    for name, one in columns[0].items():
        many = columns[1][name]
        print(f"{name:32} {one:9.1f} {one / reference:8.1f} {many:11.2f} {many / reference:8.2f}")
    for name, call in contact.items():
        one = microseconds(call)
        print(f"{name:32} {one:9.1f} {one / reference:8.1f}")
    print(f"sectors closed: {np.count_nonzero(closed)} of {len(closed)}")


if __name__ == "__main__":
    main()
