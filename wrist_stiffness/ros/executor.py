"""An executor for nodes that live on a stream: data first, in a fixed order, and with little ado.

rclpy's single-threaded executor gathers every service, timer and topic of a node anew for each
message, in Python, twice; for a managed node that costs several times the prediction.  It also
takes one message of each topic in turn, so that a joint state can overtake the load that belongs to
it.  Here data are taken straight from their subscriptions, always from the first one that has any;
rclpy's own loop serves all else, one callback at a time between the data.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription

LONGEST_RUN_S = 0.02
"""While data keep coming, the others are looked for this often."""

LONGEST_WAIT_S = 1.0
"""What cannot be waited for, events of the middleware, is looked for this often."""

TASK_WAIT_S = 0.01
"""The same while a coroutine waits: rclpy does not say what would wake it."""

NANOSECONDS = 1_000_000_000


class DataGroup(MutuallyExclusiveCallbackGroup):
    """Marks the subscriptions of a node's stream.

    `StreamExecutor` empties them in the order of their creation: a later one waits until the
    earlier ones are empty.  Callbacks are plain functions.  Under any other executor this is a
    common group.
    """


def is_data(entity: Any) -> bool:
    """Tell whether an entity is a data subscription; its event handlers are none."""
    return isinstance(entity, Subscription) and isinstance(entity.callback_group, DataGroup)


class StreamExecutor(SingleThreadedExecutor):
    """Single-threaded executor that serves subscriptions of a `DataGroup` first.

    What a callback raises goes to its node's `on_fault` if it has one, else out of `spin`.
    """

    def spin(self) -> None:
        """Execute callbacks until shutdown."""
        while self._context.ok() and not self._is_shutdown:
            data = [each for node in self.get_nodes() for each in node.subscriptions]
            data = list(filter(is_data, data))
            if data:
                self._serve_data(data)
            self._serve_other(0.0 if data else LONGEST_WAIT_S)

    def can_execute(self, entity: Any) -> bool:
        """Tell whether rclpy's loop may run an entity: never a data subscription."""
        return not is_data(entity) and super().can_execute(entity)

    def _serve_other(self, longest_s: float) -> None:
        """Run one callback that rclpy's loop finds ready."""
        try:
            handler, _, node = self.wait_for_ready_callbacks(longest_s)
        except (TimeoutException, ShutdownException):
            return
        handler()
        error = handler.exception()
        if error is None:
            return
        on_fault = getattr(node, "on_fault", None)
        if on_fault is None:
            raise error
        on_fault(error)

    def _serve_data(self, data: Sequence[Subscription]) -> None:
        """Run data callbacks until something else is ready."""
        # Only others, that run in rclpy's loop, make or remove entities: the set stays as it is.
        waiting = Waiting(self, data)
        while not self._is_shutdown:
            more = take_in_order(data)
            idle_s = TASK_WAIT_S if self._tasks else LONGEST_WAIT_S
            others = waiting.for_others(0.0 if more else idle_s)
            if not self._context.ok():
                raise ExternalShutdownException()
            if others or self._tasks:
                return


def take_in_order(subscriptions: Sequence[Subscription]) -> bool:
    """Take messages, always from the first subscription that has one, and call its callback.

    Gives whether there may be more: after `LONGEST_RUN_S` it is somebody else's turn.
    """
    end = time.monotonic() + LONGEST_RUN_S
    while time.monotonic() < end:
        for subscription in subscriptions:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                with_info = subscription._callback_type is WITH_INFO
                subscription.callback(*(taken if with_info else taken[:1]))
                break
        else:
            return False
    return True


WITH_INFO = Subscription.CallbackType.WithMessageInfo


class Waiting:
    """A wait set of all that can wake an executor.

    `executor`: with its nodes as they are now; `data`: what is no reason to stop serving data.
    """

    def __init__(self, executor: StreamExecutor, data: Sequence[Subscription]) -> None:
        nodes = executor.get_nodes()
        entities: dict[str, list[Any]] = {
            "subscription": [each for node in nodes for each in node.subscriptions],
            "guard_condition": [each for node in nodes for each in node.guards],
            "timer": [each for node in nodes for each in node.timers],
            "client": [each for node in nodes for each in node.clients],
            "service": [each for node in nodes for each in node.services],
        }
        # The one says that a task or a node has come, the other that the process is to end.
        entities["guard_condition"] += [executor._guard, executor._sigint_gc]
        sizes = map(len, entities.values())
        self._set = rclpy_implementation.WaitSet(*sizes, 0, executor.context.handle)
        self._additions = [
            (getattr(self._set, f"add_{kind}"), entity.handle)
            for kind, members in entities.items()
            for entity in members
        ]
        self._kinds = list(entities)
        self._data = {each.handle.pointer for each in data}

    def for_others(self, longest_s: float) -> bool:
        """Wait for anything and tell whether others than data are ready, or nothing came at all."""
        self._set.clear_entities()
        for add, handle in self._additions:
            add(handle)
        self._set.wait(round(longest_s * NANOSECONDS))
        ready = {each for kind in self._kinds for each in self._set.get_ready_entities(kind)}
        return not ready or not ready <= self._data
