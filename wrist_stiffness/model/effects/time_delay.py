"""A stamp that is late."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.law import Contribution, Law, Stage
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.model.situation import Situation

STAGE: dict[str, Stage] = {
    "pose_sensor": "sensor",
    "load_sensor": "load",
    "motor_1": "geometry",
    "motor_2": "geometry",
}


class TimeDelay(Law):
    """What is stamped t was true at t - delay; motor speed and load slope carry it to t."""

    id = "time_delay"
    stage = "sensor"
    places = tuple(STAGE)
    sentence = "the stamps of {place} are late"
    check = "synchronise the clocks; hit the platform and compare the stamps of the shock"
    signals = ("motor speeds, or a dense recording",)
    excited_by = "fast motions of both directions; for the load sensor, fast load changes"

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the delay."""
        return (Parameter("delay_ms", -1000.0, 1000.0, 10.0, linear=place != "pose_sensor"),)

    def stage_at(self, place: str) -> Stage:
        """Return what a late stamp of this place changes."""
        return STAGE[place]

    def of_measurement(self, place: str) -> bool:
        """Return True but for the load: a late encoder stamp does not move the motor."""
        return place != "load_sensor"

    def advance(
        self, at: Situation, place: str, values: Mapping[str, float], state: Any
    ) -> tuple[Contribution, Any]:
        """Return what happened between the truth and its stamp."""
        delay = values["delay_ms"]
        if place == "pose_sensor":
            earlier = at.table.mechanism.forward(at.block.theta - delay * at.speed).platform
            turned = earlier @ np.swapaxes(at.body("platform"), -1, -2)
            return Contribution(sensor_right=log_motion(turned, np.zeros((len(turned), 3)))), None
        if place in MOTORS:
            return at.motor_turn(place, delay * at.speed[:, MOTORS.index(place)]), None
        time, load = state if state else (at.block.time[0], at.load[0])
        interval = np.diff(at.block.time, prepend=time)[:, None]
        step = np.diff(at.load, axis=0, prepend=load[None])
        slope = np.divide(step, interval, out=np.zeros_like(step), where=interval > 0.0)
        return Contribution(wrench=delay * slope), (at.block.time[-1], at.load[-1])
