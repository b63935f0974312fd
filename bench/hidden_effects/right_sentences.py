"""What a right sentence about each stranger says: written from the strangers' own descriptions.

The list was committed before a proposed law was scored by it.  A sentence is right if one law sits
at one of the components, or at a twin of it, and follows one of the signals.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from wrist_stiffness.identification.proposal import Proposal, twins
from wrist_stiffness.model.formula_law import LOAD_SENSOR, TOOL, TURNS

POSE = ("theta_1", "theta_2")
RATES = ("theta_dot_1", "theta_dot_2")
FORCES, MOMENTS = ("W_fx", "W_fy", "W_fz"), ("W_mx", "W_my", "W_mz")
LOAD = (*FORCES, *MOMENTS)
"""What goes through a part of the wrist follows all six of the load on the platform."""

SEEN = ("frame", "platform")
"""Where an error of the pose sensor shows: as its stand, or as its target."""


@dataclass(frozen=True)
class Right:
    """What is true of a stranger.

    Parameters
    ----------
    signals : tuple of str
        What its size truly follows; or a whole form, `a step of time`.
    components : tuple of str
        Where it is, if the place in its name is not where a law can say it.
    """

    signals: tuple[str, ...]
    components: tuple[str, ...] = ()


RIGHT = {
    # A tool that lags behind fast moves and rings after them.
    "resonance": Right((*RATES, "turn_dot_2", "turn_dot_3", "turn_dot_4")),
    # A pin lifted by the speed of its joint, which both motors turn.
    "oil_film": Right((*RATES, "turn_dot_2")),
    # A moment on the tool throws its seat from one place into the other.
    "loose_seat": Right(MOMENTS),
    # Yields under each load larger than all before, and stays bent from that moment on.
    "plastic_set": Right((*LOAD, "a step of time")),
    # The head is chosen by the side to which the platform leans.
    "head_change": Right(POSE, SEEN),
    # A stop pushes at the rim of the platform beyond a tilt to one side.
    "cable_stop": Right(POSE, (LOAD_SENSOR,)),
    # A lift over a few degrees of the joint's own turn.
    "dent": Right(("turn_2",)),
    # The square of the difference between the motors' temperatures.
    "thermal_bow": Right(("T_motor_1", "T_motor_2")),
    # The direction of the platform's weight wanders in time: a pull at the platform.
    "floor_tilt": Right(("time",), (LOAD_SENSOR,)),
    # A humidity that nobody records: waves in time.
    "swelling": Right(("time",)),
    # Soft under the torque about the motor axis, which runs through O, at some motor angles.
    "worn_sector": Right(("theta_1", *MOMENTS)),
    # A moment on the platform by the speed of its tilting.
    "spinning_tool": Right((*RATES, "turn_dot_2", "turn_dot_3", "turn_dot_4"), (LOAD_SENSOR,)),
    # Gives way to the load, the more the longer the motors have moved.
    "loosening_screw": Right(LOAD),
    # Sinks along the force while the joint rests; its turning lifts it again.
    "squeeze_film": Right((*LOAD, *RATES, "turn_dot_2")),
    # Reads too little of a side force beyond a limit; the platform's normal is z at home.
    "overload_ring": Right(("W_fx", "W_fy")),
    # The angle between a beam of the cell and a prism that turns with the platform.
    "prism_incidence": Right(POSE, SEEN),
}


def right_components(effect: str, place: str) -> tuple[str, ...]:
    """Return the components at which a law about a stranger is true.

    The lists know one place of a wrench that no sensor tells; a law says whether it turns with the
    platform.
    """
    found = RIGHT[effect].components or (place, *twins(place))
    return (*found, TOOL) if LOAD_SENSOR in found else found


def follows(form: str) -> set[str]:
    """Return what a law follows, by the name of its form, `a spot of turn_2`.

    The passing answer of an angle, x - lag(x), is its smoothed speed; hysteresis of an angle tells
    from which side it came, and not where it is.
    """
    kind, _, of = form.partition(" of ")
    names = set(re.findall(r"\w+", of))
    angles = {name for name in names if name in POSE or name in TURNS}
    if kind == "a passing answer":
        names = names - angles | {name.replace("_", "_dot_") for name in angles}
    if kind == "hysteresis":
        names -= angles
    # The load that goes through a part is that on the platform, turned and shared.
    return names | {f"W_{name}" for name in names} | {form}


def is_right(effect: str, place: str, laws: Sequence[Proposal]) -> bool:
    """Return whether one of the laws is a right sentence about a stranger."""
    where, signals = right_components(effect, place), set(RIGHT[effect].signals)
    return any(law.component in where and follows(law.form.name) & signals for law in laws)
