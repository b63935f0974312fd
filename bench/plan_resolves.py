"""How many extra poses tell twins apart: planned ones against random ones.

A virtual cell hides an effect (laws of the simulation, not of the model) and is measured as in the
paper: 25 poses, one load, one approach; it is made so large that its own law is worth its
parameters there.  The effects that fit these measurements about as well, and are worth theirs, are
its class of twins.  `plan` chooses extra approaches; where these do not suffice, what is still open
is fitted anew to all measurements and planned for again, five times at most.  The others are
random: poses, sides, and loads of the same list.  Both are performed by the virtual cell, with
instruments set up anew.  Counted are poses (one approach each; the other side is another pose) and
measurements at rest (a planned pose with a load is two, as it is measured without it as well; a
random one is one, and in a third arm two likewise).
A class is resolved from the number on at which every wrong twin lies behind the true one by 25 in
the Bayesian information criterion, noise aside, with everything refitted that a diagnosis refits.
Reference poses and long holds, which a plan has besides, are left out.

    python bench/plan_resolves.py [CASES] [FIRST_SEED]
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass, replace

import numpy as np
from plan_resolves_report import report

from wrist_stiffness.campaign.planning import plan as planning
from wrist_stiffness.campaign.planning import pool
from wrist_stiffness.campaign.planning.information import (
    CHARGE,
    FREE,
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
from wrist_stiffness.campaign.planning.loads_file import Actuator, AppliedLoad, Weight
from wrist_stiffness.campaign.planning.plan import Conditions, plan
from wrist_stiffness.campaign.planning.pool import draw_settings
from wrist_stiffness.campaign.planning.question import (
    SESSION,
    TARE,
    WRIST,
    Question,
    between,
    drawn,
    effect_named,
)
from wrist_stiffness.campaign.planning.signatures import Signature, signatures
from wrist_stiffness.campaign.planning.timeline import Pace, Timeline, Visit, run_through
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
"""Discrimination from nothing that the hidden effect has in the paper's design, beyond what its
law's parameters cost: a diagnosis finds it."""

DECISIVE = 6.0
MOST_TWINS = 5
EXTRA = 40
"""Extra poses at most."""

PLANS = 5
STEPS = 5
LONGEST_STEP = 1.0
ARMS = ("planned", "random", "random with returns")
pool.POOL = 40
"""Fewer settings than the command has to choose from, to save time."""

planning.fixed_visits = lambda *given: pool.fixed_visits(*given)[:1]
planning._Pool.fixed_gram = lambda _, grams: np.zeros(grams.shape[1:])
"""Reference poses and holds are left out of what is measured, so of the plan's reckoning too."""

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


@dataclass(frozen=True, eq=False)
class Measured:
    """What an experiment has measured, (n, 6), and what nuisances leave in it."""

    timeline: Timeline
    nuisances: list[Signature]
    left: np.ndarray


def told(timeline: Timeline, sets: list, truth: str, left: np.ndarray) -> tuple[Information, list]:
    """Return Gram matrices with the simulation's effect in place of the model's, and nuisances."""
    known = (*SESSION, *WRIST)
    found = signatures(MODEL, timeline.block, [*((effect_named(n),) for n in known), *sets])
    effects = [each for each in found[len(known) :] if not each.lacks]
    effects = [
        replace(each, truths=left[..., None]) if each.name == truth else each for each in effects
    ]
    nuisances = found[: len(known)]
    return information(timeline, nuisances, SESSION, effects, TABLE, NOISE), nuisances


def behind(gram: np.ndarray, layout: Layout, truth: str, names: list[str]) -> np.ndarray:
    """Return by how much each name lies behind the truth in the criterion, (..., b)."""
    goals = [Goal(truth, name) for name in (truth, *names)]
    squares = discrimination(gram, layout, goals) ** 2
    return squares[..., 1:] - squares[..., :1]


def worth_its_parameters(known: Information, truth: str, name: str) -> bool:
    """Tell whether the criterion prefers an effect to nothing for what the truth left."""
    left = beyond_nuisances(known.total, known.layout)
    columns, y = known.layout.columns[name], known.layout.truths[truth]
    inner = left[np.ix_(columns, columns)] + np.eye(len(columns)) / FREE**2
    cross = left[np.ix_(columns, y)]
    return float((cross.T @ np.linalg.solve(inner, cross)).item()) > CHARGE * len(columns)


def in_bounds(gram: np.ndarray, layout: Layout, truth: str, signature: Signature) -> bool:
    """Tell whether about such values fit the hidden effect best as its law allows."""
    left = beyond_nuisances(gram, layout)
    columns, y = layout.columns[signature.name], layout.truths[truth]
    inner = left[np.ix_(columns, columns)] + np.eye(len(columns)) / FREE**2
    sizes = np.linalg.solve(inner, left[np.ix_(columns, y)])[:, 0]
    effect = signature.effect
    linear = effect.stage != "sensor" and all(p.linear for p in effect.parameters)
    return all(
        p.lower <= (0.0 if linear else effect.estimates[p.key].value) + size * p.scale <= p.upper
        for p, size in zip(effect.parameters, sizes, strict=True)
    )


def fitted(data: list[Measured], effect: Effect) -> Effect:
    """Return an effect with the values that fit all data best, by Gauss's method."""
    scale = np.array([p.scale for p in effect.parameters])
    lower, upper = np.array([(p.lower, p.upper) for p in effect.parameters]).T
    for _ in range(STEPS):
        gram = np.zeros(())
        for measured in data:
            (own,) = signatures(MODEL, measured.timeline.block, [(effect,)])
            own = replace(own, truths=measured.left[..., None] - own.truths)
            known = information(measured.timeline, measured.nuisances, SESSION, [own], TABLE, NOISE)
            gram = gram + carried_over(known, (*SESSION, TARE))
        left = beyond_nuisances(gram, known.layout)
        values = np.array([effect.estimates[p.key].value for p in effect.parameters])
        step = np.linalg.solve(
            left[:-1, :-1] + np.eye(len(values)) / FREE**2,
            left[:-1, -1] - values / scale / FREE**2,
        )
        step *= min(1.0, LONGEST_STEP / np.abs(step).max())
        values = np.clip(values + scale * step, lower, upper)
        effect = effect.with_values(
            {p.key: float(v) for p, v in zip(effect.parameters, values, strict=True)}
        )
    return effect


def resolved_from(
    poor: np.ndarray, extra: Information, timeline: Timeline, truth: str, twins: list
) -> tuple[float, float]:
    """Return the numbers of poses and measurements from which on the class is resolved."""
    grams = poor + np.cumsum(extra.grams, axis=0)
    good = behind(grams, extra.layout, truth, twins).min(axis=1) >= RESOLVED**2
    if not good[-1]:
        return np.inf, np.inf
    last = int(np.flatnonzero(~good)[-1]) + 1 if not good.all() else 0
    return float(last + 1), float(np.cumsum(np.bincount(timeline.visit))[last])


def planned_visits(question: Question, earlier: list[Timeline], seed: int) -> list[Visit]:
    """Return the visits that a plan chooses, none where nothing can be settled."""
    return list(plan(MODEL, question, Conditions(LOADS, PACE, NOISE, None, seed), earlier).visits)


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
            wanted = np.sqrt(VISIBLE**2 + CHARGE * len(known.layout.columns[truth]))
            if 0.8 * wanted < size < 1.25 * wanted:
                break
            larger = hidden.magnitude * wanted / max(size, 1e-3)
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
            and worth_its_parameters(known, truth, name)
            and (name == truth or in_bounds(known.total, known.layout, truth, by_name[name]))
        ),
        key=margins.__getitem__,
    )
    if truth not in members:
        return {"truth": truth, "skip": "not in the class that the paper's design leaves"}
    members = members[:MOST_TWINS]
    if truth not in members:
        members[-1] = truth
    if len(members) < 2:
        return {"truth": truth, "skip": "no twins"}
    twins = [name for name in members if name != truth]
    own = [by_name[name] for name in members]
    paper = carried_over(information(poor, nuisances, SESSION, own, TABLE, NOISE), (*SESSION, TARE))
    found: dict = {"truth": truth, "twins": twins, "planned": (np.inf, np.inf)}
    rounds: list[list[Visit]] = []
    data, gram, layout = [Measured(poor, nuisances, left)], known.total, known.layout
    for number in range(PLANS):
        left_over = still_open(gram, layout, truth, members, data, sets)
        if len(left_over) < 2:
            break
        question = between([left_over], [], np.random.default_rng([seed, number]))
        added = planned_visits(question, [each.timeline for each in data], seed + 1000 * number)
        if not added:
            break
        order = np.random.default_rng([seed, 2, number]).permutation(len(added))
        rounds.append([added[i] for i in order])
        visits = [visit for each in rounds for visit in each][:EXTRA]
        timeline = run_through(visits, WORKSPACE, PACE, np.zeros(2))
        measured = left_by(timeline, hidden)
        extra, own = told(timeline, [sets[name] for name in members], truth, measured)
        found["planned"] = resolved_from(paper, extra, timeline, truth, twins)
        if np.isfinite(found["planned"][0]) or len(visits) == EXTRA:
            break
        data = [data[0], Measured(timeline, own, measured)]
        gram, layout = paper + extra.total, extra.layout
    timeline = run_through(random_visits(seed), WORKSPACE, PACE, np.zeros(2))
    left, classed = left_by(timeline, hidden), [sets[name] for name in members]
    for name, measured in (("random", once_each(timeline)), ("random with returns", timeline)):
        extra, _ = told(measured, classed, truth, left)
        found[name] = resolved_from(paper, extra, measured, truth, twins)
    return found


def still_open(
    gram: np.ndarray,
    layout: Layout,
    truth: str,
    members: list[str],
    data: list[Measured],
    sets: dict,
) -> list[Effect]:
    """Return what a diagnosis of all data would leave, best first and with the values found."""
    margins = dict(zip(members, behind(gram, layout, truth, members), strict=True))
    best = min(margins.values())
    kept = sorted(
        (name for name in members if margins[name] - best < RESOLVED**2), key=margins.__getitem__
    )
    return [fitted(data, sets[kept[0]][0]), *(effect_named(name) for name in kept[1:])]


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
        try:
            found = one_case(seed, poor, poor_model, sets)
        except InputError as error:
            found = {"truth": "", "skip": str(error)[:60]}
        if "skip" in found:
            skipped += 1
            print(f"{seed:4d} {found['truth']:32s} left out: {found['skip']}", flush=True)
        else:
            done.append(found)
            figures = "  ".join(
                f"{arm} {found[arm][0]:3.0f} ({found[arm][1]:3.0f})" for arm in ARMS
            )
            print(f"{seed:4d} {found['truth']:32s} {figures}  against {', '.join(found['twins'])}")
            sys.stdout.flush()
        seed += 1
    pairs = np.array([[each[arm] for arm in ARMS] for each in done])
    settled = np.isfinite(pairs).any(axis=(1, 2))
    print(
        f"{len(done)} cases, {skipped} left out; in {int(np.sum(~settled))} neither the planned "
        f"nor {EXTRA} random extra poses resolve the class, the figures are of the others"
    )
    pairs = pairs[settled]
    for place, what in enumerate(("poses", "measurements")):
        report(pairs[:, [0, 1], place], what, 2.0 * EXTRA)
    report(pairs[:, [0, 2], 0], "poses, random ones measured without load as well", 2.0 * EXTRA)


if __name__ == "__main__":
    main()
