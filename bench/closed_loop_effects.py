"""The loop closed on the true error: `python bench/closed_loop_effects.py FILE [--told] [NAME …]`.

For each effect of the catalogue, hidden in the virtual wrist: a session is recorded, diagnosed, the
model extended with what the diagnosis names, and the corrector drives the wrist on new motions with
the old and with the extended model.  With `--told` nothing is diagnosed and the model is extended
with the true name, which takes a tenth of the time.  NAMEs (`backlash@motor_1:single`) choose some
effects; what FILE (JSON lines) has already is not done again.  The table goes to
`docs/closed-loop.md`.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop_drive import Motion
from closed_loop_page import write_page

from wrist_stiffness.campaign.fitting.calibrate import calibrate
from wrist_stiffness.campaign.fitting.extend import extend
from wrist_stiffness.campaign.fitting.free_effects import BUILT, SET_UP
from wrist_stiffness.campaign.measured_session import MeasuredSession
from wrist_stiffness.campaign.searching.candidates import compensable
from wrist_stiffness.campaign.searching.diagnose import diagnose_sessions
from wrist_stiffness.diagnosis import Settings
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument
from wrist_stiffness.simulation.size import Scale
from wrist_stiffness.workflows.simulate import hide

HIDDEN = (
    *("backlash@motor_1:single", "joint_clearance@joint_1:algebraic"),
    *("drive_compliance@motor_1:linear", "encoder_eccentricity@motor_1:once"),
    *("thermal_expansion@link_1:linear", "joint_friction@joint_2:coulomb"),
    *("creep@joint_1:standard_solid", "bushing_stiffness@joint_1:plain"),
    *("load_scale@load_sensor:scale", "axis_misalignment@joint_2:plain"),
    *("cable_wrench@platform:smooth", "gravity@platform:mass", "link_stiffness@link_1:uniform"),
    *("transmission_error@motor_1:single", "mount_compliance@motor_1:plain"),
    *("encoder_offset@motor_1:plain", "load_point@load_sensor:frame"),
    *("bushing_hardening@joint_1:saturating", "thermal_softening@joint_1:exponential"),
    *("flange_contact@joint_2:open", "platform_compliance@platform:plain"),
    *("frame_compliance@frame:plain", "inertia@platform:plain", "drift@pose_sensor:linear"),
    *("load_bias@load_sensor:constant", "load_misalignment@load_sensor:plain"),
    *("time_delay@pose_sensor:plain", "measurement_frame@pose_sensor:plain"),
    "target_mounting@pose_sensor:plain",
    *("backlash@motor_2:train", "joint_clearance@joint_3:exponential"),
    *("joint_friction@joint_3:stribeck", "creep@joint_1:power_law"),
    *("cable_wrench@platform:rubbing", "thermal_expansion@frame:quadratic"),
    *("drive_compliance@motor_2:stiffening", "transmission_error@motor_2:train"),
    *("encoder_eccentricity@motor_2:twice", "gravity@platform:tilt"),
    *("time_delay@load_sensor:plain", "time_delay@motor_1:plain"),
)
"""One place of each effect, then more where forms differ."""

SIZES = (3.0, 1.0, 0.5)
"""Of the effect, in units of one sample's noise: the first that it can have, else its limit."""

RECORDED = CellSettings(rate_hz=10.0, program_seconds=120.0, program_seed=101)
NEW = CellSettings(rate_hz=20.0, program_seconds=60.0, program_seed=202)
"""What is recorded, and the new motions: other poses, loads and days."""

SLOW = ("thermal_expansion", "thermal_softening")
SLOW_RATE_HZ, SLOW_TIMES = 2.0, 10.0
"""Parts warm within ten minutes: their experiments take so many times longer."""

SETTINGS = Settings(permutations=299)
SEED = 5
TARE = "load_bias"
COMMISSIONED = tuple(law for law, _ in (*SET_UP, *BUILT) if law != TARE)
"""The wrist was commissioned before the effect came: only the tare is fitted anew, and the hidden
effect where it is one of these."""


def recorded(table: Table, settings: CellSettings, calibrated: tuple[str, ...]) -> MeasuredSession:
    """Return what a recording holds; `calibrated` says which registrations are known."""
    cell = VirtualCell(table, settings, np.random.default_rng(SEED))
    time_s = np.arange(round(settings.program_seconds * settings.rate_hz)) / settings.rate_hz
    sample = cell.run(time_s, cell.desired(time_s))
    warm = dict(zip(SENSED, sample.temperature.T, strict=True))
    block = Block(time_s, sample.encoder, sample.wrench, temperatures=warm)
    scatter = np.diag(instrument(settings.instrument).sigma ** 2)
    return MeasuredSession(
        "recorded",
        block,
        sample.measured_shift,
        sample.measured_rotation,
        scatter,
        notes={"calibrated": list(calibrated)},
    )


def extended(
    model: ErrorModel, session: MeasuredSession, names: list[str]
) -> tuple[ErrorModel, list[str]]:
    """Return what a user makes of names: one after the other is added, or calibrated."""
    added = []
    for full in names:
        name, _, place = full.partition("@")
        if name in (*COMMISSIONED, TARE):
            continue
        model = extend(model, Effect(find_law(name), place), [session]).model
        added.append(full)
    if not added:
        return calibrate(model, [session]).model, ["calibrate"]
    return model, added


def paced(settings: CellSettings, effect: str) -> CellSettings:
    """Return an experiment that is long enough for an effect."""
    if effect not in SLOW:
        return settings
    seconds = SLOW_TIMES * settings.program_seconds
    return replace(settings, rate_hz=SLOW_RATE_HZ, program_seconds=seconds)


def hidden(name: str, table: Table) -> tuple[CellSettings, float]:
    """Return the settings of the recording with an effect, and its size."""
    settings = paced(RECORDED, name.partition("@")[0])
    for size in SIZES:
        try:
            return hide(name, size, table, settings, settings.program_seconds), size
        except InputError:
            continue
    effect, component, form = name.replace(":", "@").split("@")
    largest = HiddenEffect(effect, component, form, CATALOGUE[effect].limit, settings.program_seed)
    size = Scale(table, settings, settings.program_seconds).size(largest)
    return replace(settings, hidden=(largest,)), size


def loop(name: str, model: ErrorModel, told: bool) -> dict[str, Any]:
    """Close the loop on one effect and return what the table needs."""
    start = time.perf_counter()
    table = model.table
    settings, size = hidden(name, table)
    effect, _, place = name.partition("@")
    component = place.partition(":")[0]
    session = recorded(table, settings, tuple(each for each in COMMISSIONED if each != effect))
    findings: list[list[str]] = []
    if not told:
        chance = np.random.default_rng(SEED)
        result = diagnose_sessions(model, [session], chance, SETTINGS).diagnosis
        findings = [list(finding.names) for finding in result.findings]
    names = [f"{effect}@{component}"] if told else [each[0] for each in findings]
    better, added = extended(model, session, names)
    new_motions = replace(paced(NEW, effect), hidden=settings.hidden)
    motion = Motion(table, new_motions, new_motions.program_seconds, SEED + 1)
    old, new = motion.corrected(model), motion.corrected(better)
    rows = {
        "floor": motion.floor(),
        "without": motion.uncorrected(),
        "old": motion.driven(old),
        "extended": motion.driven(new),
        "ideal": motion.ideal(new),
    }
    return {
        "name": name,
        "magnitude": settings.hidden[0].magnitude,
        "unit": CATALOGUE[effect].unit,
        "size": size,
        "told": told,
        "findings": findings,
        "added": added,
        "compensable": compensable(find_law(effect), component),
        "faults": new.faults[:3],
        "seconds": time.perf_counter() - start,
        **{key: asdict(left) for key, left in rows.items()},
    }


def main() -> None:
    """Close the loop on what is not in the results yet, and write the page."""
    arguments = [each for each in sys.argv[1:] if each != "--told"]
    if not arguments:
        raise SystemExit(__doc__)
    told, results = "--told" in sys.argv, Path(arguments[0])
    lines = results.read_text().splitlines() if results.exists() else []
    done = {(row["name"], row["told"]): row for row in map(json.loads, lines)}
    model = load_model(shipped_file("config/palmieri2015_model.yaml"))
    for name in arguments[1:] or HIDDEN:
        if (name, told) in done:
            continue
        row = done[name, told] = loop(name, model, told)
        with results.open("a") as file:
            file.write(json.dumps(row) + "\n")
        short = {key: round(float(1e3 * np.degrees(row[key]["resting"])), 2) for key in ROWS}
        print(f"{name}: {row['findings']}, {short} mdeg, {row['seconds']:.0f} s", flush=True)
    write_page(
        [
            done.get((n, False)) or done[n, True]
            for n in HIDDEN
            if {(n, False), (n, True)} & done.keys()
        ]
    )


ROWS = ("floor", "without", "old", "extended", "ideal")


if __name__ == "__main__":
    main()
