"""Answers to commands while a long plan is corrected: `python bench/ros_plans.py`.

Commands at a steady rate, without a plan and while one of 10,000 points with speeds and
accelerations is under way, in the same run: the ratio of the times is what a plan costs.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from ros_round_trip import DOWN, NAMES, process
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wrist_stiffness.ros.conversions import joint_message, nanoseconds, wrench_message
from wrist_stiffness.ros.qos import RELIABLE_QOS

START_S = 30.0
MOST_S = 120.0


class Source:
    """Sends commands and plans, and hears the answers."""

    def __init__(self, rate_hz: float) -> None:
        rclpy.init()
        self.node = rclpy.create_node("planner")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.rate_hz, self.sent, self.took = rate_hz, {}, {}  # type: ignore[var-annotated]
        self.planned = 0
        make, hear = self.node.create_publisher, self.node.create_subscription
        self.load = make(WrenchStamped, "load_estimate", RELIABLE_QOS)
        self.command = make(JointState, "motor_commands", RELIABLE_QOS)
        self.plan = make(JointTrajectory, "motor_trajectory", RELIABLE_QOS)
        hear(JointState, "motor_commands_corrected", self._on_command, RELIABLE_QOS)
        hear(JointTrajectory, "motor_trajectory_corrected", self._on_plan, RELIABLE_QOS)

    def _on_command(self, message: JointState) -> None:
        stamp_ns = nanoseconds(message.header.stamp)
        if stamp_ns in self.sent:
            self.took[stamp_ns] = time.perf_counter() - self.sent[stamp_ns]

    def _on_plan(self, message: JointTrajectory) -> None:
        self.planned += len(message.points)

    def stream(self, until) -> tuple[np.ndarray, int]:  # type: ignore[no-untyped-def]
        """Send commands until it is time; return the times of the answers, and how many lack."""
        self.sent.clear()
        self.took.clear()
        begin = time.perf_counter()
        while not until(elapsed := time.perf_counter() - begin) and elapsed < MOST_S:
            stamp_ns = time.time_ns()
            self.load.publish(wrench_message(stamp_ns, "wrist_base", DOWN))
            command = joint_message(stamp_ns, "", NAMES, 0.2 * np.sin([elapsed, 0.7 * elapsed]))
            self.sent[stamp_ns] = time.perf_counter()
            self.command.publish(command)
            due = begin + len(self.sent) / self.rate_hz
            while (left := due - time.perf_counter()) > 0.0:
                self.executor.spin_once(timeout_sec=left)
        end = time.perf_counter() + 1.0
        while len(self.took) < len(self.sent) and time.perf_counter() < end:
            self.executor.spin_once(timeout_sec=0.1)
        return np.array(list(self.took.values())), len(self.sent) - len(self.took)


def trajectory(count: int) -> JointTrajectory:
    """Return a plan of so many points."""
    plan = JointTrajectory(joint_names=list(NAMES))
    for i in range(count):
        s = 1e-3 * i
        point = JointTrajectoryPoint(
            positions=[0.3 * np.sin(s), 0.2 * np.cos(s)],
            velocities=[0.3 * np.cos(s), -0.2 * np.sin(s)],
            accelerations=[-0.3 * np.sin(s), -0.2 * np.cos(s)],
        )
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(i * 1_000_000, 10**9)
        plan.points.append(point)
    return plan


def main() -> None:
    """Print the times with and without a plan."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--rate", type=float, default=200.0, help="of the commands [Hz]")
    options = parser.parse_args()
    corrects = ("--ros-args", "-p", "enabled_on_start:=true", "-p", "load_policy:=follow")
    corrects += ("-p", "tare_needed:=false", "-p", "command_age_limit_s:=0.0")
    with process("-m", "wrist_stiffness.ros.angle_corrector", *corrects):
        source = Source(options.rate)
        source.stream(lambda elapsed: bool(source.took) or elapsed > START_S)
        if not source.took:
            raise SystemExit("the corrector did not come up")
        source.stream(lambda elapsed: elapsed > 2.0)
        plan = trajectory(options.points)
        print(f"load average {os.getloadavg()[0]:.1f}; commands at {options.rate:g} Hz")
        alone, lost = source.stream(lambda elapsed: elapsed > 10.0)
        begin = time.perf_counter()
        source.plan.publish(plan)
        beside, lost_beside = source.stream(lambda elapsed: source.planned > 0)
        seconds = time.perf_counter() - begin
        both = [np.quantile(1e3 * times, [0.5, 0.99]) for times in (alone, beside)]
        for what, times, (median, p99), missing in (
            ("no plan", alone, both[0], lost),
            (f"a plan of {source.planned} points", beside, both[1], lost_beside),
        ):
            print(
                f"{what:26} {len(times):5d} answers, {missing} lost; median {median:.2f} ms, "
                f"99 % {p99:.2f} ms"
            )
        ratio = both[1] / both[0]
        print(f"ratio: median {ratio[0]:.2f}, 99 % {ratio[1]:.2f}; the plan took {seconds:.1f} s")


if __name__ == "__main__":
    main()
