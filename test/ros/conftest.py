"""Live nodes in this process, with a probe beside them; every wait ends at a deadline."""

import gc
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.ros.conversions import joint_message, wrench_message
from wrist_stiffness.ros.qos import RELIABLE_QOS
from wrist_stiffness.shipped import shipped_file

with warnings.catch_warnings():
    # The first message of a process imports modules that warn of their age.
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

DEADLINE_S = 20.0
NAMES = ("motor_1_joint", "motor_2_joint")
OF_A_TEST = {"state_folder": "", "tare_needed": False, "command_age_limit_s": 0.0}


class Graph:
    """One executor with the nodes under test and a probe that publishes and listens."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.probe = rclpy.create_node("probe", context=self.context)
        self.executor.add_node(self.probe)
        self.heard = defaultdict(list)
        self._publishers = {}
        self.listen(DiagnosticArray, "/diagnostics")

    def close(self):
        for node in self.executor.get_nodes():
            node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)

    def add(self, make_node, **parameters):
        parameters = OF_A_TEST | parameters
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = make_node(context=self.context, parameter_overrides=overrides)
        self.executor.add_node(node)
        return node

    def listen(self, message_type, topic):
        self.probe.create_subscription(message_type, topic, self.heard[topic].append, RELIABLE_QOS)

    def until(self, condition, what="the expected"):
        end_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end_s, f"{what} did not come within {DEADLINE_S} s"
            self.executor.spin_once(timeout_sec=0.05)

    def connected(self, *topics):
        """Wait until everything that the probe hears and says has its other end."""
        for topic in topics:
            self.until(
                lambda topic=topic: (
                    self.probe.count_publishers(topic) and self.probe.count_subscribers(topic)
                ),
                f"connection of {topic}",
            )

    def publish(self, topic, message):
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self.probe.create_publisher(type(message), topic, RELIABLE_QOS)
            self._publishers[topic] = publisher
            self.until(publisher.get_subscription_count, f"subscription of {topic}")
        publisher.publish(message)

    def load(self, stamp_ns, wrench=(0, 0, -1.0, 0, 0, 0), frame_id="wrist_base"):
        self.publish("/load_estimate", wrench_message(stamp_ns, frame_id, np.array(wrench, float)))

    def joints(self, topic, stamp_ns, theta=(0.1, -0.2), names=NAMES, frame_id=""):
        self.publish(topic, joint_message(stamp_ns, frame_id, names, np.array(theta, float)))

    def call(self, service_type, name, request):
        client = self.probe.create_client(service_type, name)
        self.until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.until(future.done, f"answer of {name}")
        self.probe.destroy_client(client)
        return future.result()

    def status(self, name, condition):
        """Return the values of the next diagnostic of a node that meets a condition."""
        found = []

        def look():
            for array in self.heard["/diagnostics"]:
                for status in array.status:
                    values = {value.key: value.value for value in status.values}
                    if status.name == name and condition(status, values):
                        found.append((status, values))
            return bool(found)

        self.until(look, f"diagnostic of {name}")
        return found[-1]


@pytest.fixture(autouse=True)
def _nothing_is_left():
    """Free the nodes of a test at its end.

    Their participants live until the collector comes, at any moment of another test; beside live
    ones in one process Fast DDS may then wait for itself for ever.
    """
    yield
    gc.collect()


@pytest.fixture
def graph():
    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture(scope="session")
def model_path() -> Path:
    return shipped_file("config/palmieri2015_model.yaml")


@pytest.fixture(scope="session")
def model(model_path):
    return load_model(model_path)
