"""A managed node that no callback can end: the one place that guards them all."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from inspect import isawaitable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_srvs.srv import SetBool

from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.ros.changes import COMMIT, PREPARE, Change, Prepare
from wrist_stiffness.ros.executor import DataGroup
from wrist_stiffness.ros.qos import RELIABLE_QOS
from wrist_stiffness.topics import relative


class Health:
    """Counts of good samples and of faults by reason, for `/diagnostics` once a second."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._good = self._good_before = 0
        self._faults: Counter[str] = Counter()
        self._faults_before = 0
        self._newest = ""
        self._last: dict[str, str] = {}
        self._fresh: dict[str, str] = {}

    @property
    def faults(self) -> int:
        """How many samples were refused since the start."""
        return self._faults.total()

    def good(self) -> None:
        """Count a sample that went well."""
        self._good += 1

    def fault(self, error: Exception) -> None:
        """Count a fault by the kind of error."""
        kind = type(error).__name__
        self._faults[kind] += 1
        # By kind: a load that is refused is soon followed by many samples without a load.
        text = str(error) if isinstance(error, WristError) else repr(error)
        self._last[kind] = self._fresh[kind] = self._newest = text

    def report(self, facts: Mapping[str, str], missing: str, restriction: str) -> DiagnosticStatus:
        """Return the state since the last report.

        `facts`: what else to say.  `missing`: what the node cannot work without, where that is
        missing: an error.  `restriction`: what keeps it from its full work, a warning; empty for
        nothing.  Gives `DiagnosticStatus`: ERROR where something is missing, WARN where samples
        were refused or work is restricted, STALE where none came, else OK.
        """
        good = self._good - self._good_before
        faults = self.faults - self._faults_before
        self._good_before, self._faults_before = self._good, self.faults
        said, self._fresh = list(self._fresh.values()), {}
        if missing:
            level, message = DiagnosticStatus.ERROR, missing
        elif faults:
            level, message = DiagnosticStatus.WARN, f"{faults} refused: {'; '.join(said)}"
        elif restriction:
            level, message = DiagnosticStatus.WARN, restriction
        elif not good:
            level, message = DiagnosticStatus.STALE, "no input"
        else:
            level, message = DiagnosticStatus.OK, f"{good} samples"
        values = {
            "samples": str(self._good),
            **{f"refused {reason}": str(count) for reason, count in sorted(self._faults.items())},
            "last fault": self._newest,
            **{f"last {reason}": text for reason, text in sorted(self._last.items())},
            **facts,
        }
        return DiagnosticStatus(
            level=level,
            name=self._name,
            message=message,
            hardware_id="wrist",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )


LOG_EVERY_S = 5.0

UNCONFIGURED, INACTIVE, ACTIVE = "unconfigured", "inactive", "active"
CONFIGURED = (INACTIVE, ACTIVE)
ALL_STATES = (UNCONFIGURED, *CONFIGURED)


class GuardedNode(LifecycleNode):
    """Topics, timers and services whose callbacks may raise anything.

    What they raise is counted, logged and told in the status; the node goes on, and a service
    answers with it.
    """

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        # counts of good samples and faults
        self.health = Health(self.get_fully_qualified_name().lstrip("/"))
        self.sent_ns = 0  # when the message in hand was sent, by its sender's clock [ns]
        self._data_group = DataGroup()
        # Services may wait for each other, those of this node included.
        self._service_group = ReentrantCallbackGroup()
        self._prepared: Change | None = None  # between its two steps
        self._undo: Callable[[], None] | None = None
        for service in self.services:
            service.callback = self._answering(service.callback)
        self.serve(SetBool, f"~/{COMMIT}", lambda request: self._commit(request.data))

    @property
    def state(self) -> str:
        """State of the lifecycle: unconfigured, inactive, active, finalized or in transition."""
        label: str = self._state_machine.current_state[1]
        return label

    def say(self, message_type: type, topic: str, qos: QoSProfile = RELIABLE_QOS) -> Publisher:
        """Return a publisher of a topic, within the node's namespace."""
        return self.create_publisher(message_type, relative(topic), qos)

    def hear(
        self,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        states: Sequence[str] = (ACTIVE,),
        read: Callable[[bytes], Any] | None = None,
    ) -> None:
        """Subscribe to a part of the node's stream.

        `callback`: takes a message; may raise anything; `states`: states of the lifecycle in which
        messages count; in others they are dropped; `read`: takes a payload apart that is too quick
        for rclpy's message objects.
        """

        def heard(message: Any, info: Mapping[str, Any]) -> None:
            if self.state not in states:
                return
            self.sent_ns = info["source_timestamp"]
            try:
                callback(message if read is None else read(message))
            except Exception as error:
                self.on_fault(error)

        self.create_subscription(
            message_type,
            relative(topic),
            heard,  # type: ignore[arg-type]
            qos,
            callback_group=self._data_group,
            raw=read is not None,
        )

    def every(self, period_s: float, callback: Callable[[], None]) -> None:
        """Call something again and again, by the steady clock: a simulated one may stand still."""

        def tick() -> None:
            try:
                callback()
            except Exception as error:
                self.on_fault(error)

        self.create_timer(period_s, tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def serve(self, service_type: type, name: str, act: Callable[[Any], Any]) -> None:
        """Offer a service of std_srvs.

        `act`: takes the request and returns what to say, or an awaitable of it; what it raises is
        the answer, too.
        """

        async def answer(request: Any, response: Any) -> Any:
            try:
                said = act(request)
                response.message = (await said) if isawaitable(said) else said
                response.success = True
            except Exception as error:
                self.on_fault(error)
                response.success, response.message = False, str(error)
            self.after_service()
            return response

        self.create_service(service_type, name, answer, callback_group=self._service_group)

    def offer(self, action: str, service_type: type, prepare: Prepare) -> None:
        """Offer a change of this node, at once as `~/ACTION`, and in two steps (see `changes`)."""

        async def prepared(request: Any) -> Change:
            change = prepare(request)
            return change if isinstance(change, Change) else await change

        async def at_once(request: Any) -> str:
            change = await prepared(request)
            change.make()
            return change.said

        async def first_step(request: Any) -> str:
            # Instead of any other, which stays as it is even if this one is refused.
            self._prepared = self._undo = None
            self._prepared = await prepared(request)
            return self._prepared.said

        self.serve(service_type, f"~/{action}", at_once)
        self.serve(service_type, f"~/{action}/{PREPARE}", first_step)

    def _commit(self, wanted: bool) -> str:
        """Make the change that was prepared, or drop or undo it."""
        change, undo = self._prepared, self._undo
        self._prepared = self._undo = None
        if not wanted:
            if undo is not None:
                undo()
            return "as before"
        if change is None:
            raise InputError("nothing is prepared")
        self._undo = change.make()
        return change.said

    def on_fault(self, error: Exception) -> None:
        """Count what a callback raised, log it, at most every five seconds, and go on."""
        if not self.context.ok():
            # Told to end in the midst of a callback: all of ROS fails then, and nothing is wrong.
            return
        self.health.fault(error)
        if isinstance(error, WristError):
            self.get_logger().warning(str(error), throttle_duration_sec=LOG_EVERY_S)
        else:
            text = "".join(traceback.format_exception(error))
            self.get_logger().error(text, throttle_duration_sec=LOG_EVERY_S)

    def after_service(self) -> None:
        """Do what is to follow every service of the node's own."""

    def _answering(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return a service's callback that answers even where rclpy's own would raise."""

        async def answer(request: Any, response: Any) -> Any:
            try:
                given = callback(request, response)
                return (await given) if isawaitable(given) else given
            except Exception as error:
                self.on_fault(error)
                return response

        return answer
