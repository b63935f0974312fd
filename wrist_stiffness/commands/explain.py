"""Why the platform is off at one pose: the error split by component and by effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.block import Load, Sample
from wrist_stiffness.model.budget import Budget, budget
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.places import THERMOMETERS
from wrist_stiffness.sessions.reading.refusals import OTHER_GEOMETRY
from wrist_stiffness.topics import MICROMETRES, MILLIDEGREES

QUATERNION_TOLERANCE = 1e-3
"""A typed quaternion is made unit if its length is this close to 1."""

FARTHEST_MM = 100.0
"""A measured point farther from O is a unit mistake: the wrist is not much larger itself."""

WITHIN = 2.0
"""A rest up to so many standard uncertainties of the prediction is explained."""


@dataclass(frozen=True)
class Row:
    """One line of the explanation."""

    name: str  # component, effect, or what is left
    kind: str  # `elastic`, `effect`, `second order` or `rest`
    twist: Array  # (6,), at O in F [m, rad]
    # (2,), its part along the total shift and about the total rotation axis: these add up to s and
    # phi [m, rad]
    along: Array
    sigma: Array  # (2,), one standard uncertainty of `along` [m, rad]
    meaning: str  # what it is, for a technician; empty for elastic parts

    def as_values(self) -> dict[str, Any]:
        """Return what people and programs read, with units in the names."""
        return {
            "name": self.name,
            "kind": self.kind,
            "s_um": MICROMETRES * float(self.along[0]),
            "s_sigma_um": MICROMETRES * float(self.sigma[0]),
            "phi_mdeg": MILLIDEGREES * float(self.along[1]),
            "phi_sigma_mdeg": MILLIDEGREES * float(self.sigma[1]),
            "shift_um": (MICROMETRES * self.twist[:3]).tolist(),
            "rotation_mdeg": (MILLIDEGREES * self.twist[3:]).tolist(),
            "meaning": self.meaning,
        }


@dataclass(frozen=True)
class Explanation:
    """A pose error and where it comes from."""

    # (6,), twist that is explained: the measured one if there is one, else the predicted [m, rad]
    total: Array
    measured: bool
    rows: tuple[Row, ...]  # their twists add up to the total
    sigma: Array  # (2,), standard uncertainty of the prediction along the total [m, rad]
    # effects that were left out, have left first order, or are not known at one pose
    warnings: tuple[str, ...]
    # whether a measured error is explained, in one sentence; empty for a predicted one
    verdict: str

    def as_values(self) -> dict[str, Any]:
        """Return what people and programs read, with units in the names."""
        return {
            "verdict": self.verdict,
            "s_um": MICROMETRES * float(np.linalg.norm(self.total[:3])),
            "phi_mdeg": MILLIDEGREES * float(np.linalg.norm(self.total[3:])),
            "measured": self.measured,
            "prediction_sigma_um": MICROMETRES * float(self.sigma[0]),
            "prediction_sigma_mdeg": MILLIDEGREES * float(self.sigma[1]),
            "rows": [row.as_values() for row in self.rows],
            "warnings": list(self.warnings),
        }


def explain(
    model: str | Path,
    angles: Sequence[float],
    load: Load,
    measured: Sequence[float] | None = None,
    temperatures: Mapping[str, float] | None = None,
    covariates: Mapping[str, float] | None = None,
) -> Explanation:
    """Split the pose error at one pose by component and by effect.

    `angles`: motor angles [rad]; `load`: wrench on the platform at O; `measured` (7 numbers):
    measured pose of the platform, its point O in F [m] and quaternion x, y, z, w of U -> F;
    `temperatures`: by component or `ambient` [degC].  Gives rows that add up, largest first within
    their kind.  Raises `WristError` if the model cannot be read, or a value is out of range.
    """
    for name in temperatures or {}:
        if name not in THERMOMETERS:
            raise InputError(
                f"temperature of {name!r}: no such place; known are {', '.join(THERMOMETERS)}"
            )
    error_model = load_model(model)
    sample = Sample(
        0.0,
        np.array(angles, dtype=float),
        load,
        temperatures=temperatures or {},
        covariates=covariates or {},
    )
    notes = []
    if measured is None:
        # Where a sensor stands moves no platform; what is told is what `predict` says.
        aside = [effect for effect in error_model.effects if effect.stage == "sensor"]
        if aside:
            error_model = error_model.with_effects(
                *(effect for effect in error_model.effects if effect not in aside)
            )
            notes.append(
                f"effects of the pose sensor ({_listed(aside)}) say where it stands, not where "
                "the platform is: they count with --measured only"
            )
    parts = budget(error_model, sample)
    notes += [
        f"covariate {name}: no effect of the model uses it"
        for name in sample.covariates
        if budget(error_model, _without(name, sample)).warnings == parts.warnings
    ]
    past = [effect for effect in error_model.effects if effect.name in parts.remembering]
    if past:
        notes.append(
            f"effects with a memory ({_listed(past)}) are not known at one pose: they count as if "
            "nothing had been before"
        )
    meanings = {
        effect.name: effect.law.sentence.format(place=effect.component)
        for effect in error_model.effects
    }
    total = parts.measured if measured is None else measured_twist(measured, parts.platform)
    return _explained(parts, total, measured is not None, meanings, notes)


def _without(covariate: str, sample: Sample) -> Sample:
    kept = {name: value for name, value in sample.covariates.items() if name != covariate}
    return replace(sample, covariates=kept)


def measured_twist(pose: Sequence[float], platform: Array) -> Array:
    """Return the error twist of a measured pose against the rigid platform.

    `pose`: the platform's point O in F [m], quaternion x, y, z, w of U -> F; `platform` (3, 3):
    rotation U -> F of the rigid platform.  Gives (6,): at O in F [m, rad].  Raises `InputError` if
    a number is not finite, the point is farther from O than any wrist bends, the quaternion is not
    of unit length, or the rotation is one that no effect explains.
    """
    values = np.array(pose, dtype=float)
    if values.shape != (7,) or not np.isfinite(values).all():
        raise InputError(f"measured pose {values.tolist()}: needs x y z qx qy qz qw, all finite")
    if np.abs(values[:3]).max() > 1e-3 * FARTHEST_MM:
        millimetres = (1e3 * values[:3]).tolist()
        raise InputError(
            f"measured pose: O at {millimetres} mm is more than {FARTHEST_MM:g} mm from its place"
        )
    length = float(np.linalg.norm(values[3:]))
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise InputError(
            f"measured pose: the quaternion has length {length:.4f}, not 1 "
            f"(within {QUATERNION_TOLERANCE:g})"
        )
    rotation = Rotation.from_quat(values[3:]).as_matrix() @ platform.T
    twist = log_motion(rotation, values[:3])
    off = float(np.linalg.norm(twist[3:]))
    if off > OTHER_GEOMETRY:
        raise InputError(
            f"measured pose: its rotation is {np.degrees(off):.1f} deg (limit "
            f"{np.degrees(OTHER_GEOMETRY):g} deg) from what the motor angles say; is it that of "
            "the platform in wrist_base, with the quaternion in the order x y z w, and are the "
            "angles those of motor 1, then motor 2?"
        )
    return twist


def _explained(
    parts: Budget, total: Array, measured: bool, meanings: Mapping[str, str], notes: Sequence[str]
) -> Explanation:
    directions = _directions(total)

    def row(name: str, kind: str, twist: Array, spread: Array, meaning: str = "") -> Row:
        sigma = np.sqrt(((spread @ directions.T) ** 2).sum(axis=0))
        return Row(name, kind, twist, directions @ twist, sigma, meaning)

    none = np.empty((0, 6))
    rows = [
        row(share.name, kind, share.twist, share.spread, meanings.get(share.name, ""))
        for kind, shares in (("elastic", parts.elastic), ("effect", parts.effects))
        for share in sorted(shares, key=lambda one: -float(abs(directions[0] @ one.twist)))
    ]
    # Rounding only, unless effects of the pose sensor are in the model.
    if np.linalg.norm(parts.second_order) > 1e-12 * np.linalg.norm(parts.measured):
        rows.append(row("composition", "second order", parts.second_order, none))
    covariance = parts.covariance
    sigma = np.sqrt(np.einsum("ki,ij,kj->k", directions, covariance, directions))
    if measured:
        rest = total - parts.measured
        rows.append(Row("not explained", "rest", rest, directions @ rest, sigma, ""))
    verdict = _verdict(total - parts.measured, covariance) if measured else ""
    return Explanation(total, measured, tuple(rows), sigma, (*parts.warnings, *notes), verdict)


def _listed(effects: Sequence[Effect]) -> str:
    return ", ".join(effect.name for effect in effects)


def _verdict(rest: Array, covariance: Array) -> str:
    """Return whether a rest is more than the uncertainty of the prediction in its direction."""
    directions = _directions(rest)
    sizes = directions @ rest
    sigma = np.sqrt(np.einsum("ki,ij,kj->k", directions, covariance, directions))
    ratio = np.divide(sizes, sigma, out=np.where(sizes > 0.0, np.inf, 0.0), where=sigma > 0.0)
    # Whole lengths: the rows count along what was measured, and a rest may stand across it.
    left = (
        f"in all, whatever the direction, {_plain(MICROMETRES * sizes[0], 3)} um and "
        f"{_plain(MILLIDEGREES * sizes[1], 3)} mdeg are not explained"
    )
    if ratio.max() <= WITHIN:
        return f"{left}: no more than the uncertainty of the prediction"
    shift, turn = (_plain(float(each), 2) for each in np.round(ratio, 2))
    return (
        f"{left}, {shift} x and {turn} x the uncertainty of the prediction in that direction: the "
        "measurement is off, or an effect is missing ('compare' and 'diagnose' tell from many "
        "poses)"
    )


def _plain(value: float, digits: int) -> str:
    """Return a size without an exponent; where it is large, with all digits before the point."""
    return f"{value:.0f}" if value >= 10.0**digits else f"{value:.{digits}g}"


def _directions(total: Array) -> Array:
    """Return unit twists along the total shift and about the total axis as rows (2, 6)."""
    directions = np.zeros((2, 6))
    for place in (0, 1):
        half = total[3 * place : 3 * place + 3]
        directions[place, 3 * place : 3 * place + 3] = half / max(
            float(np.linalg.norm(half)), float(np.finfo(float).tiny)
        )
    return directions
