"""Data first, in their order, and services and timers all the same."""

import time
from threading import Event, Thread

import pytest
import rclpy
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

from wrist_stiffness.ros.executor import DataGroup, StreamExecutor, take_in_order

DEADLINE_S = 20.0
MESSAGES = 5


class Rig:
    """A node under test, and another one beside it that asks for its service."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("under_test", context=self.context)
        self.asker = rclpy.create_node("asker", context=self.context)
        self.executor = StreamExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.group = DataGroup()
        self.failure = None
        self.thread = Thread(target=self._spin)

    def _spin(self):
        try:
            self.executor.spin()
        except Exception as error:
            self.failure = error

    def close(self):
        rclpy.shutdown(context=self.context)
        if self.thread.ident:
            self.thread.join(DEADLINE_S)
            assert not self.thread.is_alive()
        for node in (self.node, self.asker):
            node.destroy_node()

    def until(self, condition):
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.thread.join(0.01)

    def hear(self, topic, callback):
        return self.node.create_subscription(
            Int64, topic, callback, MESSAGES, callback_group=self.group
        )


@pytest.fixture
def rig():
    made = Rig()
    yield made
    made.close()


def test_a_later_topic_waits_until_the_earlier_one_is_empty(rig):
    heard, arrived = [], []
    subscriptions = [
        rig.hear(topic, lambda message, topic=topic: heard.append((topic, message.data)))
        for topic in ("first", "second")
    ]
    rig.asker.create_subscription(Int64, "first", arrived.append, MESSAGES)
    publishers = {
        topic: rig.asker.create_publisher(Int64, topic, 10) for topic in ("second", "first")
    }
    rig.until(lambda: publishers["first"].get_subscription_count() == 2)
    rig.until(publishers["second"].get_subscription_count)
    for publisher in publishers.values():
        for number in range(MESSAGES):
            publisher.publish(Int64(data=number))
    beside = SingleThreadedExecutor(context=rig.context)
    beside.add_node(rig.asker)
    end = time.monotonic() + DEADLINE_S
    while len(arrived) < MESSAGES and time.monotonic() < end:
        beside.spin_once(timeout_sec=0.1)
    assert not take_in_order(subscriptions)
    assert heard == [(topic, i) for topic in ("first", "second") for i in range(MESSAGES)]


def test_services_and_timers_run_while_data_never_pause(rig):
    heard, ticks = [], []
    again = rig.node.create_publisher(Int64, "loop", 10)

    def feed_itself(message):
        heard.append(message.data)
        again.publish(message)

    rig.hear("loop", feed_itself)
    rig.node.create_service(Trigger, "ask", lambda request, response: response)
    rig.node.create_timer(0.05, lambda: ticks.append(len(heard)))
    client = rig.asker.create_client(Trigger, "ask")
    rig.until(again.get_subscription_count)
    again.publish(Int64(data=1))
    rig.thread.start()
    beside = SingleThreadedExecutor(context=rig.context)
    beside.add_node(rig.asker)
    assert client.wait_for_service(DEADLINE_S)
    answer = client.call_async(Trigger.Request())
    beside.spin_until_future_complete(answer, DEADLINE_S)
    assert answer.done()
    rig.until(lambda: len(ticks) >= 2 and ticks[-1] > ticks[0] > 0)


def test_a_subscription_that_comes_while_running_is_heard(rig):
    heard = []

    def on_ask(request, response):
        rig.hear("late", heard.append)
        return response

    rig.node.create_service(Trigger, "ask", on_ask)
    client = rig.asker.create_client(Trigger, "ask")
    late = rig.asker.create_publisher(Int64, "late", 10)
    rig.thread.start()
    beside = SingleThreadedExecutor(context=rig.context)
    beside.add_node(rig.asker)
    assert client.wait_for_service(DEADLINE_S)
    beside.spin_until_future_complete(client.call_async(Trigger.Request()), DEADLINE_S)
    rig.until(late.get_subscription_count)
    late.publish(Int64(data=3))
    rig.until(lambda: [each.data for each in heard] == [3])


def test_a_service_that_waits_for_a_thread_answers_while_data_go_on(rig):
    heard, release = [], Event()

    def work(done):
        release.wait(DEADLINE_S)
        done.set_result(None)

    async def on_ask(request, response):
        done = Future(executor=rig.executor)
        Thread(target=work, args=(done,)).start()
        await done
        response.message = "done"
        return response

    rig.hear("data", heard.append)
    rig.node.create_service(Trigger, "ask", on_ask)
    client = rig.asker.create_client(Trigger, "ask")
    data = rig.asker.create_publisher(Int64, "data", 10)
    rig.thread.start()
    beside = SingleThreadedExecutor(context=rig.context)
    beside.add_node(rig.asker)
    assert client.wait_for_service(DEADLINE_S)
    rig.until(data.get_subscription_count)
    answer = client.call_async(Trigger.Request())
    data.publish(Int64(data=7))
    rig.until(lambda: heard)
    assert not answer.done()
    release.set()
    beside.spin_until_future_complete(answer, DEADLINE_S)
    assert answer.result().message == "done"


def test_a_publisher_of_another_quality_is_warned_of_as_by_rclpy(rig):
    """The event of the middleware reaches the handler of a data subscription."""
    warned = []
    rig.node.create_subscription(
        Int64,
        "asked",
        lambda message: None,
        10,
        callback_group=DataGroup(),
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=warned.append),
    )
    rig.thread.start()
    offered = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    rig.asker.create_publisher(Int64, "asked", offered)
    rig.until(lambda: warned)


def test_what_a_data_callback_raises_ends_the_spin(rig):
    def fail(message):
        raise ValueError("of the callback")

    rig.hear("bad", fail)
    bad = rig.asker.create_publisher(Int64, "bad", 10)
    rig.thread.start()
    rig.until(bad.get_subscription_count)
    bad.publish(Int64())
    rig.until(lambda: rig.failure is not None)
    assert str(rig.failure) == "of the callback"
