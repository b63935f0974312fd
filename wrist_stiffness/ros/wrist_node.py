"""What the wrist's nodes share: parameters, model, lifecycle and diagnostics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any, TypeVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped, WrenchStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from sensor_msgs.msg import Temperature
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from wrist_stiffness.compensation.parameters import (
    COMMON,
    ParameterEntry,
    stream_settings,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.ros import static_transforms
from wrist_stiffness.ros.conversions import nanoseconds
from wrist_stiffness.ros.executor import DataGroup
from wrist_stiffness.ros.health import Health
from wrist_stiffness.ros.parameters import declare, model_path, values_of
from wrist_stiffness.ros.qos import RELIABLE_QOS, SENSOR_QOS, STATIC_QOS
from wrist_stiffness.ros.stream_messages import WrenchSample, wrench_reader

REPORT_EVERY_S = 1.0

Numbers = TypeVar("Numbers")


class WristNode(LifecycleNode, ABC):
    """A managed node around one stream of the core.

    Without a model it is active all the same and gives the safe output, so that a wrong file never
    cuts the commands off; `~/reload_model` heals it.

    Parameters
    ----------
    name : str
        Node name.
    entries : sequence of ParameterEntry
        Parameters beside the common ones.
    options
        Of rclpy's node.

    Attributes
    ----------
    stream : Stream
        Of the core.
    health : Health
        Counts of good samples and faults.
    left_out : tuple of str
        Effects that the model left out of its last prediction, and why.

    Raises
    ------
    InputError
        If a parameter cannot be used.
    rclpy.exceptions.ParameterException
        If a parameter has another type or is out of range.
    """

    stream: Stream

    def __init__(self, name: str, entries: Sequence[ParameterEntry], **options: Any) -> None:
        super().__init__(name, **options)
        self._entries = (*COMMON, *entries)
        declare(self, self._entries)
        self.health = Health(self.get_name())
        self.stream = self.make_stream(self.apply_values(values_of(self, self._entries)))
        self._model_fault = "no model is loaded"
        self.left_out: tuple[str, ...] = ()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._use_parameters)
        # Of a group of its own: while it waits for the model, no other callback of its group runs.
        self.create_service(
            Trigger,
            "~/reload_model",
            self._on_reload,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        self.create_service(Trigger, "~/tare", self._on_tare)
        self._data_group = DataGroup()
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE_QOS)
        # Not the node's clock: a simulated one may stand still.
        self.create_timer(
            REPORT_EVERY_S, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @abstractmethod
    def make_stream(self, settings: StreamSettings) -> Stream:
        """Return the node's stream, without a model."""

    def apply_values(self, values: Mapping[str, Any]) -> StreamSettings:
        """Check parameters and return the settings that they stand for (may raise InputError)."""
        return stream_settings(values)

    def facts(self) -> dict[str, str]:
        """Return what the node adds to its diagnostics."""
        return {}

    def restriction(self) -> str:
        """Return what keeps the node from its full work although all is well; a warning."""
        return ""

    def autostart(self) -> None:
        """Configure and activate, unless the parameter `autostart` says no."""
        if self.get_parameter("autostart").value:
            self.trigger_configure()
            self.trigger_activate()

    # Lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model."""
        try:
            self._use_model(loaded(self._model_path()))
        except WristError as error:
            self._model_fault = str(error)
            self.warn(error)
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to listen; the load first, so that it is taken before a joint state that waits."""
        covariates = self.get_parameter("covariates").value.split()
        transforms = static_transforms.message_type()
        self._inputs = [
            *(
                []
                if transforms is None
                else [self.hear(transforms, "/tf_static", self._on_tf_static, STATIC_QOS)]
            ),
            self.hear_bytes(
                WrenchStamped, "/load_estimate", wrench_reader(), self._on_load, SENSOR_QOS
            ),
            self.hear(Temperature, "/temperatures", self._on_temperature, SENSOR_QOS),
            *(
                self.hear(
                    Float64, f"/covariates/{name}", partial(self._on_covariate, name), SENSOR_QOS
                )
                for name in covariates
            ),
            *self.make_inputs(),
        ]
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening."""
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        return super().on_deactivate(state)

    @abstractmethod
    def make_inputs(self) -> list[Subscription]:
        """Return the node's subscriptions beside the load's, what is to be taken first first."""

    def hear(
        self, message_type: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile
    ) -> Subscription:
        """Subscribe to a part of the node's stream."""
        return self.create_subscription(
            message_type, topic, callback, qos, callback_group=self._data_group
        )

    def hear_bytes(
        self,
        message_type: type,
        topic: str,
        read: Callable[[bytes], Numbers],
        callback: Callable[[Numbers], None],
        qos: QoSProfile,
    ) -> Subscription:
        """Subscribe to a part of the stream that is too quick for rclpy's message objects.

        Parameters
        ----------
        message_type : type
            Of the topic.
        topic : str
            Its name.
        read : callable
            Takes a payload apart; raises WristError where that is not possible, a fault.
        callback : callable
            Takes what was read.
        qos : QoSProfile
            Of the subscription.

        Returns
        -------
        Subscription
            To be destroyed when the node no longer listens.
        """

        def on_payload(payload: bytes) -> None:
            try:
                numbers = read(payload)
            except WristError as error:
                self.warn(error)
                return
            callback(numbers)

        return self.create_subscription(
            message_type, topic, on_payload, qos, callback_group=self._data_group, raw=True
        )

    # Inputs that all nodes have

    def _on_load(self, load: WrenchSample) -> None:
        try:
            self.stream.loads.add(*load)
        except WristError as error:
            self.warn(error)
        else:
            self.after_load()

    def _on_tf_static(self, message: Any) -> None:
        self.on_transforms(message.transforms)

    def on_transforms(self, messages: Sequence[TransformStamped]) -> None:
        """Learn sensor frames from static transforms; one that is none is left out."""
        for message in messages:
            try:
                self.stream.on_static_transforms([static_transforms.converted(message)])
            except WristError as error:
                self.warn(error)

    def _on_temperature(self, message: Temperature) -> None:
        try:
            self.stream.temperatures.add(
                message.header.frame_id, nanoseconds(message.header.stamp), message.temperature
            )
        except WristError as error:
            self.warn(error)

    def _on_covariate(self, name: str, message: Float64) -> None:
        # The message has no stamp of its own.
        try:
            self.stream.covariates.add(name, self.get_clock().now().nanoseconds, message.data)
        except WristError as error:
            self.warn(error)

    def after_load(self) -> None:
        """Do what waited for a load."""

    def warn(self, error: WristError) -> None:
        """Count a fault and log it, at most every five seconds."""
        self.health.fault(error)
        self.get_logger().warning(str(error), throttle_duration_sec=5.0)

    # Services

    async def _on_reload(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        try:
            loading: Future = Future(executor=self.executor)
            Thread(target=_load, args=(self._model_path(), loading), daemon=True).start()
            # Samples go on being answered with the old model until the new one is complete.
            self._use_model(await loading)
        except WristError as error:
            self.warn(error)
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, self.facts_of_model()["model"]
        return response

    def _on_tare(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            load = self.stream.tare()
        except WristError as error:
            self.warn(error)
            response.success, response.message = False, str(error)
        else:
            response.success = True
            response.message = f"new zero of the load [N, N m]: {load.wrench.tolist()}"
        return response

    # Parameters and model

    def _check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        values = {**values_of(self, self._entries), **{p.name: p.value for p in changes}}
        try:
            self.apply_values(values)
        except WristError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _use_parameters(self, changes: list[Parameter]) -> None:
        self.stream.settings = self.apply_values(values_of(self, self._entries))

    def _model_path(self) -> Path:
        return model_path(self.get_parameter("model_file").value)

    def _use_model(self, model: ErrorModel) -> None:
        running = self.stream.model
        if running is not None and running.table.geometry.sha256 != model.table.geometry.sha256:
            raise InputError(
                f"model {model.name}: geometry {model.table.geometry.name} is not that of the "
                f"running model {running.name}; restart the node for another wrist"
            )
        self.stream.model = model
        self._model_fault = ""

    # Diagnostics

    def facts_of_model(self) -> dict[str, str]:
        """Return which model is in use."""
        model = self.stream.model
        if model is None:
            return {"model": "none"}
        return {"model": f"{model.name}, table {model.table.checksum[:12]}, {model.evaluation}"}

    def _report(self) -> None:
        facts = {
            **self.facts_of_model(),
            "loads that came late": str(self.stream.loads.history.late),
            **self.facts(),
        }
        restrictions = filter(
            None, (self.restriction(), *self.left_out, *self.stream.dropped_signals)
        )
        message = DiagnosticArray(
            status=[self.health.report(facts, self._model_fault, "; ".join(restrictions))]
        )
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def loaded(path: Path) -> ErrorModel:
    """Return a model after a first prediction, which fills what it computes once.

    Raises
    ------
    WristError
        If it cannot be loaded, whatever the reason: a model file may name a law of the user's own,
        which is code, and no file may end a node.
    """
    try:
        model = load_model(path)
        model.predict(np.zeros(2), Load(np.zeros(6)))
    except WristError:
        raise
    except Exception as error:
        raise InputError(f"{path}: {type(error).__name__}: {error}") from error
    return model


def _load(path: Path, loading: Future) -> None:
    try:
        loading.set_result(loaded(path))
    except WristError as error:
        loading.set_exception(error)
