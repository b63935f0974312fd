"""Never worse than no correction: `python bench/closed_loop_promise.py [--quick]`.

Episodes of a cell drawn at random (`closed_loop_episodes.py`): pick, carry, insert, jam, press,
collide, lose, swap, with bias, noise, late and lost loads, a gripper that tells or does not, walls
of 0.05 to 100 N/um and a model that is 0.5 to 2 times as soft as the wrist.  Each runs twice, with
the corrector and without, in the elastic truth of `simulation/`.  Judged are

- the true error, as mean over the episode: at most 1.05 times that without correction, where the
  latter counts at least as much as what the rounding to encoder steps leaves on average.  Rounding
  itself is left out of both runs: it would add that much to either, by chance.
- force and couple of contacts, as largest mean over 1 s, twice what it takes until a late load is
  judged and the correction has gone: at most 1.1 times that without correction, and what the
  supervisor cannot see, its threshold.  How hard the first touch is, is printed beside.
- hunting: where nothing but a drift of the sensor has happened for 2 s, the state changes at most
  three times, for a load is weighed once more where the drift has passed the threshold.

Every episode's line goes to --output, and a run with the same file goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from closed_loop_episodes import (
    KINDS,
    RATE_HZ,
    RATIOS,
    TARE_S,
    TOOL_M,
    TOOL_MM,
    Array,
    Script,
    draw,
    stops,
)

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.payload import Payload
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.mechanism.vectors import cross
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.instrument import LoadSensor, NoiseSource

NAMES = ("motor_1_joint", "motor_2_joint")
PERIOD_NS = 1_000_000_000 // RATE_HZ
START_NS = 10_000_000_000
WORSE, HARDER = 1.05, 1.1
MEAN_S = 1.0
MOST_CHANGES = 3
QUICK, BATCH = 56, 56


def with_tool(table: Table, ratio: float) -> Table:
    """Return the wrist with a tool and its parts softer by a ratio."""
    geometry = dict(table.header.geometry)
    geometry["platform"] = {**geometry["platform"], "tool_point_mm": TOOL_MM}
    parts = replace(table.components, flexibility=ratio * table.components.flexibility)
    return replace(table, header=replace(table.header, geometry=geometry), components=parts)


class Corrected:
    """One episode's corrector with its sensor."""

    def __init__(self, script: Script, model: ErrorModel, seed: int) -> None:
        self.script = script
        settings = StreamSettings(objective=script.objective)  # type: ignore[arg-type]
        self.stream = CorrectionStream(model, settings, enabled=False)
        sensor = LoadSensor()
        self._noise = NoiseSource(sensor.force, sensor.moment, np.random.default_rng([seed, 7]))
        self._felt: list[Array] = []
        self.states: list[str] = []
        self.applied: list[Array] = []

    def feel(self, i: int, wrench: Array, rotation: Array) -> None:
        """Let the load of a sample go to the corrector, as the sensor has it."""
        script = self.script
        if script.on_platform:
            wrench = np.concatenate([rotation.T @ wrench[:3], rotation.T @ wrench[3:]])
        noise = script.noise * self._noise(np.array([i / RATE_HZ]))[0]
        self._felt.append(wrench + script.bias[i] + noise)
        # What comes late has its own stamp; what the sensor filters has a stamp that is too young.
        stamped = i - script.arrival_delay
        if stamped < 0 or script.lost[stamped]:
            return
        load = self._felt[max(stamped - script.value_delay, 0)]
        frame = "wrist_platform" if script.on_platform else "wrist_base"
        self.stream.loads.add(START_NS + stamped * PERIOD_NS, frame, load[:3], load[3:])

    def command(self, i: int) -> Array:
        """Return the corrected angles of a sample."""
        script = self.script
        if i == round(TARE_S * RATE_HZ):
            limit = self.stream.settings.supervisor.limit
            self.stream.use_zero(self.stream.loads.measured_zero(limit))
            self.stream.enabled = True
        if i in script.told:
            told = script.told[i]
            self.stream.supervisor.declare_payload(
                told and Payload(told[0], tuple(told[1].tolist()))
            )
        wanted = script.command[i]
        stamp = START_NS + i * PERIOD_NS
        theta = self.stream.on_command(stamp, "", NAMES, wanted.tolist()).theta
        self.states.append(self.stream.supervision.state.value)
        self.applied.append(theta - wanted)
        return theta


def run(table: Table, models: dict[float, ErrorModel], seeds: list[int]) -> list[dict[str, object]]:
    """Return a line for each seed."""
    scripts = [draw(table, seed) for seed in seeds]
    n, length = len(scripts), len(scripts[0].command)
    correctors = [
        Corrected(script, models[script.ratio], seed)
        for script, seed in zip(scripts, seeds, strict=True)
    ]
    both = stops(scripts + scripts)
    gravity = table.geometry.gravity
    centre = np.array([script.centre for script in scripts + scripts])
    rotation = np.repeat(np.eye(3)[None], 2 * n, axis=0)
    errors, push = np.zeros((length, 2 * n)), np.zeros((length, 2 * n, 2))
    pointing = np.array([script.objective == "pointing" for script in scripts + scripts])
    for i in range(length):
        wanted = np.array([script.command[i] for script in scripts])
        angles = np.concatenate([[each.command(i) for each in correctors], wanted])
        force = np.array([script.mass[i] for script in scripts] * 2)[:, None] * gravity
        arm = (rotation @ centre[..., None])[..., 0] if i else centre
        load = np.concatenate([force, cross(arm, force)], axis=1)
        there = np.array([script.there[i] for script in scripts] * 2)
        rotation, shift, wrench = both.settle(table, angles, load, there)
        for each, total, turned in zip(correctors, load + wrench, rotation, strict=False):
            each.feel(i, total, turned)
        rigid = table.mechanism.forward(wanted).platform
        off = rotation - np.concatenate([rigid, rigid])
        tool = TOOL_M * off[:, :, 2] + shift
        errors[i] = np.linalg.norm(np.where(pointing[:, None], off[:, :, 2], tool), axis=1)
        push[i] = np.linalg.norm(wrench[:, :3], axis=1)[:, None] * [1, 0]
        # A wall's moment about O is no couple.
        couple = np.any(both.about, axis=1) * np.linalg.norm(wrench[:, 3:], axis=1)
        push[i, :, 1] = couple
    begin = round(TARE_S * RATE_HZ)
    mean = errors[begin:].mean(axis=0)
    width = round(MEAN_S * RATE_HZ)
    total = np.cumsum(np.concatenate([np.zeros((1, 2 * n, 2)), push]), axis=0)
    steady = np.max((total[width:] - total[:-width]) / width, axis=0)
    return [
        judged(seed, each, mean[[k, n + k]], steady[[k, n + k]], push[:, [k, n + k]].max(axis=0))
        for k, (seed, each) in enumerate(zip(seeds, correctors, strict=True))
    ]


def judged(
    seed: int, each: Corrected, mean: Array, steady: Array, peak: Array
) -> dict[str, object]:
    """Return the line of one episode."""
    script, limit = each.script, each.stream.settings.supervisor.limit
    scatter = each.stream.supervisor.scatter
    unseen = [max(limit.force, scatter.force), max(limit.moment, scatter.moment)]
    step = each.stream.model.table.geometry.limits.encoder_step  # type: ignore[union-attr]
    # Mean length of two rounding errors, each uniform within half a step.
    floor = 0.765 * step / 2.0 * (1.0 if script.objective == "pointing" else TOOL_M)
    harder = float(np.max(steady[0] / (HARDER * steady[1] + unseen)))
    changes = switches(each.states, script.quiet)
    moved = np.array(each.applied)[script.quiet]
    return {
        "seed": seed,
        "kind": script.kind,
        "ratio": round(script.ratio, 3),
        "objective": script.objective,
        "with": float(mean[0]),
        "without": float(mean[1]),
        "worse": float(mean[0] / max(mean[1], floor)),
        "force": steady[:, 0].tolist(),
        "couple": steady[:, 1].tolist(),
        "peak": peak.ravel().tolist(),
        "harder": harder,
        "switches": sum(a != b for a, b in zip(each.states, each.states[1:], strict=False)),
        "hunts": changes,
        "moved": float(np.ptp(moved, axis=0).max()) if len(moved) else 0.0,
        "stiffness": float(script.stop["stiffness"]),
        "said": sorted(set(each.states)),
        "holding": float(np.mean([state == "holding" for state in each.states])),
    }


def switches(states: list[str], quiet: np.typing.NDArray[np.bool_]) -> int:
    """Return the largest number of changes of the state in one stretch of quiet."""
    most = now = 0
    for before, state, still in zip(states, states[1:], quiet[1:], strict=False):
        now = now + (before != state) if still else 0
        most = max(most, now)
    return most


def broken(line: dict[str, object]) -> bool:
    """Tell whether an episode breaks the promise."""
    return line["worse"] > WORSE or line["harder"] > 1.0 or line["hunts"] > MOST_CHANGES  # type: ignore[operator]


def report(lines: list[dict[str, object]]) -> None:
    """Print the table and the worst episodes."""
    print("kind      episodes  broken  error/without: mean   worst  push/allowed: worst  hunts")
    for kind in (*KINDS, "all"):
        some = [each for each in lines if kind in ("all", each["kind"])]
        if not some:
            continue
        worse = np.array([each["worse"] for each in some])
        harder = max(each["harder"] for each in some)
        hunts = sum(each["hunts"] > MOST_CHANGES for each in some)  # type: ignore[operator]
        # Errors of the tool point as angles, so that they add up.
        arm = np.array([1.0 if each["objective"] == "pointing" else TOOL_M for each in some])
        both = [np.array([each[name] for each in some]) / arm for name in ("with", "without")]
        total = both[0].sum() / both[1].sum()
        print(
            f"{kind:8}  {len(some):8d}  {sum(map(broken, some)):6d}  {total:19.2f}  "
            f"{worse.max():6.2f}  {harder:19.2f}  {hunts:5d}"
        )
    peaks = np.array([each["peak"] for each in lines]).reshape(-1, 2, 2).max(axis=2)
    met = peaks[:, 1] > 0.0
    if met.any():
        ratio = np.percentile(peaks[met, 0] / peaks[met, 1], [50.0, 95.0, 100.0])
        print(
            "first touch, largest push of one sample over that without correction, where there is"
        )
        print(f"one: median {ratio[0]:.2f}, 95 % {ratio[1]:.2f}, largest {ratio[2]:.2f}")
    for name in ("worse", "harder", "hunts"):
        print(f"worst by {name}:")
        for each in sorted(lines, key=lambda line: -line[name])[:5]:  # type: ignore[operator]
            print(
                f"  seed {each['seed']:5d} {each['kind']:8} ratio {each['ratio']:5.3f} "
                f"{each['objective']:10} error/without {each['worse']:.3f} "
                f"push/allowed {each['harder']:.2f} switches {each['switches']} "
                f"in quiet {each['hunts']}"
            )


def main() -> int:
    """Run what is missing, print all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} episodes")
    parser.add_argument("--episodes", type=int, default=2100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--output", type=Path, help="lines of the episodes (JSON)")
    options = parser.parse_args()
    count = QUICK if options.quick else options.episodes
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    table = with_tool(model.table, 1.0)
    models = {ratio: replace(model, table=with_tool(model.table, ratio)) for ratio in RATIOS}
    lines: list[dict[str, object]] = []
    if options.output and options.output.exists():
        lines = [json.loads(line) for line in options.output.read_text().splitlines()]
    done = {line["seed"] for line in lines}
    wanted = [seed for seed in range(options.first, options.first + count) if seed not in done]
    for start in range(0, len(wanted), BATCH):
        found = run(table, models, wanted[start : start + BATCH])
        lines += found
        if options.output:
            with options.output.open("a") as stream:
                stream.writelines(json.dumps(line) + "\n" for line in found)
    report(lines)
    return int(any(map(broken, lines)))


if __name__ == "__main__":
    sys.exit(main())
