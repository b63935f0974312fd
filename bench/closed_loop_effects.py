"""The loop closed on the true error: `python bench/closed_loop_effects.py FILE [HOW] [NAME ...]`.

For each effect of the catalogue, hidden in the virtual wrist: a session is recorded, diagnosed, the
model extended with what the diagnosis names, and the corrector drives the wrist on new motions with
the old and with the extended model.  HOW is

    --told        nothing is diagnosed, the model is extended with the true name
    --wrong-base  stiffness, axes, load scale and registrations are other than the table says; the
                  wrist is recorded and calibrated before the effect comes

NAMEs (`backlash@motor_1:single`) choose some effects.  What FILE (JSON lines) has already is not
done again, so a run that was stopped goes on.  Tables go to `bench-results/closed-loop.md`, the
picture to `docs/pictures/closed-loop.png`.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from closed_loop_drive import Corrected, Motion, cell_of
from closed_loop_page import write_page

from wrist_stiffness.identification.calibration import calibrate, said_calibrated
from wrist_stiffness.identification.candidates import compensable
from wrist_stiffness.identification.extension import extend
from wrist_stiffness.identification.free_effects import commissioning
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.lookup.table import Table
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.refitted import BUILT, SET_UP
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.catalogue import CATALOGUE, HiddenEffect
from wrist_stiffness.simulation.cell import SENSED, CellSettings
from wrist_stiffness.simulation.instrument import instrument
from wrist_stiffness.simulation.size import Scale

HIDDEN = (
    *("backlash@motor_1:single", "joint_clearance@joint_1:algebraic"),
    *("drive_compliance@motor_1:linear", "encoder_eccentricity@motor_1:once"),
    *("transmission_error@motor_1:single", "encoder_offset@motor_1:plain"),
    *("bushing_stiffness@joint_1:plain", "link_stiffness@link_1:uniform"),
    *("mount_compliance@motor_1:plain", "frame_compliance@frame:plain"),
    *("platform_compliance@platform:plain", "axis_misalignment@joint_2:plain"),
    *("flange_contact@joint_2:open", "bushing_hardening@joint_1:saturating"),
    *("joint_friction@joint_2:coulomb", "creep@joint_1:standard_solid"),
    *("gravity@platform:mass", "cable_wrench@platform:smooth", "inertia@platform:plain"),
    *("thermal_expansion@link_1:linear", "thermal_softening@joint_1:exponential"),
    *("load_bias@load_sensor:constant", "load_scale@load_sensor:scale"),
    "load_cross_talk@load_sensor:plain",
    *("load_misalignment@load_sensor:plain", "load_point@load_sensor:frame"),
    *("time_delay@load_sensor:plain", "time_delay@motor_1:plain"),
    *("time_delay@pose_sensor:plain", "drift@pose_sensor:linear"),
    *("measurement_frame@pose_sensor:plain", "target_mounting@pose_sensor:plain"),
    *("bushing_stiffness@joint_1:plain*30", "link_stiffness@link_1:uniform*20"),
    *("mount_compliance@motor_1:plain*15", "platform_compliance@platform:plain*25"),
    *("gravity@platform:mass*30", "cable_wrench@platform:smooth*20"),
    *("load_misalignment@load_sensor:plain*10", "load_bias@load_sensor:constant*100"),
)
"""One place of each effect; three of `time_delay`, which is a different thing at each; then some so
large that a pointing error shows which five times the typical magnitude does not make."""

ON_WRONG_BASE = (
    *("backlash@motor_1:single", "drive_compliance@motor_1:linear"),
    *("transmission_error@motor_1:single", "encoder_eccentricity@motor_1:once"),
    *("mount_compliance@motor_1:plain", "gravity@platform:mass"),
    *("joint_clearance@joint_1:algebraic", "joint_friction@joint_2:coulomb"),
)

FAULT = 5.0
"""A fault is so many times what the catalogue calls plausible, unless its name ends in another
number."""

RECORDED = CellSettings(rate_hz=10.0, program_seconds=120.0, program_seed=1101)
HEALTHY = replace(RECORDED, program_seconds=240.0, program_seed=1303)
NEW = CellSettings(rate_hz=20.0, program_seconds=60.0, program_seed=1202)
"""What is recorded, what a wrong base is calibrated with, and the new motions: other poses, loads
and rooms."""

SLOW = ("thermal_expansion", "thermal_softening")
SLOW_RATE_HZ, SLOW_TIMES = 4.0, 5.0
RECORDED_K, NEW_K = 10.0, 7.0
"""Parts warm within minutes: their experiments take so many times longer, and the room warms by so
much."""

BASE_SEED = 1001
SEED = 5
TARE = "load_bias"
COMMISSIONED = tuple(law for law, _ in (*SET_UP, *BUILT) if law != TARE)
"""On the exact base the wrist was commissioned before the effect came: only the tare is fitted
anew, and the hidden effect where it is one of these."""

Row = dict[str, Any]


def recorded(
    table: Table, settings: CellSettings, calibrated: tuple[str, ...], warm_up_K: float = 0.0
) -> MeasuredSession:
    """Return what a recording holds; `calibrated` says which registrations are known."""
    cell = cell_of(table, settings, SEED, warm_up_K)
    time_s = np.arange(round(settings.program_seconds * settings.rate_hz)) / settings.rate_hz
    sample = cell.run(time_s, cell.desired(time_s))
    warm = dict(zip(SENSED, sample.temperature.T, strict=True))
    return MeasuredSession(
        f"day_{settings.session + 1}",
        Block(time_s, sample.encoder, sample.wrench, sample.speed, temperatures=warm),
        sample.measured_shift,
        sample.measured_rotation,
        np.diag(instrument(settings.instrument).sigma ** 2),
        notes={"calibrated": list(calibrated)},
    )


def extended(
    model: ErrorModel, session: MeasuredSession, names: list[str]
) -> tuple[ErrorModel, list[str]]:
    """Return what a user makes of names: one after the other is added, or calibrated."""
    refitted = {free.effect.name for free in commissioning(model, said_calibrated([session]))[0]}
    added = [each for each in names if each not in refitted]
    for full in added:
        name, _, place = full.partition("@")
        model = extend(model, Effect(find_law(name), place), [session]).model
    if not added:
        return calibrate(model, [session]).model, ["calibrate"]
    return model, added


def paced(settings: CellSettings, effect: str) -> CellSettings:
    """Return an experiment that is long enough for an effect."""
    if effect not in SLOW:
        return settings
    seconds = SLOW_TIMES * settings.program_seconds
    return replace(settings, rate_hz=SLOW_RATE_HZ, program_seconds=seconds)


def fault(name: str) -> HiddenEffect:
    """Return the hidden effect of a name."""
    place, _, times = name.partition("*")
    effect, component, form = place.replace(":", "@").split("@")
    entry = CATALOGUE[effect]
    magnitude = min(float(times or FAULT) * entry.plausible, entry.limit)
    return HiddenEffect(effect, component, form, magnitude, RECORDED.program_seed)


class Loop:
    """One effect on one base: what was recorded, and the new motions.

    Parameters
    ----------
    name : str
        `effect@component:form`.
    model : ErrorModel
        What is known of the wrist before.
    base : str
        `exact` or `wrong`.
    """

    def __init__(self, name: str, model: ErrorModel, base: str) -> None:
        self.effect, _, place = name.partition("@")
        self.component = place.partition(":")[0]
        self.name, self.base, self.table = name, base, model.table
        self.hidden = fault(name)
        known: dict[str, Any] = {"base": base, "base_seed": BASE_SEED}
        self.settings = replace(
            paced(RECORDED, self.effect), hidden=(self.hidden,), session=1, **known
        )
        warm, warm_new = (RECORDED_K, NEW_K) if self.effect in SLOW else (0.0, 0.0)
        if base == "exact":
            calibrated = tuple(each for each in COMMISSIONED if each != self.effect)
            self.session = recorded(self.table, self.settings, calibrated, warm)
            self.known, self.old = model, model
        else:
            self.session = recorded(self.table, self.settings, ())
            self.known = commissioned()
            self.old = calibrate(self.known, [self.session]).model
        new = replace(paced(NEW, self.effect), session=1, **known)
        hidden = replace(new, hidden=(self.hidden,))
        self.motion = Motion(self.table, hidden, SEED + 1, warm_new)
        self.sound = Motion(self.table, new, SEED + 1, warm_new)

    def drive(self, corrected: Corrected, model: ErrorModel) -> Row:
        """Return what a corrector leaves and how restless it is."""
        error = self.error(self.motion, corrected, model)
        return {
            **asdict(self.motion.left(error, corrected.residual)),
            **asdict(self.motion.restless(corrected)),
            "faults": len(corrected.faults),
            "first_fault": corrected.faults[:1],
        }

    def error(self, motion: Motion, corrected: Corrected, model: ErrorModel) -> np.ndarray:
        """Return the error, on a wrong base in the frame of the calibration."""
        if self.base == "exact":
            return motion.error(corrected.angles)
        return motion.error_as_registered(corrected.angles, model)

    def told(self) -> Row:
        """Return what does not hang on a diagnosis."""
        old, sound = self.motion.corrected(self.old), self.sound.corrected(self.old)
        made = self.error(self.motion, old, self.old) - self.error(self.sound, sound, self.old)
        better, added = extended(self.known, self.session, [f"{self.effect}@{self.component}"])
        warm = self.motion.heard.temperature[:, :-1]
        recorded_warm = np.column_stack(
            [self.session.block.temperatures[each] for each in SENSED[:-1]]
        )
        return {
            "unit": CATALOGUE[self.effect].unit,
            "magnitude": self.hidden.magnitude,
            "size": self.size(),
            "compensable": compensable(find_law(self.effect), self.component),
            "warm_C": [float(recorded_warm.max()), float(warm.max())],
            "made": asdict(self.motion.made(made)),
            "floor": asdict(self.motion.floor()),
            "old": self.drive(old, self.old),
            "perfect": self.drive(self.motion.perfect(self.known), self.old)
            if self.base == "exact"
            else None,
            "added": added,
            "extended": self.drive(self.motion.corrected(better), better),
        }

    def size(self) -> float | None:
        """Return the size in the recording, in units of one sample's noise; None with a warm-up."""
        if self.effect in SLOW:
            return None
        settings = replace(self.settings, hidden=())
        return Scale(self.table, settings, settings.program_seconds).size(self.hidden)

    def diagnosed(self, told: Row) -> Row:
        """Return what a diagnosis makes of it."""
        result = diagnose_sessions(self.known, [self.session]).diagnosis
        findings = [list(finding.names) for finding in result.findings]
        names = [each[0] for each in findings]
        if names == told["added"]:
            added, left = names, told["extended"]
        else:
            better, added = extended(self.known, self.session, names)
            left = self.drive(self.motion.corrected(better), better)
        return {
            "verdict": result.verdict,
            "findings": findings,
            "added": added,
            "extended": left,
        }


@cache
def shipped() -> ErrorModel:
    """Return the model that knows no effect."""
    return load_model(shipped_file("config/palmieri2015_model.yaml"))


@cache
def commissioned() -> ErrorModel:
    """Return the model that was calibrated to the wrong base before any effect came."""
    settings = replace(HEALTHY, base="wrong", base_seed=BASE_SEED, session=0)
    model = shipped()
    return calibrate(model, [recorded(model.table, settings, ())]).model


def main() -> None:
    """Close the loop on what is not in the results yet, and write the page."""
    words = [each for each in sys.argv[1:] if not each.startswith("--")]
    flags = {each for each in sys.argv[1:] if each.startswith("--")}
    if not words or flags - {"--told", "--wrong-base"}:
        raise SystemExit(__doc__)
    results, base = Path(words[0]), "wrong" if "--wrong-base" in flags else "exact"
    lines = results.read_text().splitlines() if results.exists() else []
    done = {tuple(row["key"]): row for row in map(json.loads, lines)}

    def keep(key: tuple[str, str, str], row: Row, start: float) -> None:
        done[key] = {"key": key, **row, "seconds": time.perf_counter() - start}
        with results.open("a") as file:
            file.write(json.dumps(done[key]) + "\n")

    for name in words[1:] or (HIDDEN if base == "exact" else ON_WRONG_BASE):
        wanted = ["told"] if "--told" in flags else ["told", "diagnosed"]
        missing = [how for how in wanted if (name, base, how) not in done]
        if not missing:
            continue
        start = time.perf_counter()
        loop = Loop(name, shipped(), base)
        for how in missing:
            told = done.get((name, base, "told"))
            row = loop.told() if how == "told" else loop.diagnosed(told or {})
            keep((name, base, how), row, start)
        print(f"{name} {base}: {summary(done, name, base)}", flush=True)
    write_page(list(HIDDEN), list(ON_WRONG_BASE), done)


def summary(done: dict[tuple[str, ...], Row], name: str, base: str) -> str:
    """Return one line of pointing errors at rest [mdeg]."""
    told = done[name, base, "told"]
    other = done.get((name, base, "diagnosed"), {})
    parts = [
        f"{key} {1e3 * np.degrees(told[key]['resting']):.2f}"
        for key in ("floor", "old", "perfect", "extended")
        if told[key]
    ]
    if other:
        parts.append(f"{other['findings']} {1e3 * np.degrees(other['extended']['resting']):.2f}")
    return ", ".join(parts) + f", {(other or told)['seconds']:.0f} s"


if __name__ == "__main__":
    main()
