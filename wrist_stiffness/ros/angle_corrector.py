"""Node `angle_corrector`: motor commands corrected for the predicted error."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator
from functools import partial
from typing import Any

from geometry_msgs.msg import InertiaStamped, PoseWithCovarianceStamped
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.parameters import CORRECTION, PASS_THROUGH
from wrist_stiffness.compensation.payload import Payload
from wrist_stiffness.compensation.safety import require_fresh
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.recording.cdr import decode
from wrist_stiffness.recording.messages import Header
from wrist_stiffness.ros.changes import Change, all_or_none
from wrist_stiffness.ros.conversions import three
from wrist_stiffness.ros.guarded_node import ACTIVE, ALL_STATES, CONFIGURED
from wrist_stiffness.ros.qos import COMMAND_QOS
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    angles_payload,
    error_payload,
    joint_payload,
    joint_reader,
    plan_payload,
    read_plan,
)
from wrist_stiffness.ros.wrist_node import WristNode
from wrist_stiffness.topics import (
    MILLIDEGREES,
    MOTOR_COMMANDS,
    MOTOR_COMMANDS_CORRECTED,
    MOTOR_POSITIONS_CORRECTED,
    MOTOR_TRAJECTORY,
    MOTOR_TRAJECTORY_CORRECTED,
    PAYLOAD,
    POSE_ERROR_RESIDUAL,
    POSE_ERROR_RESIDUAL_TASK,
)

SLICE_S = 0.002
"""A command that comes meanwhile waits for one slice, and for one step that is under way."""

PERIOD_S = 0.001

MOST_WAITING = 8


class SlicedWork:
    """A queue of generators, each run a little at a time, in the order in which they came.

    Long work in small slices of the one thread, between which commands are answered.

    `node`: runs them by a timer; `on_fault`: takes what one of them raises.
    """

    def __init__(self, node: Node, on_fault: Callable[[Exception], None]) -> None:
        self._on_fault = on_fault
        self._waiting: deque[Generator[None, None, Any]] = deque()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._run_slice, clock=steady)
        self._timer.cancel()

    def __len__(self) -> int:
        """Return how many are not finished."""
        return len(self._waiting)

    def add(self, work: Generator[None, None, Any]) -> None:
        """Begin work once what came before is done.

        Raises `InputError` if too much waits already.
        """
        if len(self._waiting) >= MOST_WAITING:
            raise InputError(f"{len(self._waiting)} trajectories wait to be corrected; refused")
        self._waiting.append(work)
        self._timer.reset()

    def forget(self) -> None:
        """Drop what is not finished."""
        self._waiting.clear()

    def _run_slice(self) -> None:
        end = time.monotonic() + SLICE_S
        while self._waiting and time.monotonic() < end:
            work = self._waiting[0]
            try:
                next(work)
                continue
            except StopIteration:
                pass
            except Exception as error:
                self._on_fault(error)
            # Not the first one any more, if all was dropped meanwhile.
            if self._waiting and self._waiting[0] is work:
                self._waiting.popleft()
        if not self._waiting:
            self._timer.cancel()


class AngleCorrector(WristNode):
    """Forwards commands, corrected where that is safe, unchanged where it is not.

    A command that is old, not finite, beyond the joint limits or lacks a motor is not forwarded.
    """

    stream: CorrectionStream

    def __init__(self, **options: Any) -> None:
        super().__init__("angle_corrector", CORRECTION, **options)
        self._command = self.say(JointState, MOTOR_COMMANDS_CORRECTED)
        self._positions = self.say(Float64MultiArray, MOTOR_POSITIONS_CORRECTED)
        self._trajectory = self.say(JointTrajectory, MOTOR_TRAJECTORY_CORRECTED)
        self._residual = self.say(PoseWithCovarianceStamped, POSE_ERROR_RESIDUAL)
        self._task_residual = self.say(PoseWithCovarianceStamped, POSE_ERROR_RESIDUAL_TASK)
        self._plans = SlicedWork(self, self.on_fault)
        self._plan_known = "none"
        self._residual_holds = False  # that of the last command
        self._paused_s = time.monotonic()
        for action, kind in (("tare", Trigger), ("reload_model", Trigger), ("enable", SetBool)):
            self.serve(kind, f"{action}_all", partial(self._on_all, action, kind))
        self.start()

    def make_stream(self, settings: StreamSettings) -> CorrectionStream:
        """Return the correction stream; it corrects once the node is active."""
        stream = CorrectionStream(None, settings, self.get_parameter("enabled_on_start").value)
        stream.active = False
        return stream

    def make_inputs(self) -> None:
        """Listen to commands, in every state but the last: see `inactive_commands`."""
        self.hear(InertiaStamped, PAYLOAD, self._on_payload, COMMAND_QOS, CONFIGURED)
        commands = joint_reader()
        self.hear(JointState, MOTOR_COMMANDS, self._on_command, COMMAND_QOS, ALL_STATES, commands)
        self.hear(
            JointTrajectory, MOTOR_TRAJECTORY, self._on_trajectory, COMMAND_QOS, ALL_STATES, bytes
        )

    # Lifecycle

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Correct again, from what time has left of the last correction."""
        self.stream.resume(time.monotonic() - self._paused_s)
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let the correction fade out with the commands that come."""
        self._paused_s = time.monotonic()
        self.stream.active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget everything."""
        self._plans.forget()
        return super().on_cleanup(state)

    # Commands

    def _on_command(self, joints: JointSample) -> None:
        self._require_forwarding("command", joints.stamp_ns)
        stamp_ns = joints.stamp_ns
        said = joints.names, joints.positions, joints.velocities
        now_ns = self.get_clock().now().nanoseconds
        command = self.stream.on_command(stamp_ns, joints.frame_id, *said, now_ns)
        positions = tuple(command.positions.tolist())
        sent = joints._replace(frame_id=command.frame_id, positions=positions)
        self._command.publish(joint_payload(sent))
        self._positions.publish(angles_payload(command.theta))
        self._residual_holds = command.valid and command.fault is None
        if command.fault is not None:
            self.on_fault(command.fault)
            return
        if command.correction is not None:
            self.left_out = command.correction.prediction.warnings
        publishers = (self._residual, self._task_residual)
        for publisher, residual in zip(publishers, self.stream.residuals(command), strict=False):
            publisher.publish(error_payload(stamp_ns, *residual, self.base_frame))
        self.health.good()

    def _on_trajectory(self, payload: bytes) -> None:
        self._require_forwarding("trajectory", decode(Header, payload).stamp_ns, may_come=True)
        self._plans.add(self._correct_plan(payload))

    def _correct_plan(self, payload: bytes) -> Generator[None, None, None]:
        plan, points = yield from read_plan(payload)
        # A zero stamp says "at once".
        stamp_ns = plan.header.stamp_ns or self.get_clock().now().nanoseconds
        done = yield from self.stream.trajectory_work(
            stamp_ns, plan.header.frame_id, plan.joint_names, points
        )
        answer = yield from plan_payload(plan, done.frame_id, done.points)
        self._trajectory.publish(answer)
        self._plan_known = str(done.valid).lower()
        if done.fault is not None:
            self.on_fault(done.fault)
        else:
            self.health.good()

    def _require_forwarding(self, what: str, stamp_ns: int, may_come: bool = False) -> None:
        """Refuse what is old, and all where the node is told to stop.

        A command without a stamp is as old as it was sent.  A trajectory may begin later.
        """
        limit_s = self.get_parameter("command_age_limit_s").value
        if stamp_ns == 0:
            require_fresh(what, self.sent_ns, time.time_ns(), limit_s)
        else:
            now_ns = self.get_clock().now().nanoseconds
            require_fresh(what, min(stamp_ns, now_ns) if may_come else stamp_ns, now_ns, limit_s)
        if self.mode == "stopped":
            raise InputError(
                f"{what}: not forwarded: the node is {self.state}, inactive_commands is stop"
            )

    @property
    def mode(self) -> str:
        """What is done with commands: correcting, fading out, passing or stopped."""
        if self.stream.correcting:
            return "correcting"
        if self.stream.applied.any():
            return "fading out"
        passes = self.get_parameter("inactive_commands").value == PASS_THROUGH
        return "passing" if self.state == ACTIVE or passes else "stopped"

    def _on_payload(self, message: InertiaStamped) -> None:
        """Take over what a gripper tells: mass and centre of gravity; no mass, no payload."""
        inertia, frames = message.inertia, self.stream.loads.frames
        payload: Payload | None = None
        if inertia.m != 0.0:
            centre = frames.on_platform(message.header.frame_id, three(inertia.com), "payload")
            payload = Payload(inertia.m, centre)
        self.stream.supervisor.declare_payload(payload)

    # Services

    def enable_change(self, request: SetBool.Request) -> Change:
        """Switch the correction on, where the node is ready for that, or off."""
        if request.data:
            self.require_ready()

        def make() -> Callable[[], None]:
            before, self.stream.enabled = self.stream.enabled, request.data
            return partial(setattr, self.stream, "enabled", before)

        return Change(f"correction is {'on' if request.data else 'off'}", make)

    async def _on_all(self, action: str, kind: type, request: Any) -> str:
        limit_s = self.get_parameter("model_load_limit_s").value
        return await all_or_none(self, action, kind, request, limit_s)

    # Status

    def facts(self) -> dict[str, str]:
        """Return what is done with commands, and what is believed of the load."""
        supervision = self.stream.supervision
        payload = supervision.payload
        limit = self.stream.supervisor.limit(self.stream.settings.supervisor)
        first, second = (MILLIDEGREES * self.stream.applied).tolist()
        return {
            "mode": self.mode,
            "enabled": str(self.stream.enabled).lower(),
            "applied correction [mdeg]": f"{first:.3f}, {second:.3f}",
            "load": supervision.state.value,
            "payload [kg]": "none" if payload is None else f"{payload.mass_kg:.4f}",
            "payload told by the gripper": str(supervision.told).lower(),
            "another load departs by [N, N m]": f"{limit.force:.3g}, {limit.moment:.3g}",
            "residual holds": str(self._residual_holds and supervision.valid).lower(),
            "trajectories under way": str(len(self._plans)),
            "load known all along the last trajectory": self._plan_known,
        }

    def restriction(self) -> str:
        """Return what keeps the node from correcting in full."""
        if self.state != ACTIVE:
            return f"commands: {self.mode}"
        supervision = self.stream.supervision
        if self.stream.enabled and supervision.text:
            return f"{supervision.state.value}: {supervision.text}"
        return ""
