"""What the error of a prediction is made of: a bound for each contribution.

Each is the difference between two solutions that differ in one thing alone, at random poses of the
map domain under random loads up to the table's range.  Numerical ones are in what the table states
and so in every covariance; those of a wrist that is not built as drawn are a matter of calibration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.free_effects import SHIM_UM
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.lookup.verification import (
    HALVES,
    STATED,
    UNSEEN_SEED,
    random_loads,
    relative_misses,
    unseen_poses,
)
from wrist_stiffness.mechanism.components import (
    ELASTIC,
    JOINTS,
    LINKS,
    PASSIVE_JOINTS,
    Array,
    ElasticComponents,
)
from wrist_stiffness.mechanism.kinematics import angles_text
from wrist_stiffness.mechanism.material import Material
from wrist_stiffness.mechanism.pins import pin_flexibilities
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.simulation.exact import exact_equilibrium

DRAWS, EXACT_DRAWS = 400, 100

STEEL = Material(young=200e9, poisson=0.3, density=7850.0, expansion=11.5e-6)

SECOND_ORDER, SECOND_ORDER_NAME = "second_order", "second order: finite rotations"

STATED_PARTS = {
    "mesh": "finite elements, extrapolated",
    "contact": "flange contact: rings over the width",
    "walls": "sliding walls that lift off",
    SECOND_ORDER: SECOND_ORDER_NAME,
}


@dataclass(frozen=True)
class Contribution:
    """One part of a prediction's error."""

    name: str  # where it comes from
    bound: Mapping[str, float]  # what 99 of 100 poses and loads keep, relative to s and phi
    stated: bool  # whether it is in what the table states


def contributions(table: Table) -> list[Contribution]:
    """Return all contributions of a table, those in its stated error first.

    A part that the table does not state is absent.
    """
    errors, found = table.header.errors, []
    for part, name in STATED_PARTS.items():
        if bound := errors.get(part):
            found.append(Contribution(name, bound, True))
    used = table.header.evaluation == "spline"
    found.append(Contribution("spline", errors["predicted"]["operative"], used))
    poses, loads = _draws(table, DRAWS)
    configuration = table.mechanism.forward(poses)

    def twist(parts: ElasticComponents) -> Array:
        operators = contact_operators(configuration, parts, table.geometry.gravity)
        return respond(operators, loads).twist

    nominal = twist(table.components)
    for name, varied in _tolerances(table):
        misses = [relative_misses(twist(parts), nominal) for parts in varied]
        # Parts are made one by one, so their errors add up as squares do.
        bound = _bound(np.sqrt(np.sum(np.square(misses), axis=0)))
        found.append(Contribution(name, bound, False))
    return found


def second_order(table: Table) -> dict[str, float]:
    """Return how far first order is from the equilibrium of all bodies with finite rotations.

    `table`: the lookup, taken in closed form.  Gives error of s and phi that 99 of 100 poses and
    loads keep, relative to their lengths.  Raises `InputError` where there is no equilibrium.
    """
    poses, loads = _draws(table, EXACT_DRAWS)
    configuration = table.mechanism.forward(poses)
    found = respond(table.operators_at(configuration, "closed_form"), loads).twist
    exact = []
    for theta, load, platform in zip(poses, loads, configuration.platform, strict=True):
        try:
            state = exact_equilibrium(table, theta, load)
        except InputError as error:
            limits, gravity = table.geometry.limits, np.linalg.norm(table.geometry.gravity)
            raise InputError(
                f"the wrist finds no rest at motor angles {angles_text(theta)}: limits.force_N = "
                f"{limits.force:g}, limits.moment_Nm = {limits.moment:g} or a gravity of "
                f"{gravity:g} m/s^2 bends it too far: another unit?"
            ) from error
        exact.append(log_motion(state.rotation @ platform.T, state.shift))
    return _bound(relative_misses(found, np.array(exact)))


def with_second_order(table: Table) -> Table:
    """Return a table that states second order too."""
    bound = second_order(table)
    errors = {**table.header.errors, SECOND_ORDER: bound}
    errors[f"{SECOND_ORDER}_relative"] = worst = max(bound.values())
    errors["stated_relative"] += worst
    return replace(table, header=replace(table.header, errors=errors))


def _draws(table: Table, count: int) -> tuple[Array, Array]:
    poses = unseen_poses(table.workspace)[:count]
    rng = np.random.default_rng(UNSEEN_SEED)
    return poses, random_loads(table.geometry.limits, len(poses), rng)


def _bound(misses: Array) -> dict[str, float]:
    return dict(zip(HALVES, np.quantile(misses, STATED, axis=0).tolist(), strict=True))


def _tolerances(table: Table) -> Iterator[tuple[str, list[ElasticComponents]]]:
    """Wrists with one part off by its limit, as `wrist-stiffness tolerances` assumes it."""
    parts = table.components
    for places, kind in ((LINKS, "link"), (JOINTS, "bushing")):
        law = find_law(f"{kind}_stiffness")
        percent = law.parameters(places[0])[0].scale
        values = {"flexibility_percent": 0.01 * percent}
        yield (
            f"{kind}s {percent:g} % off (assumed)",
            [law.changed(parts, place, values) for place in places],
        )
    if table.geometry.pins is None:
        yield "pins not rigid, of steel (assumed)", [_with_pins(table)]
    gaps = [joint for joint in PASSIVE_JOINTS if joint in parts.contact]
    if gaps:
        yield f"flange gaps {SHIM_UM:g} um off (assumed)", [_wider(parts, each) for each in gaps]


def _with_pins(table: Table) -> ElasticComponents:
    flexibility = table.components.flexibility.copy()
    for link in LINKS:
        flexibility[ELASTIC.index(link)] += sum(pin_flexibilities(table.geometry, link, STEEL))
    return replace(table.components, flexibility=flexibility)


def _wider(parts: ElasticComponents, joint: str) -> ElasticComponents:
    old = parts.contact[joint]
    wider = replace(old, gap=old.gap + 1e-6 * SHIM_UM)
    return replace(parts, contact={**parts.contact, joint: wider})
