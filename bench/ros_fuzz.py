"""Live nodes under wrong input: every topic, parameter and service, and chaos between them.

    python bench/ros_fuzz.py --messages 100000 --seed 1

Starts the three nodes as processes in a domain of their own, sends them random messages: well
formed ones with wild numbers and bytes that are no message, wild parameters and service calls;
holds them up (SIGSTOP), kills them, floods them, jumps the stamps, doubles the publishers.  After
each round every node must be alive, answer its services, and predict or forward again.  Prints what
was sent and what the nodes refused; exit code 1 where one did not come back.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 90))

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import (
    InertiaStamped,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    WrenchStamped,
)
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wrist_stiffness.commands.node_list import WRIST_NODES, NodeEntry

DEADLINE_S = 30.0
NAMES = ("motor_1_joint", "motor_2_joint")
TOPICS: dict[str, type] = {
    "joint_states": JointState,
    "load_estimate": WrenchStamped,
    "temperatures": Temperature,
    "covariates/humidity": Float64,
    "platform_pose_measured": PoseStamped,
    "platform_markers_measured": PoseArray,
    "frame_pose_measured": PoseStamped,
    "motor_commands": JointState,
    "motor_trajectory": JointTrajectory,
    "payload": InertiaStamped,
}
TRANSITIONS = [number for number in range(256) if number not in (5, 6, 7)]
"""All but the three that shut a node down for good, as they should."""

WILD = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e300, -1e300, float("nan"), float("inf"), float("-inf"))
TEXTS = ("", "/", "wrist_base", "wrist_platform", "wrist_corrected", "ä\n", "x" * 999, *NAMES)
YAML = (
    "2001-13-99",
    "[" * 5000,
    "{ft: {parent: wrist_base, rpy_deg: [2001-01-01, 1, 2]}}",
    "{ft: {parent: wrist_base, rpy_deg: [" + "9" * 500 + ", 1, 2]}}",
    "&a [*a]",
    "!!python/object:os.system x",
    "{ft: {parent: wrist_platform}}",
    "",
)


class _Fuzz:
    """Sends, and looks after the nodes."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        rclpy.init()
        self.node = rclpy.create_node("fuzz")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.sent: Counter[str] = Counter()
        self.heard: Counter[str] = Counter()
        self.levels: dict[str, DiagnosticStatus] = {}
        self.lost: list[str] = []
        self.publishers = {
            name: [self.node.create_publisher(kind, name, QoSProfile(depth=1000))]
            for name, kind in TOPICS.items()
        }
        for topic, kind in (
            ("pose_error_predicted", PoseWithCovarianceStamped),
            ("motor_commands_corrected", JointState),
            ("model_residual", PoseWithCovarianceStamped),
        ):
            self.node.create_subscription(
                kind, topic, lambda message, topic=topic: self._hear(topic), 10
            )
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_status, 10)
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        entries = [
            node.having({"covariates": "humidity", "state_folder": "", "tare_needed": False})
            for node in WRIST_NODES
        ]
        self.entries = {entry.name: entry for entry in entries}
        self.environment = environment
        self.processes = {name: self._start(entry) for name, entry in self.entries.items()}

    def _hear(self, topic: str) -> None:
        self.heard[topic] += 1

    def _on_status(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.levels[status.name] = status

    def _start(self, entry: NodeEntry) -> subprocess.Popen[bytes]:
        log = subprocess.DEVNULL
        return subprocess.Popen(entry.command(), env=self.environment, stdout=log, stderr=log)

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=left)

    def until(self, condition: Callable[[], Any], seconds: float = DEADLINE_S) -> bool:
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.05)
        return True

    # Wild messages

    def number(self) -> float:
        return self.rng.choice((*WILD, self.rng.uniform(-1.0, 1.0), self.rng.gauss(0.0, 1e3)))

    def wild(self, kind: type) -> Any:
        """Return a message of a kind whose fields hold anything that their types allow."""
        message = kind()
        for field, text in kind.get_fields_and_field_types().items():
            setattr(message, field, self._value(getattr(message, field), text))
        return message

    def _value(self, now: Any, text: str) -> Any:
        rng = self.rng
        if text in ("double", "float"):
            return self.number()
        if text in ("int32", "uint32"):
            low = -(2**31) if text == "int32" else 0
            return rng.choice((0, 1, 2**31 - 1, low, rng.randrange(low, 2**31)))
        if text == "string":
            return rng.choice(TEXTS)
        if text == "sequence<double>":
            return [self.number() for _ in range(rng.choice((0, 1, 2, 2, 2, 3, 40)))]
        if text == "sequence<string>":
            return rng.choice((NAMES, NAMES, NAMES[::-1], NAMES[:1], (), ("a", *NAMES), NAMES * 2))
        if text.startswith("sequence<"):
            kind = JointTrajectoryPoint if "Trajectory" in text else type(PoseStamped().pose)
            return [self.wild(kind) for _ in range(rng.choice((0, 1, 4, 30)))]
        if text == "double[36]":
            return [self.number() for _ in range(36)]
        return self.wild(type(now))

    def send_wild(self, count: int) -> None:
        """Send messages to random topics: wild ones, damaged bytes, some nearly right."""
        for _ in range(count):
            topic = self.rng.choice(list(TOPICS))
            message = self.wild(TOPICS[topic])
            if hasattr(message, "header") and self.rng.random() < 0.7:
                message.header.stamp = self.node.get_clock().now().to_msg()
                message.header.frame_id = self.rng.choice(("wrist_base", "wrist_platform", ""))
            kind = self.rng.random()
            if kind < 0.3:
                payload = bytearray(serialize_message(message))
                for _ in range(self.rng.choice((1, 1, 3))):
                    payload[self.rng.randrange(4, len(payload))] = self.rng.randrange(256)
                if kind < 0.1:
                    del payload[self.rng.randrange(4, len(payload)) :]
                message = bytes(payload)
            self.rng.choice(self.publishers[topic]).publish(message)
            self.sent[topic] += 1
            if not self.sent.total() % 50:
                self.executor.spin_once(timeout_sec=0.0)

    def send_good(self) -> None:
        """Send a load, a joint state, a command and a pose of now."""
        stamp = self.node.get_clock().now().to_msg()
        load = WrenchStamped()
        load.header.frame_id, load.wrench.force.z = "wrist_base", -1.0
        joints = JointState(name=NAMES, position=(0.1, -0.2))
        pose = PoseStamped()
        pose.header.frame_id = "wrist_base"
        for topic, message in (
            ("load_estimate", load),
            ("joint_states", joints),
            ("motor_commands", joints),
            ("platform_pose_measured", pose),
        ):
            message.header.stamp = stamp
            self.publishers[topic][0].publish(message)

    # Services and parameters

    def call(self, kind: type, name: str, request: Any, seconds: float = DEADLINE_S) -> Any:
        client = self.node.create_client(kind, name)
        try:
            if not self.until(client.service_is_ready, seconds):
                return None
            future = client.call_async(request)
            self.until(future.done, seconds)
            return future.result() if future.done() else None
        finally:
            self.node.destroy_client(client)

    def wild_parameter(self) -> ParameterMessage:
        rng = self.rng
        names = ("frames", "model_file", "load_age_limit_s", "slew_deg_s", "objective", "nothing")
        value = ParameterValue(
            type=rng.choice((0, 1, 2, 3, 3, 3, 4, 5, 9, 77)),
            double_value=self.number(),
            integer_value=rng.choice((0, 2**63 - 1, -(2**63))),
            string_value=rng.choice((*YAML, *TEXTS, "/dev/zero", "/dev/stdin", "/nowhere.yaml")),
        )
        return ParameterMessage(name=rng.choice(names), value=value)

    def wild_call(self, name: str) -> None:
        rng = self.rng
        kind = rng.randrange(3)
        if kind == 0:
            request = SetParameters.Request(
                parameters=[self.wild_parameter() for _ in range(rng.choice((1, 1, 5)))]
            )
            answer = self.call(SetParameters, f"{name}/set_parameters", request)
        elif kind == 1:
            transition = ChangeState.Request()
            transition.transition.id = rng.choice(TRANSITIONS)
            transition.transition.label = rng.choice(("", "", "x", "activate", "deactivate"))
            answer = self.call(ChangeState, f"{name}/change_state", transition)
        else:
            action = rng.choice(("tare", "reload_model", "tare/prepare", "reload_model/prepare"))
            answer = self.call(Trigger, f"{name}/{action}", Trigger.Request())
            request = SetBool.Request(data=rng.random() < 0.5)
            self.call(SetBool, f"{name}/{rng.choice(('enable', 'commit'))}", request)
        self.sent["calls"] += 1
        if answer is None:
            self.lost.append(f"{name}: a call was not answered")

    # Chaos

    def stop_and_go(self, name: str) -> None:
        self.processes[name].send_signal(signal.SIGSTOP)
        end = time.monotonic() + 0.7
        while time.monotonic() < end:
            self.send_good()
            self.spin(0.005)
        self.processes[name].send_signal(signal.SIGCONT)

    def kill(self, name: str) -> None:
        self.processes[name].kill()
        self.processes[name].wait()
        self.processes[name] = self._start(self.entries[name])

    def flood(self, name: str) -> None:
        plan = JointTrajectory(joint_names=NAMES)
        plan.points = [JointTrajectoryPoint(positions=(0.1, 0.1))] * 3000
        for _ in range(12):
            self.publishers["motor_trajectory"][0].publish(plan)
        for _ in range(5000):
            self.send_good()

    def jump(self, name: str) -> None:
        """Let stamps jump by years, ahead and back."""
        message = JointState(name=NAMES, position=(0.1, -0.2))
        for seconds in (2**31 - 1, 0, -5, 10**9):
            message.header.stamp.sec = seconds
            message.header.stamp.nanosec = 2**32 - 1
            for topic in ("joint_states", "motor_commands"):
                self.publishers[topic][0].publish(message)

    def second_publisher(self, name: str) -> None:
        for topic, kind in TOPICS.items():
            if len(self.publishers[topic]) == 1:
                self.publishers[topic].append(self.node.create_publisher(kind, topic, 10))

    # Judgement

    def look_after(self, when: str) -> None:
        """Bring the nodes back to their parameters and states; count those that do not come."""
        for name, process in self.processes.items():
            if process.poll() is not None:
                self.lost.append(f"{name}: ended with {process.returncode} {when}")
                self.processes[name] = self._start(self.entries[name])
        ask = GetParameters.Request(names=["autostart"])
        for name in self.processes:
            # Of a node that was killed the middleware believes for a while that it is there.
            get = f"{name}/get_parameters"
            if not any(self.call(GetParameters, get, ask, 5.0) for _ in range(12)):
                self.lost.append(f"{name}: no answer {when}")
                continue
            good = {"frames": "", "model_file": "", "objective": "pointing"}
            parameters = [
                ParameterMessage(name=key, value=ParameterValue(type=4, string_value=value))
                for key, value in good.items()
                if key != "objective" or name == "angle_corrector"
            ]
            for key, value in (("load_age_limit_s", 0.5), ("slew_deg_s", 0.5)):
                if key != "slew_deg_s" or name == "angle_corrector":
                    number = ParameterValue(type=3, double_value=value)
                    parameters.append(ParameterMessage(name=key, value=number))
            self.call(
                SetParameters,
                f"{name}/set_parameters",
                SetParameters.Request(parameters=parameters),
            )
            for transition in (4, 2, 1, 3):  # deactivate, clean up, configure, activate
                request = ChangeState.Request()
                request.transition.id = transition
                self.call(ChangeState, f"{name}/change_state", request)
        self.heard.clear()

        def all_answer() -> bool:
            self.send_good()
            return len(self.heard) == 3

        if not self.until(all_answer, DEADLINE_S):
            silent = {"pose_error_predicted", "motor_commands_corrected", "model_residual"}
            told = {name: status.message[:90] for name, status in self.levels.items()}
            self.lost.append(f"no {sorted(silent - set(self.heard))} {when}: {told}")

    def close(self) -> None:
        for name, process in self.processes.items():
            process.terminate()
            try:
                process.wait(DEADLINE_S)
            except subprocess.TimeoutExpired:
                self.lost.append(f"{name}: did not end")
                process.kill()
        self.node.destroy_node()
        rclpy.try_shutdown()


def main() -> int:
    """Run the rounds that give as many messages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no round after")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--round", type=int, default=5000, help="messages in a round")
    arguments = parser.parse_args()
    fuzz = _Fuzz(arguments.seed)
    chaos = (fuzz.stop_and_go, fuzz.kill, fuzz.flood, fuzz.jump, fuzz.second_publisher)
    start = time.monotonic()
    try:
        fuzz.look_after("at the start")
        done = 0
        while (
            fuzz.sent.total() < arguments.messages and time.monotonic() - start < arguments.seconds
        ):
            name = list(fuzz.processes)[done % 3]
            fuzz.send_wild(arguments.round)
            for _ in range(12):
                fuzz.wild_call(fuzz.rng.choice(list(fuzz.processes)))
            act = chaos[done % len(chaos)]
            act(name)
            fuzz.look_after(f"after round {done} ({act.__name__} of {name})")
            done += 1
            said = sum(
                int(value.value)
                for status in fuzz.levels.values()
                for value in status.values
                if value.key.startswith("refused ")
            )
            print(
                f"round {done}: {fuzz.sent.total()} sent, {said} refused since a start", flush=True
            )
    finally:
        fuzz.close()
    print(f"{sum(fuzz.sent.values())} sent in {time.monotonic() - start:.0f} s: {dict(fuzz.sent)}")
    for line in fuzz.lost:
        print(f"LOST {line}")
    return 1 if fuzz.lost else 0


if __name__ == "__main__":
    sys.exit(main())
