"""Many starts and ends of the nodes under traffic: `python bench/ros_endings.py --rounds 100`.

Each round starts the three nodes, sends them loads, joint states and commands, and tells them to
end, by SIGINT or SIGTERM, at a random moment: while they start, while they configure, amid the
traffic.  Every end must come by itself, with exit code 0, or by the signal where Python itself was
still starting.  One that hangs is ended by the node's own watchdog, which says where it hung
(`ros/run.py`); that is printed here.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 90))

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from ros_round_trip import DOWN, NAMES
from sensor_msgs.msg import JointState

from wrist_stiffness.commands.node_list import WRIST_NODES
from wrist_stiffness.ros.conversions import joint_message, wrench_message
from wrist_stiffness.ros.qos import RELIABLE_QOS
from wrist_stiffness.ros.run import END_S

LATEST_S = 6.0
"""Nodes are told to end at random moments up to this time after they were started [s]."""

TICK_S = 0.005


def main() -> int:
    """Print how the nodes ended; 1 where one did not by itself."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    rclpy.init()
    node = rclpy.create_node("ends")
    load = node.create_publisher(WrenchStamped, "load_estimate", RELIABLE_QOS)
    topics = ("joint_states", "motor_commands")
    inputs = [node.create_publisher(JointState, topic, RELIABLE_QOS) for topic in topics]
    took, bad = [], []
    for _ in range(options.rounds):
        with tempfile.TemporaryFile("w+") as said:
            begin = time.monotonic()
            moments = rng.uniform(0.0, LATEST_S, len(WRIST_NODES)).tolist()
            signals = [int(rng.choice([signal.SIGINT, signal.SIGTERM])) for _ in moments]
            running = [
                subprocess.Popen(entry.command(), stderr=said, stdout=subprocess.DEVNULL)
                for entry in WRIST_NODES
            ]
            told = [0.0] * len(running)
            ended = [0.0] * len(running)
            while not all(ended):
                now_ns = time.time_ns()
                load.publish(wrench_message(now_ns, "wrist_base", DOWN))
                for publisher in inputs:
                    publisher.publish(joint_message(now_ns, "", NAMES, np.array([0.1, -0.2])))
                for i, process in enumerate(running):
                    now = time.monotonic()
                    if not told[i] and now - begin > moments[i]:
                        process.send_signal(signals[i])
                        told[i] = now
                    if not ended[i] and process.poll() is not None:
                        ended[i] = now
                        took.append(now - (told[i] or now))
                time.sleep(TICK_S)
            codes = [process.returncode for process in running]
            if any(code not in (0, -by) for code, by in zip(codes, signals, strict=True)):
                said.seek(0)
                bad.append(f"codes {codes}, told after {np.round(moments, 2)} s\n{said.read()}")
        print(f"{len(took)} ends, longest {max(took):.2f} s, bad rounds {len(bad)}", flush=True)
    slowest = np.quantile(took, [0.5, 0.99, 1.0])
    print(f"{len(took)} ends, load average {os.getloadavg()[0]:.1f}; from the signal to the end")
    print(f"median {slowest[0]:.2f} s, 99 % {slowest[1]:.2f} s, longest {slowest[2]:.2f} s")
    print(f"longer than the watchdog's {END_S:g} s: {sum(t >= END_S for t in took)}")
    print(f"rounds with another exit code: {len(bad)}")
    for text in bad:
        print(text)
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
