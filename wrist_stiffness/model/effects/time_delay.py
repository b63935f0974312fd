"""A stamp that is late."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wrist_stiffness.mechanism.components import MOTORS, Array
from wrist_stiffness.mechanism.rigid_motion import log_motion
from wrist_stiffness.model.law import Contribution, Law, Outcome, Situation, SIValues, Stage
from wrist_stiffness.model.memory import slope
from wrist_stiffness.model.parameters import Parameter

STAGE: dict[str, Stage] = {
    "pose_sensor": "sensor",
    "load_sensor": "load",
    "motor_1": "geometry",
    "motor_2": "geometry",
}


class Motion(NamedTuple):
    """Motor angles and speeds at moments in the order of time."""

    time: Array  # (n,) [s]
    # `theta`, `speed`: (n, 2) [rad], [rad/s]
    theta: Array
    speed: Array

    def since(self, time_s: float) -> Motion:
        """Return what is needed to tell the motion from a moment on."""
        first = max(int(np.searchsorted(self.time, time_s, side="right")) - 1, 0)
        return Motion(*(each[first:] for each in self))

    def at(self, moments: Array) -> tuple[Array, Array]:
        """Return angles and speeds (k, 2) at moments (k,) not later than the last one.

        Angles by the cubic that has the samples' angles and speeds; before the first sample its
        speed lasts.
        """
        after = np.clip(np.searchsorted(self.time, moments, side="right"), 1, len(self.time) - 1)
        before = np.maximum(after - 1, 0)
        step = (self.time[after] - self.time[before])[:, None]
        past = np.minimum(moments - self.time[before], 0.0)[:, None]
        into = np.maximum(moments - self.time[before], 0.0)[:, None]
        x = np.divide(into, step, out=np.zeros_like(step), where=step > 0.0)
        first, last = self.theta[before], self.theta[after]
        v_first, v_last = self.speed[before], self.speed[after]
        bend = step * x * (1.0 - x) * ((1.0 - x) * v_first - x * v_last)
        theta = first + x * x * (3.0 - 2.0 * x) * (last - first) + bend + past * v_first
        return theta, v_first + x * (v_last - v_first)


def _carried(motion: Motion, now: Motion, ahead_s: float) -> Array:
    """Return the angles (n, 2) of the moments so much after, or before, those of now."""
    if ahead_s < 0.0:
        return motion.at(now.time + ahead_s)[0]
    _, earlier = motion.at(now.time - ahead_s)
    return now.theta + ahead_s * (1.5 * now.speed - 0.5 * earlier)


def _turn(at: Situation, theta: Array) -> Array:
    """Return the platform's turn (n, 6) from where a situation has it to other motor angles."""
    moved = at.table.mechanism.platform_rotation(theta)
    turned = moved @ np.swapaxes(at.body("platform"), -1, -2)
    return log_motion(turned, np.zeros((len(theta), 3)))


class TimeDelay(Law):
    """What is stamped t was true at t - delay; speeds and the load's slope carry it to t.

    A late pose is that of an earlier moment, between the samples that were.  A late motor angle is
    carried on to t by the two-step formula of Adams and Bashforth, with the delay as its step; a
    late load along its slope.
    """

    id = "time_delay"
    stage = "sensor"
    places = tuple(STAGE)
    sentence = "the stamps of {place} are late"
    check = "synchronise the clocks; hit the platform and compare the stamps of the shock"
    signals = ("motor speeds, or a dense recording",)
    excited_by = "fast motions of both directions; for the load sensor, fast load changes"
    inexactness = 0.03

    def parameters(self, place: str) -> tuple[Parameter, ...]:
        """Return the delay."""
        return (Parameter("delay_ms", -1000.0, 1000.0, 10.0, linear=place != "pose_sensor"),)

    def stage_at(self, place: str) -> Stage:
        """Return what a late stamp of this place changes."""
        return STAGE[place]

    def of_measurement(self, place: str) -> bool:
        """Return True but for the load: a late encoder stamp does not move the motor."""
        return place != "load_sensor"

    def advance(self, at: Situation, place: str, values: SIValues, state: Any) -> Outcome:
        """Return what happened between the truth and its stamp; the state is the last of it."""
        delay = values["delay_ms"]
        if place == "load_sensor":
            rising, state = slope(at.block.time, at.load, state)
            return Contribution(wrench=delay * rising), state
        now = Motion(at.block.time, at.block.theta, at.speed)
        motion = Motion(*map(np.concatenate, zip(state, now, strict=True))) if state else now
        kept = motion.since(now.time[-1] - abs(delay))
        if delay == 0.0:
            return Contribution(), kept
        if place == "pose_sensor":
            shown = _carried(motion, now, -delay)
            return Contribution(sensor_right=_turn(at, shown)), kept
        column = MOTORS.index(place)
        true = now.theta.copy()
        true[:, column] = _carried(motion, now, delay)[:, column]
        return Contribution(both=_turn(at, true)), kept
