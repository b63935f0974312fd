"""Where an effect may sit, and how a screw or a wrench there meets the rest of the wrist."""

from __future__ import annotations

from typing import Literal

from wrist_stiffness.mechanism.components import CARRIER, ELASTIC
from wrist_stiffness.mechanism.influence import LIMB_1

Limb = Literal["limb_1", "limb_2", "both"]

LIMB: dict[str, Limb] = {
    **{name: "limb_1" if name in LIMB_1 else "limb_2" for name in ELASTIC},
    "motor_1": "limb_1",
    "motor_2": "limb_2",
    "frame": "both",
    "platform": "both",
}
"""The limb whose G carries a screw: a screw under or behind both limbs reaches the platform whole
and moves no slide."""

BODY = {**CARRIER, "motor_1": "frame", "motor_2": "frame", "frame": "frame", "platform": "platform"}
"""The body in which a place is at home and with which its directions turn."""

THERMOMETERS = (*BODY, "ambient")
"""Of what a temperature may be said."""

MOTOR_JOINT = {"motor_1": "joint_1", "motor_2": "joint_5"}
"""The joint that carries what a motor carries."""
