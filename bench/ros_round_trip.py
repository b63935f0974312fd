"""Round trip through the predictor against a bare echo node: `python bench/ros_round_trip.py`.

Both are processes of their own and get the same JointState, one at a time, in alternating blocks;
the echo node answers with an empty PoseWithCovarianceStamped of the same stamp.  A second echo node
shows what the comparison can resolve.  `bench/ros_endurance.py` sends a steady stream instead.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 90))

import numpy as np
import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

from wrist_stiffness.ros.conversions import (
    joint_message,
    nanoseconds,
    time_message,
    wrench_message,
)
from wrist_stiffness.ros.qos import RELIABLE_QOS, SENSOR_QOS

NAMES = ("motor_1_joint", "motor_2_joint")
DOWN = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
SECOND = 1_000_000_000


def echo(name: str) -> None:
    """Run the bare node."""
    rclpy.init()
    node = rclpy.create_node(name)
    out = node.create_publisher(PoseWithCovarianceStamped, f"/{name}/out", RELIABLE_QOS)

    def answer(message: JointState) -> None:
        pose = PoseWithCovarianceStamped()
        pose.header.stamp = message.header.stamp
        out.publish(pose)

    node.create_subscription(JointState, f"/{name}/in", answer, SENSOR_QOS)
    rclpy.spin(node)


@contextmanager
def process(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a process and end it."""
    running = subprocess.Popen([sys.executable, *arguments], stderr=subprocess.DEVNULL)
    try:
        yield running
    finally:
        running.terminate()
        running.wait(10.0)


class Probe:
    """Sends joint states and times the answers."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("bench_probe")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.load = self.node.create_publisher(
            type(wrench_message(0, "", DOWN)), "/load_estimate", 10
        )
        self.answered: dict[int, float] = {}
        self.inputs = {}
        self.sent: Counter[str] = Counter()
        self.stamp_ns = SECOND

    def connect(self, name: str, in_topic: str, out_topic: str) -> None:
        """Open the way to one node and wait until it is there."""
        self.inputs[name] = self.node.create_publisher(JointState, in_topic, RELIABLE_QOS)
        self.node.create_subscription(
            PoseWithCovarianceStamped, out_topic, self._on_answer, RELIABLE_QOS
        )
        end = time.monotonic() + 30.0
        while not (
            self.inputs[name].get_subscription_count() and self.node.count_publishers(out_topic)
        ):
            self.executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > end:
                raise SystemExit(f"{name} did not come up")

    def load_the_wrist(self) -> None:
        """Send the first load, once somebody hears it."""
        while not self.load.get_subscription_count():
            self.executor.spin_once(timeout_sec=0.1)
        self.load.publish(wrench_message(self.stamp_ns, "wrist_base", DOWN))

    def _on_answer(self, message: PoseWithCovarianceStamped) -> None:
        self.answered[nanoseconds(message.header.stamp)] = time.perf_counter()

    def send(self, name: str) -> tuple[int, float]:
        """Send one joint state and return its stamp and when it was sent."""
        self.stamp_ns += SECOND // 1000
        theta = 0.3 * np.sin([1e-9 * self.stamp_ns, 1.3e-9 * self.stamp_ns])
        if self.stamp_ns % (SECOND // 10) == 0:
            self.load.publish(wrench_message(self.stamp_ns, "wrist_base", DOWN))
        message = joint_message(self.stamp_ns, "", NAMES, theta)
        message.header.stamp = time_message(self.stamp_ns)
        self.sent[name] += 1
        start = time.perf_counter()
        self.inputs[name].publish(message)
        return self.stamp_ns, start

    def ping(self, name: str) -> float:
        """Return one round trip [us]; NaN if no answer came within a second."""
        stamp, start = self.send(name)
        while stamp not in self.answered:
            if time.perf_counter() - start > 1.0:
                return float("nan")
            self.executor.spin_once(timeout_sec=1.0)
        return 1e6 * (self.answered.pop(stamp) - start)


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024.0


def interval(values: np.ndarray, rng: np.random.Generator) -> str:
    """Return p99 with a 95 % bootstrap interval over the blocks."""
    blocks = [rng.choice(len(values), len(values)) for _ in range(200)]
    low, high = np.percentile([np.percentile(values[b], 99) for b in blocks], [2.5, 97.5])
    return f"{np.percentile(values, 99):7.0f} ({low:.0f} to {high:.0f})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blocks", type=int, default=20)
    parser.add_argument("--pings", type=int, default=100, help="per block and node")
    parser.add_argument("--echo", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.echo:
        echo(options.echo)
        return
    with (
        process(__file__, "--echo", "echo_1") as echo_1,
        process(__file__, "--echo", "echo_2") as echo_2,
        process("-m", "wrist_stiffness.ros.pose_error_predictor") as predictor,
    ):
        nodes = {"echo_1": echo_1, "echo_2": echo_2, "predictor": predictor}
        probe = Probe()
        for name in ("echo_1", "echo_2"):
            probe.connect(name, f"/{name}/in", f"/{name}/out")
        probe.connect("predictor", "/joint_states", "/pose_error_predicted")
        probe.load_the_wrist()
        cpu = {name: cpu_seconds(running.pid) for name, running in nodes.items()}
        round_trips(probe, options.blocks, options.pings)
        print(
            "processor time per answer [us]: "
            + ", ".join(
                f"{name} {1e6 * (cpu_seconds(running.pid) - cpu[name]) / probe.sent[name]:.0f}"
                for name, running in nodes.items()
            )
        )


def round_trips(probe: Probe, blocks: int, pings: int) -> None:
    """Compare the nodes in alternating blocks."""
    rng = np.random.default_rng(0)
    times: dict[str, list[np.ndarray]] = {name: [] for name in probe.inputs}
    for block in range(blocks + 1):
        for name in rng.permutation(list(times)):
            values = np.array([probe.ping(name) for _ in range(pings)])
            if block:  # the first one warms up
                times[name].append(values)
    medians = {name: np.array([np.nanmedian(v) for v in t]) for name, t in times.items()}
    print("node         median [us]   p99 [us] (95 % interval)    lost   median over echo_1")
    for name, blocks_of in times.items():
        values = np.concatenate(blocks_of)
        lost = int(np.isnan(values).sum())
        ratio = np.median(medians[name] / medians["echo_1"])
        p99 = interval(values[~np.isnan(values)], rng)
        print(f"{name:12} {np.nanmedian(values):8.0f}   {p99:>26} {lost:6d}   {ratio:8.3f}")


if __name__ == "__main__":
    main()
