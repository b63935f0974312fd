"""How many extra poses tell twins apart: planned ones against random ones.

A virtual cell hides an effect (laws of the simulation, not of the model) and is measured as in the
paper: 25 poses, one load, one approach.  The effects that fit these measurements about as well as
the true one are its class of twins.  `plan` chooses extra settings, each visited from both sides;
where these do not suffice it plans again, five times at most.  The others are random: poses,
sides, and loads of the same list.  Both are performed by the virtual cell, with instruments set up
anew.  Counted are poses (one approach each; the other side is another pose) and measurements at
rest (a planned pose with a load is two, as it is measured without it as well; a random one is one).
A class is resolved from the number on at which every wrong twin lies behind the true one by 25 in
the Bayesian information criterion, noise aside, with everything refitted that a diagnosis refits.
Reference poses and long holds, which a plan has besides, are left out.

    python bench/plan_resolves.py [CASES] [FIRST_SEED]
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace

import numpy as np

from wrist_stiffness.campaign import design_pool, planning
from wrist_stiffness.campaign.design_information import (
    RESOLVED,
    Goal,
    Information,
    Layout,
    MeasurementNoise,
    beyond_nuisances,
    carried_over,
    discrimination,
    information,
)
from wrist_stiffness.campaign.design_pool import draw_settings
from wrist_stiffness.campaign.design_question import (
    SESSION,
    TARE,
    WRIST,
    Question,
    between,
    drawn,
    effect_named,
)
from wrist_stiffness.campaign.design_signatures import Signature, signatures
from wrist_stiffness.campaign.design_timeline import Pace, Timeline, Visit, run_through
from wrist_stiffness.campaign.loads_file import Actuator, AppliedLoad, Weight
from wrist_stiffness.campaign.planning import Conditions, plan
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import catalogue
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import ALL, CATALOGUE, HiddenEffect, places
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise
from wrist_stiffness.simulation.program import Program, Track
from wrist_stiffness.simulation.residual import residual

HIDDEN = (
    "backlash",
    "drive_compliance",
    "mount_compliance",
    "frame_compliance",
    "platform_compliance",
    "gravity",
    "joint_clearance",
    "bushing_hardening",
    "joint_friction",
    "creep",
    "load_misalignment",
    "load_point",
    "encoder_eccentricity",
    "cable_wrench",
)
"""What poses and loads at rest can show, and no diagnosis refits anyway."""

VISIBLE = 6.0
"""Discrimination from nothing that the hidden effect has in the paper's design."""

DECISIVE = 6.0
MOST_TWINS = 5
EXTRA = 40
"""Extra poses at most."""

PLANS = 5
design_pool.POOL = 40
"""Fewer settings than the command has to choose from, to save time."""

planning.fixed_visits = lambda *given: design_pool.fixed_visits(*given)[:1]

RATE_HZ = 5.0
PACE = Pace(float(np.radians(30.0)), 2.0, in_motion=False)
QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))
MODEL = load_model(shipped_file("config/palmieri2015_model.yaml"))
TABLE = MODEL.table
WORKSPACE = TABLE.workspace
MDEG = float(np.radians(1e-3))
NOISE = MeasurementNoise(np.repeat([1e-6, MDEG], 3), TABLE.geometry.limits.encoder_step)
LOADS = (
    Weight("weight", 0.1, np.array([0.02, 0.0, -0.018]), 15.0),
    Actuator(
        "gripper",
        np.repeat([-1.0, -0.01], 3),
        np.repeat([1.0, 0.01], 3),
        np.array([0.0, 0.0, -0.018]),
        True,
        1.0,
    ),
)


def paper_design() -> Timeline:
    """Return 25 poses under 1 N downward, approached from one side."""
    lower, upper = WORKSPACE.rectangle
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    axis = np.linspace(-1.0, 1.0, 5) * 0.5
    zero = np.zeros(3)
    load = AppliedLoad("1 N", np.array([0.0, 0.0, -1.0]), zero, zero, False, False, 1.0)
    visits = [
        Visit(middle + half * np.array([x, y]), np.ones(2), load, True) for x in axis for y in axis
    ]
    return once_each(run_through(visits, WORKSPACE, PACE, np.zeros(2)))


def once_each(timeline: Timeline) -> Timeline:
    """Return the same without the zero-load returns: each visit is measured under its load."""
    loaded = np.abs(timeline.block.load[timeline.rows]).sum(axis=1) > 0.0
    ever = np.array([loaded[timeline.visit == visit].any() for visit in timeline.visit])
    kept = loaded | ~ever
    return replace(
        timeline,
        rows=timeline.rows[kept],
        visit=timeline.visit[kept],
        moving=timeline.moving[kept],
    )


def performed(timeline: Timeline, hidden: HiddenEffect | None) -> np.ndarray:
    """Return residuals (n, 6) at the observed samples of a cell with noiseless sensors."""
    times, angles, loads = (np.array(column) for column in zip(*timeline.knots, strict=True))
    settings = CellSettings(
        rate_hz=RATE_HZ,
        instrument="ideal",
        load_sensor=QUIET,
        hidden=() if hidden is None else (hidden,),
    )
    cell = VirtualCell(TABLE, settings, np.random.default_rng(0))
    still = Track(np.array([0.0, times[-1]]), np.zeros((2, 1)))
    cell.program = Program(Track(times, angles), Track(times, loads), still, times[-1] + 1.0)
    time_s = np.arange(0.0, times[-1], 1.0 / RATE_HZ)
    found = residual(TABLE, cell.run(time_s, cell.desired(time_s)))
    out = np.zeros((len(timeline.block), 6))
    for row in timeline.rows:
        until = timeline.block.time[row]
        out[row] = found[(time_s >= until - 1.0) & (time_s <= until)].mean(axis=0)
    return out


def left_by(timeline: Timeline, hidden: HiddenEffect) -> np.ndarray:
    """Return what the hidden effect leaves at the observed samples, (n, 6)."""
    return performed(timeline, hidden) - performed(timeline, None)


def told(timeline: Timeline, sets: list, truth: str, left: np.ndarray | None) -> Information:
    """Return the Gram matrices with the simulation's effect in place of the model's."""
    known = (*SESSION, *WRIST)
    found = signatures(MODEL, timeline.block, [*((effect_named(n),) for n in known), *sets])
    effects = [each for each in found[len(known) :] if not each.lacks]
    if left is not None:
        effects = [
            replace(each, truths=left[..., None]) if each.name == truth else each
            for each in effects
        ]
    return information(timeline, found[: len(known)], SESSION, effects, TABLE, NOISE)


def behind(gram: np.ndarray, layout: Layout, truth: str, names: list[str]) -> np.ndarray:
    """Return by how much each name lies behind the truth in the criterion, (..., b)."""
    goals = [Goal(truth, name) for name in (truth, *names)]
    squares = discrimination(gram, layout, goals) ** 2
    return squares[..., 1:] - squares[..., :1]


def fitted(known: Information, truth: str, signature: Signature) -> Effect | None:
    """Return an effect with the values that fit the hidden one best, None if out of bounds."""
    left = beyond_nuisances(known.total, known.layout)
    columns, y = known.layout.columns[signature.name], known.layout.truths[truth]
    inner = left[np.ix_(columns, columns)]
    sizes = np.linalg.lstsq(inner + 1e-2 * np.eye(len(inner)), left[np.ix_(columns, y)])[0][:, 0]
    effect, values = signature.effect, {}
    linear = effect.stage != "sensor" and all(p.linear for p in effect.parameters)
    for p, size in zip(effect.parameters, sizes, strict=True):
        base = 0.0 if linear else effect.estimates[p.key].value
        values[p.key] = base + float(size) * p.scale
        if not p.lower <= values[p.key] <= p.upper:
            return None
    return effect.with_values(values)


def resolved_from(
    poor: np.ndarray, extra: Information, counts: np.ndarray, truth: str, twins: list
) -> tuple[float, float]:
    """Return the numbers of poses and measurements from which on the class is resolved."""
    grams = poor + np.cumsum(extra.grams, axis=0)
    good = behind(grams, extra.layout, truth, twins).min(axis=1) >= RESOLVED**2
    if not good[-1]:
        return np.inf, np.inf
    last = int(np.flatnonzero(~good)[-1]) + 1 if not good.all() else 0
    return float(last + 1), float(np.cumsum(counts)[last])


def planned_visits(question: Question, poor: Timeline, seed: int) -> list[Visit]:
    """Return the visits that a plan chooses, none where nothing can be settled."""
    found = plan(MODEL, question, Conditions(LOADS, PACE, NOISE, None, seed), [poor])
    return [v for setting in found.settings for v in setting.visits(PACE.dwell_s)]


def random_visits(seed: int) -> list[Visit]:
    """Return random poses from a random side, under random loads of the list or none."""
    rng = np.random.default_rng([seed, 1])
    settings = draw_settings(WORKSPACE, LOADS, TABLE.geometry.gravity, rng)[:EXTRA]
    return [setting.visits(PACE.dwell_s)[rng.integers(2)] for setting in settings]


def one_case(seed: int, poor: Timeline, poor_model: list[Signature], sets: dict) -> dict | None:
    """Return the numbers of extra measurements of one case, None where it has no twins."""
    rng = np.random.default_rng(seed)
    choices = [place for place in places(CATALOGUE) if place[0] in HIDDEN]
    # Every effect is as likely as any other, however many places it has.
    name = HIDDEN[rng.integers(len(HIDDEN))]
    own = [place for place in choices if place[0] == name]
    effect, component, form = own[rng.integers(len(own))]
    truth = f"{effect}@{component}"
    hidden = HiddenEffect(effect, component, form, ALL[effect].plausible, seed)
    nuisances = poor_model[: len(SESSION) + len(WRIST)]
    rivals = poor_model[len(SESSION) + len(WRIST) :]
    try:
        for _ in range(3):
            left = left_by(poor, hidden)
            effects = [replace(r, truths=left[..., None]) if r.name == truth else r for r in rivals]
            known = information(poor, nuisances, SESSION, effects, TABLE, NOISE)
            size = float(discrimination(known.total, known.layout, [Goal(truth, "")])[0])
            if 0.8 * VISIBLE < size < 1.25 * VISIBLE:
                break
            larger = hidden.magnitude * VISIBLE / max(size, 1e-3)
            if larger > ALL[effect].limit:
                return {"truth": truth, "skip": "too small at its limit"}
            hidden = replace(hidden, magnitude=larger)
    except InputError as error:
        return {"truth": truth, "skip": str(error)[:60]}
    names = [each.name for each in effects]
    margins = dict(zip(names, behind(known.total, known.layout, truth, names), strict=True))
    best = min(margins.values())
    by_name = {each.name: each for each in effects}
    members = sorted(
        (
            name
            for name in names
            if margins[name] - best <= DECISIVE
            and (name == truth or fitted(known, truth, by_name[name]) is not None)
        ),
        key=margins.__getitem__,
    )
    if truth not in members:
        return {
            "truth": truth,
            "skip": f"the paper's design prefers {min(margins, key=margins.get)}",
        }
    members = members[:MOST_TWINS]
    if truth not in members:
        members[-1] = truth
    if len(members) < 2:
        return {"truth": truth, "skip": "no twins"}
    first = fitted(known, truth, by_name[members[0]])
    twins = [name for name in members if name != truth]
    classed = [sets[name] for name in members]
    found: dict = {"truth": truth, "twins": twins}
    if first is None:
        first = effect_named(truth)
    others = [effect_named(name) for name in members[1:]]
    own = [by_name[name] for name in members]
    paper = carried_over(information(poor, nuisances, SESSION, own, TABLE, NOISE), (*SESSION, TARE))

    def resolved(visits: list[Visit], once: bool) -> tuple[float, float]:
        order = np.random.default_rng([seed, 2]).permutation(len(visits))
        timeline = run_through([visits[i] for i in order], WORKSPACE, PACE, np.zeros(2))
        timeline = once_each(timeline) if once else timeline
        extra = told(timeline, classed, truth, left_by(timeline, hidden))
        counts = np.bincount(timeline.visit)[np.argsort(order)]
        extra = Information(extra.grams[np.argsort(order)], extra.layout)
        return resolved_from(paper, extra, counts, truth, twins)

    visits: list[Visit] = []
    found["planned"] = np.inf, np.inf
    for number in range(PLANS):
        question = between([[first, *others]], [], np.random.default_rng([seed, number]))
        added = planned_visits(question, poor, seed + 1000 * number)
        if not added:
            break
        visits = [*visits, *added][:EXTRA]
        found["planned"] = resolved(visits, once=False)
        if np.isfinite(found["planned"][0]):
            break
    if not visits:
        found["skip"] = f"the plan says that no experiment tells it from {', '.join(twins)}"
        return found
    found["random"] = resolved(random_visits(seed), once=True)
    return found


def main() -> None:
    """Run cases and print what they took."""
    warnings.simplefilter("ignore")
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    poor = paper_design()
    rng = np.random.default_rng(99)
    names = [f"{law.id}@{place}" for law in catalogue().values() for place in law.places]
    sets = {n: drawn(effect_named(n), rng) for n in names if n not in (*SESSION, *WRIST)}
    known = [(effect_named(name),) for name in (*SESSION, *WRIST)]
    signs = signatures(MODEL, poor.block, [*known, *sets.values()])
    poor_model = [each for each in signs if not each.lacks]
    done, skipped = [], 0
    while len(done) < wanted:
        found = one_case(seed, poor, poor_model, sets)
        if "skip" in found:
            skipped += 1
            print(f"{seed:4d} {found['truth']:32s} left out: {found['skip']}", flush=True)
        else:
            done.append(found)
            (planned, more), (random, _) = found["planned"], found["random"]
            print(
                f"{seed:4d} {found['truth']:32s} planned {planned:3.0f} poses ({more:3.0f} "
                f"measurements)  random {random:3.0f}  against {', '.join(found['twins'])}",
                flush=True,
            )
        seed += 1
    pairs = np.array([(each["planned"], each["random"]) for each in done])
    settled = np.isfinite(pairs).any(axis=(1, 2))
    print(
        f"{len(done)} cases, {skipped} left out; in {int(np.sum(~settled))} neither the planned "
        f"nor {EXTRA} random extra poses resolve the class, the figures are of the others"
    )
    pairs = pairs[settled]
    for place, what in enumerate(("poses", "measurements")):
        report(pairs[..., place], what)


def report(pairs: np.ndarray, what: str) -> None:
    """Print medians with bootstrap intervals; never resolved counts as twice all poses."""
    capped = np.where(np.isfinite(pairs), pairs, 2.0 * EXTRA)
    rng = np.random.default_rng(0)
    draws = capped[rng.integers(len(capped), size=(4000, len(capped)))]
    for name, column in (("planned", 0), ("random", 1)):
        never = int(np.sum(~np.isfinite(pairs[:, column])))
        print(f"{name:8s} median {np.median(capped[:, column]):4.1f} {what}, never {never}")
    print(
        f"planned / random {what}: median of the cases' ratios "
        f"{_spread(np.median(draws[..., 0] / draws[..., 1], axis=1), capped[:, 0] / capped[:, 1])}"
        f", ratio of the medians "
        f"{np.median(capped[:, 0]) / np.median(capped[:, 1]):.2f} "
        f"({_interval(np.median(draws[..., 0], axis=1) / np.median(draws[..., 1], axis=1))}), "
        f"ratio of the sums {capped[:, 0].sum() / capped[:, 1].sum():.2f} "
        f"({_interval(draws[..., 0].sum(axis=1) / draws[..., 1].sum(axis=1))})"
    )


def _spread(draws: np.ndarray, values: np.ndarray) -> str:
    return f"{np.median(values):.2f} ({_interval(draws)})"


def _interval(draws: np.ndarray) -> str:
    low, high = np.quantile(draws, [0.025, 0.975])
    return f"95 % {low:.2f} to {high:.2f}"


if __name__ == "__main__":
    main()
