"""What the wrist's nodes share: parameters, lifecycle, common inputs, services and the status."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures import wait as wait_for
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import Temperature
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from wrist_stiffness.compensation.intake import transform_of
from wrist_stiffness.compensation.load_history import NANOSECONDS
from wrist_stiffness.compensation.parameters import COMMON, ParameterEntry, stream_settings
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import Stream
from wrist_stiffness.errors import InputError, WristError
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.model.python_laws import python_laws
from wrist_stiffness.ros.changes import Change, until
from wrist_stiffness.ros.conversions import nanoseconds, transforms_type
from wrist_stiffness.ros.guarded_node import (
    ACTIVE,
    ALL_STATES,
    CONFIGURED,
    UNCONFIGURED,
    GuardedNode,
)
from wrist_stiffness.ros.kept_tare import KeptTare, Tare
from wrist_stiffness.ros.parameters import declare, model_path, values_of
from wrist_stiffness.ros.qos import RELIABLE_QOS, SENSOR_QOS, STATE_QOS, STATIC_QOS
from wrist_stiffness.ros.stream_messages import WrenchSample, wrench_reader
from wrist_stiffness.topics import (
    BASE_FRAME,
    COVARIATES,
    DIAGNOSTICS,
    LOAD_ESTIMATE,
    TEMPERATURES,
    TF_STATIC,
    WRIST_STATUS,
)

REPORT_EVERY_S = 1.0

LOOK_EVERY_S = 0.1


class Loading:
    """One model on its way, in a thread that dies with the process: no file may hold the node up.

    `limit_s`: longest time that may take [s]; `allow_python_laws`: run the Python files that the
    model names.
    """

    def __init__(self, path: Path, limit_s: float, allow_python_laws: bool) -> None:
        self.limit_s = limit_s
        self._path, self._allowed = path, allow_python_laws
        self._model: Future[ErrorModel] = Future()
        Thread(target=self._load, daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the model is there, or why it is not."""
        return self._model.done()

    def wait(self, go_on: Callable[[], bool]) -> None:
        """Wait until it is done, or for as long as it may take and the node is to go on."""
        end = time.monotonic() + self.limit_s
        while not self.done and go_on() and time.monotonic() < end:
            wait_for([self._model], LOOK_EVERY_S)

    def result(self) -> ErrorModel:
        """Return the model (WristError if it cannot be loaded, whatever the reason)."""
        if not self.done:
            raise InputError(f"{self._path}: not loaded within {self.limit_s:g} s; given up")
        return self._model.result()

    def _load(self) -> None:
        try:
            if self._path.exists() and not self._path.is_file():
                raise InputError(f"{self._path}: is no regular file")
            with python_laws(self._allowed):
                model = load_model(self._path)
            # The first prediction fills what is computed once.
            model.predict(np.zeros(2), Load(np.zeros(6)))
            self._model.set_result(model)
        except WristError as error:
            self._model.set_exception(error)
        except SystemExit:
            ending = InputError(f"{self._path}: the law of the model ends the program")
            self._model.set_exception(ending)
        except BaseException as error:
            # A model file may name a law of the user's own, which is code.
            text = f"{self._path}: {type(error).__name__}: {error}"
            self._model.set_exception(InputError(text))


class WristNode(GuardedNode, ABC):
    """A managed node around one stream of the core.

    Unconfigured it has no model and knows nothing; inactive it takes in loads and slow signals;
    active it answers.

    Raises `InputError` if a parameter cannot be used; `rclpy.exceptions.ParameterException` if a
    parameter has another type or is out of range.
    """

    stream: Stream

    def __init__(self, name: str, entries: Sequence[ParameterEntry], **options: Any) -> None:
        super().__init__(name, **options)
        self._entries = (*COMMON, *entries)
        declare(self, self._entries)
        self.stream = self.make_stream(stream_settings(values_of(self, self._entries)))
        self.base_frame = self.stream.settings.frames.prefix + BASE_FRAME  # name of F on topics
        # effects that the model left out of its last prediction, and why
        self.left_out: tuple[str, ...] = ()
        self._fault = ""
        self._load_heard_s: float | None = None
        self._tare: Tare | None = None
        self._kept_tare = KeptTare(
            self.get_parameter("state_folder").value, self.get_fully_qualified_name()
        )
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._use_parameters)
        self.offer("tare", Trigger, lambda request: self._tare_change())
        self.offer("reload_model", Trigger, lambda request: self._model_change())
        self.offer("enable", SetBool, self.enable_change)
        self._diagnostics = self.say(DiagnosticArray, DIAGNOSTICS, RELIABLE_QOS)
        self._status = self.say(DiagnosticStatus, WRIST_STATUS, STATE_QOS)
        self.every(REPORT_EVERY_S, self.report)

    # What a node is made of

    @abstractmethod
    def make_stream(self, settings: StreamSettings) -> Stream:
        """Return the node's stream, without a model."""

    @abstractmethod
    def make_inputs(self) -> None:
        """Hear what the node needs beside loads and slow signals, in the order of taking."""

    def facts(self) -> dict[str, str]:
        """Return what the node adds to its status."""
        return {}

    def restriction(self) -> str:
        """Return what keeps the node from its full work although all is well; a warning."""
        return ""

    def start(self) -> None:
        """Listen; configure and activate, unless the parameter `autostart` says no."""
        self._hear_signals()
        self.make_inputs()
        if (
            self.get_parameter("autostart").value
            and self.trigger_configure() == TransitionCallbackReturn.SUCCESS
        ):
            self.trigger_activate()

    def _hear_signals(self) -> None:
        """Hear what all nodes need; a load is taken before a joint state that waits."""
        transforms = transforms_type()
        if transforms is not None:
            self.hear(transforms, TF_STATIC, self.on_transforms, STATIC_QOS, ALL_STATES)
        loads = wrench_reader()
        self.hear(WrenchStamped, LOAD_ESTIMATE, self._on_load, SENSOR_QOS, CONFIGURED, loads)
        self.hear(Temperature, TEMPERATURES, self._on_temperature, SENSOR_QOS, CONFIGURED)
        for name in self.get_parameter("covariates").value.split():
            on_covariate = partial(self._on_covariate, name)
            self.hear(Float64, COVARIATES + name, on_covariate, SENSOR_QOS, CONFIGURED)

    # Lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model; without one the node stays unconfigured and says why."""
        loading = self._loading()
        loading.wait(self.context.ok)
        try:
            self.stream.model = loading.result()
        except WristError as error:
            self._fault = str(error)
            self.on_fault(error)
            return TransitionCallbackReturn.FAILURE
        self._fault = ""
        self._take_up_tare()
        return super().on_configure(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything: model, tare, payload, loads and whether the correction was on."""
        self.stream = self.make_stream(self.stream.settings)
        self.left_out, self._load_heard_s = (), None
        self._set_tare(None)
        return super().on_cleanup(state)

    # Inputs that all nodes have

    def _on_load(self, load: WrenchSample) -> None:
        self.stream.loads.add(*load)
        self._load_heard_s = time.monotonic()
        self.after_load()

    def on_transforms(self, message: Any) -> None:
        """Learn sensor frames from a tf2_msgs/TFMessage; a transform that is none is left out."""
        for each in message.transforms:
            try:
                self.stream.on_static_transforms([transform_of(each)])
            except WristError as error:
                self.on_fault(error)

    def _on_temperature(self, message: Temperature) -> None:
        self.stream.temperatures.add(
            message.header.frame_id, nanoseconds(message.header.stamp), message.temperature
        )

    def _on_covariate(self, name: str, message: Float64) -> None:
        # The message has no stamp of its own.
        self.stream.covariates.add(name, self.get_clock().now().nanoseconds, message.data)

    def after_load(self) -> None:
        """Do what waited for a load."""

    def require_ready(self) -> None:
        """Refuse what needs a node at work: active, with a model and with loads that arrive.

        Raises `InputError` with the reason.
        """
        if self.state != ACTIVE:
            raise InputError(f"refused: the node is {self.state}, not active")
        self.require_loads()

    def require_loads(self) -> None:
        """Refuse what needs loads that arrive (raises InputError)."""
        limit_s = self.stream.settings.load_age_limit_s
        if self._load_heard_s is None:
            raise InputError("refused: no load estimate has arrived")
        if (age_s := time.monotonic() - self._load_heard_s) > limit_s:
            raise InputError(
                f"refused: no load estimate has arrived for {age_s:.1f} s (limit {limit_s:g} s)"
            )

    def enable_change(self, request: SetBool.Request) -> Change:
        """Agree to a correction that is to be switched on, where this node is ready, or off."""
        if request.data:
            self.require_ready()
        return Change("ready" if request.data else "agreed", lambda: lambda: None)

    # Tare

    def _tare_change(self) -> Change:
        self.require_configured()
        self.require_loads()
        zero = self.stream.loads.measured_zero(self.stream.settings.supervisor.limit)
        frames = self.get_parameter("frames").value
        new = Tare(zero, time.time(), frames)

        def make() -> Callable[[], None]:
            before = self._tare
            self._set_tare(new)
            return partial(self._set_tare, before)

        return Change(f"new zero of the load [N, N m]: {zero.load.wrench.tolist()}", make)

    def _set_tare(self, tare: Tare | None) -> None:
        self._tare = tare
        self.stream.use_zero(None if tare is None else tare.zero)
        try:
            self._kept_tare.keep(tare)
        except WristError as error:
            self.on_fault(error)

    def _take_up_tare(self) -> None:
        longest_s = self.get_parameter("tare_age_limit_s").value
        frames = self.get_parameter("frames").value
        try:
            tare = self._kept_tare.read(time.time(), longest_s, frames)
        except WristError as error:
            self.on_fault(error)
            return
        if tare is not None:
            self._tare = tare
            self.stream.use_zero(tare.zero)
            age_s = time.time() - tare.time_s
            self.get_logger().info(
                f"tare of {age_s:.0f} s ago taken up from {self._kept_tare.path}"
            )

    # Parameters and model

    def require_configured(self) -> None:
        """Refuse what needs a model (raises InputError)."""
        if self.stream.model is None:
            reason = f" ({self._fault})" if self._fault else ""
            raise InputError(f"refused: the node is {self.state}{reason}; configure it first")

    def _check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        values = {**values_of(self, self._entries), **{p.name: p.value for p in changes}}
        try:
            stream_settings(values)
        except Exception as error:
            reason = str(error) if isinstance(error, WristError) else repr(error)
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _use_parameters(self, changes: list[Parameter]) -> None:
        self.stream.settings = stream_settings(values_of(self, self._entries))
        tare = self._tare
        if tare is not None and tare.frames != self.get_parameter("frames").value:
            self._set_tare(None)
            self.get_logger().warning("the tare was taken with other frames: dropped; tare again")

    def _loading(self) -> Loading:
        path = model_path(self.get_parameter("model_file").value)
        allowed = self.get_parameter("allow_python_laws").value
        return Loading(path, self.get_parameter("model_load_limit_s").value, allowed)

    async def _model_change(self) -> Change:
        self.require_configured()
        loading = self._loading()
        # Samples go on being answered with the old model until the new one is complete.
        await until(lambda: loading.done, loading.limit_s)
        model = loading.result()
        running = self.stream.model
        if running is not None and running.table.geometry.sha256 != model.table.geometry.sha256:
            raise InputError(
                f"model {model.name}: geometry {model.table.geometry.name} is not that of the "
                f"running model {running.name}; restart the node for another wrist"
            )

        def make() -> Callable[[], None]:
            before, self.stream.model = self.stream.model, model
            return partial(setattr, self.stream, "model", before)

        return Change(model_text(model), make)

    # Status

    def after_service(self) -> None:
        """Tell at once what a service changed."""
        self.report()

    def report(self) -> None:
        """Publish the status."""
        status = self.health.report(self._facts(), *self._judgement())
        self._status.publish(status)
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _facts(self) -> dict[str, str]:
        newest_ns = self.stream.loads.newest_ns
        age_ns = None if newest_ns is None else self.get_clock().now().nanoseconds - newest_ns
        tare = self._tare
        return {
            "state": self.state,
            "model": "none" if self.stream.model is None else model_text(self.stream.model),
            "tared": "no" if tare is None else f"{time.time() - tare.time_s:.0f} s ago",
            "tare [N, N m]": "" if tare is None else str(tare.zero.load.wrench.round(4).tolist()),
            "age of the load [s]": "" if age_ns is None else f"{age_ns / NANOSECONDS:.3f}",
            "loads that came late": str(self.stream.loads.late),
            **self.facts(),
        }

    def _judgement(self) -> tuple[str, str]:
        """Return what is missing, an error, and what restricts the work, a warning."""
        if self.state == UNCONFIGURED:
            return self._fault or "unconfigured", ""
        untared = self._tare is None and self.get_parameter("tare_needed").value
        restrictions = (
            "" if self.state == ACTIVE else self.state,
            "not tared" if untared else "",
            self.restriction(),
            *self.left_out,
            *self.stream.dropped_signals,
        )
        return "", "; ".join(filter(None, restrictions))


def model_text(model: ErrorModel) -> str:
    """Return which model it is, in one line."""
    return f"{model.name}, table {model.table.checksum[:12]}, {model.evaluation}"
