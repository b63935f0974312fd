"""A steady stream through predictor and corrector: `python bench/ros_endurance.py --seconds 60`.

They are processes of their own, and beside them is a bare node that only answers: what it loses
the machine loses.  A load, a joint state and a command of the same stamp go out at
every tick, all three at the full rate; every answer is waited for.  Lost are stamps that were not
answered, on the way in by what the node itself says that it took, else on the way out; the time of
an answer is from sending its tick to hearing it.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass, field

import numpy as np
import rclpy
import ros_round_trip
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, WrenchStamped
from rclpy.subscription import Subscription
from ros_round_trip import NAMES, SECOND, cpu_seconds, memory_mb, process
from sensor_msgs.msg import JointState

from wrist_stiffness.ros.conversions import joint_message, nanoseconds, wrench_message
from wrist_stiffness.ros.executor import DataGroup, StreamExecutor, Waiting, take_in_order
from wrist_stiffness.ros.qos import RELIABLE_QOS

NODES = {
    "pose_error_predictor": ("/joint_states", "/pose_error_predicted", PoseWithCovarianceStamped),
    "angle_corrector": ("/motor_commands", "/motor_commands_corrected", JointState),
    "echo": ("/echo/in", "/echo/out", PoseWithCovarianceStamped),
}
HEAR_LOADS = 2
START_S = 30.0
LAST_ANSWER_S = 3.0
WARM_UP_S = 2.0


@dataclass
class Answers:
    """When a node's answers came, by stamp."""

    heard: dict[int, float] = field(default_factory=dict)

    def __call__(self, message: PoseWithCovarianceStamped | JointState) -> None:
        """Note an answer."""
        self.heard[nanoseconds(message.header.stamp)] = time.perf_counter()


class Source:
    """Sends the stream and hears the answers."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("bench_source")
        self.executor = StreamExecutor()
        self.executor.add_node(self.node)
        self.load = self.node.create_publisher(WrenchStamped, "/load_estimate", RELIABLE_QOS)
        self.inputs, self.answers = {}, {name: Answers() for name in NODES}
        self.said: dict[str, dict[str, str]] = {}
        group = DataGroup()
        self.subscriptions: list[Subscription] = []
        for name, (in_topic, out_topic, kind) in NODES.items():
            self.inputs[name] = self.node.create_publisher(JointState, in_topic, RELIABLE_QOS)
            self.subscriptions.append(
                self.node.create_subscription(
                    kind, out_topic, self.answers[name], RELIABLE_QOS, callback_group=group
                )
            )
        self.subscriptions.append(
            self.node.create_subscription(
                DiagnosticArray, "/diagnostics", self._on_diagnostics, 10, callback_group=group
            )
        )
        self.waiting = Waiting(self.executor, self.subscriptions)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.said[status.name] = {value.key: value.value for value in status.values}

    def ready(self) -> bool:
        """Tell whether both nodes hear and are heard."""
        return self.load.get_subscription_count() == HEAR_LOADS and all(
            self.inputs[name].get_subscription_count() and self.node.count_publishers(topics[1])
            for name, topics in NODES.items()
        )

    def hear_until(self, moment: float) -> None:
        """Take answers until a moment of `time.perf_counter`."""
        while (left := moment - time.perf_counter()) > 0.0:
            self.waiting.for_others(left)
            take_in_order(self.subscriptions)

    def send(self, tick: int, stamp_ns: int) -> float:
        """Send a load, a joint state and a command; return when."""
        angle = 2e-3 * np.pi * tick
        theta = 0.3 * np.sin([0.5 * angle, 0.7 * angle])
        wrench = np.array([0.3 * np.sin(0.2 * angle), -0.2, -1.0, 0.0, 0.01, 0.0])
        load = wrench_message(stamp_ns, "wrist_base", wrench)
        joints = joint_message(stamp_ns, "", NAMES, theta)
        start = time.perf_counter()
        self.load.publish(load)
        for publisher in self.inputs.values():
            publisher.publish(joints)
        return start


def main() -> None:
    """Print what came back."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="of the stream [Hz]")
    options = parser.parse_args()
    module = "wrist_stiffness.ros."
    corrects = ("--ros-args", "-p", "enabled_on_start:=true", "-p", "load_policy:=follow")
    corrects += ("-p", "command_age_limit_s:=0.0")
    with (
        process("-m", module + "pose_error_predictor") as predictor,
        process("-m", module + "angle_corrector", *corrects) as corrector,
        process(ros_round_trip.__file__, "--echo", "echo") as echo,
    ):
        source = Source()
        end = time.perf_counter() + START_S
        while not source.ready():
            source.hear_until(time.perf_counter() + 0.1)
            if time.perf_counter() > end:
                raise SystemExit("the nodes did not come up")
        pids = dict(zip(NODES, (predictor.pid, corrector.pid, echo.pid), strict=True))
        stream(source, pids, options.seconds, options.rate)


def stream(source: Source, pids: dict[str, int], seconds: float, rate_hz: float) -> None:
    """Send the stream, after a warm-up that does not count, and report."""
    stamp_ns, step_ns = SECOND, round(SECOND / rate_hz)
    sent: dict[int, float] = {}
    begin = time.perf_counter()
    warm, count = round(WARM_UP_S * rate_hz), round(seconds * rate_hz)
    behind = 0
    memory: dict[str, list[float]] = {name: [] for name in NODES}
    for tick in range(-warm, count):
        due = begin + (tick + warm) / rate_hz
        source.hear_until(due)
        behind += time.perf_counter() > due + 1.0 / rate_hz
        if tick == 0:
            sent.clear()
            cpu = {name: cpu_seconds(pid) for name, pid in pids.items()}
            wall = time.perf_counter()
        if tick >= 0 and tick % max(count // 10, 1) == 0:
            for name, pid in pids.items():
                memory[name].append(memory_mb(pid))
        stamp_ns += step_ns
        sent[stamp_ns] = source.send(tick, stamp_ns)
    wall = time.perf_counter() - wall
    source.hear_until(time.perf_counter() + LAST_ANSWER_S)
    print(
        f"{count} ticks at {rate_hz:g} Hz in {wall:.1f} s; {behind} sent a tick or more late; "
        f"load average {os.getloadavg()[0]:.1f}"
    )
    print(
        "node                   lost  way in  median [us]  p99 [us] (95 %)          core  "
        "memory at the start, after a tenth, near the end [MB]; loads late"
    )
    for name, pid in pids.items():
        heard = source.answers[name].heard
        times = 1e6 * np.array([heard[s] - start for s, start in sent.items() if s in heard])
        median = f"{np.median(times):.0f}" if len(times) else "none"
        share = 100.0 * (cpu_seconds(pid) - cpu[name]) / wall
        said = source.said.get(name, {})
        taken = sum(int(n) for key, n in said.items() if key.split()[0] in ("samples", "refused"))
        lost, way_in = count - len(times), warm + count - taken if said else "?"
        print(
            f"{name:20} {lost:6d} {way_in:>7} {median:>12}  "
            f"{high_percentile(times):24} {share:3.0f} %  "
            f"{memory[name][0]:.1f}, {memory[name][1]:.1f}, {memory[name][-1]:.1f}; "
            f"{said.get('loads that came late', '')}"
        )


def high_percentile(values: np.ndarray) -> str:
    """Return p99 with the 95 % interval of its rank, for any number of values."""
    if not len(values):
        return "none"
    half = 1.96 * np.sqrt(0.99 * 0.01 / len(values))
    low, p99, high = np.quantile(values, [max(0.99 - half, 0.0), 0.99, min(0.99 + half, 1.0)])
    return f"{p99:.0f} ({low:.0f} to {high:.0f})"


if __name__ == "__main__":
    main()
