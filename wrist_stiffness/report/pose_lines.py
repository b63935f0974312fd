"""What `predict` and `explain` tell of one pose on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wrist_stiffness.commands.explain import Explanation
    from wrist_stiffness.commands.predict import PosePrediction


def prediction_lines(found: PosePrediction, loaded: bool) -> list[str]:
    """Return a predicted error, and whose share it is where a load acts."""
    values = found.as_values()
    lines = []
    for name, unit, parts in (("s", "um", "shift_um"), ("phi", "mdeg", "rotation_mdeg")):
        x, y, z = values[parts]
        size = values[f"{name}_{unit}"]
        lines.append(f"{name:4} {size:8.3f} {unit:5} ({x:.3f}, {y:.3f}, {z:.3f})")
    if other := values["other_evaluation"]:
        way = "spline" if values["evaluation"] == "closed_form" else "closed form"
        lines.append(f"by the table's {way}: {_sizes(other)}")
    if exact := values["exact"]:
        lines.append(f"past first order (2 mrad); with finite rotations: {_sizes(exact)}")
    elif values["past_first_order"]:
        lines.append("past first order (2 mrad), in which the model's effects are carried")
    inside = "inside" if values["in_operative_workspace"] else "outside"
    lines.append(
        f"tilt {values['tilt_deg']:.2f} deg, {inside} the operative workspace, "
        f"{values['sectors_in_contact']} flange sectors in contact"
    )
    if loaded:
        lines.append("share of the load's strain energy with free slides:")
        shares = sorted(values["energy_share"].items(), key=lambda item: -item[1])
        lines += [f"  {name}  {100 * share:5.1f} %" for name, share in shares]
    return lines


def _sizes(values: dict[str, Any]) -> str:
    return f"s {values['s_um']:.3f} um, phi {values['phi_mdeg']:.3f} mdeg"


def explanation_lines(found: Explanation) -> list[str]:
    """Return the parts of an error that add up, and the whole."""
    values = found.as_values()
    lines = [f"{'':34}{'s [um]':>9}          {'phi [mdeg]':>12}"]
    for row in values["rows"]:
        numbers = (row[key] for key in ("s_um", "s_sigma_um", "phi_mdeg", "phi_sigma_mdeg"))
        lines.append(f"{_part(row['name'], *numbers)} {row['meaning']}")
    s, phi = values["prediction_sigma_um"], values["prediction_sigma_mdeg"]
    if found.measured:
        lines.append(_part("measured", values["s_um"], 0.0, values["phi_mdeg"], 0.0))
        lines.append(f"uncertainty of the prediction: {s:.3f} um, {phi:.3f} mdeg")
        lines.append(values["verdict"])
    else:
        lines.append(_part("predicted", values["s_um"], s, values["phi_mdeg"], phi))
    return [*lines, *(f"note: {warning}" for warning in values["warnings"])]


def _part(name: str, s: float, s_sigma: float, phi: float, phi_sigma: float) -> str:
    spread = [f"+-{sigma:7.3f}" if sigma else " " * 9 for sigma in (s_sigma, phi_sigma)]
    return f"{name:34}{s:9.3f} {spread[0]} {phi:11.3f} {spread[1]}"
