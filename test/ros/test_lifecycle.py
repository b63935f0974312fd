"""States, commands that perish, a tare that outlives its node, changes of all nodes at once."""

import json
import time

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import InertiaStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wrist_stiffness.errors import RecordingError
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import save_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.ros import changes
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import joint_message, time_message
from wrist_stiffness.ros.model_monitor import ModelMonitor
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor
from wrist_stiffness.ros.qos import STATE_QOS
from wrist_stiffness.ros.stream_messages import plan_payload, read_plan

SECOND = 1_000_000_000
STEP = SECOND // 50
NAME, NAMES = "angle_corrector", ("motor_1_joint", "motor_2_joint")
THETA = (0.1, -0.2)
COMMANDS, SENT = "/motor_commands", "/motor_commands_corrected"
CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEANUP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP


class Corrector:
    """A corrector that is driven one command after the other."""

    def __init__(self, graph, **parameters):
        self.graph, self.stamp_ns = graph, 10 * SECOND
        self.node = graph.add(AngleCorrector, load_policy="follow", **parameters)
        graph.listen(JointState, SENT)
        graph.connected(SENT)

    def enable(self, on=True):
        return self.graph.call(SetBool, f"/{NAME}/enable", SetBool.Request(data=on))

    def change(self, *transitions):
        for each in transitions:
            request = ChangeState.Request(transition=Transition(id=each))
            if not self.graph.call(ChangeState, f"/{NAME}/change_state", request).success:
                return False
        return True

    def load(self, newtons=-3.0):
        self.graph.load(self.stamp_ns, (0, 0, newtons, 0, 0, 0))
        history = self.node.stream.loads
        self.graph.until(lambda: history.newest_ns == self.stamp_ns, "load")

    def send(self, newtons=-3.0):
        """Return what is added to a command, None where it is refused."""
        self.stamp_ns += STEP
        if newtons is not None:
            self.load(newtons)
        heard, faults = self.graph.heard[SENT], self.node.health.faults
        count = len(heard)
        self.graph.joints(COMMANDS, self.stamp_ns, THETA)
        self.graph.until(
            lambda: len(heard) > count or self.node.health.faults > faults, "answer to a command"
        )
        return None if len(heard) == count else np.array(heard[-1].position) - THETA


@pytest.fixture
def corrector(graph):
    return Corrector(graph)


def test_a_correction_is_refused_with_the_reason_until_the_node_is_ready(graph):
    corrector = Corrector(graph, autostart=False)
    for transitions, reason in [
        ((), "the node is unconfigured, not active"),
        ((CONFIGURE,), "the node is inactive, not active"),
        ((ACTIVATE,), "no load estimate has arrived"),
    ]:
        assert corrector.change(*transitions)
        answer = corrector.enable()
        assert (answer.success, answer.message) == (False, f"refused: {reason}")
        assert not corrector.node.stream.enabled
    corrector.load()
    assert corrector.enable().message == "correction is on"
    assert corrector.change(DEACTIVATE, Transition.TRANSITION_INACTIVE_SHUTDOWN)
    assert "the node is finalized" in corrector.enable().message


def test_a_correction_fades_out_and_in_with_the_states(graph, corrector):
    corrector.load()
    assert corrector.enable().success
    slew = corrector.node.stream.settings.safety.slew * STEP / SECOND
    added = [corrector.send() for _ in range(12)]
    full = added[-1]
    assert np.abs(full).max() > 2.0 * slew
    assert corrector.change(DEACTIVATE)
    fading = [full, *(corrector.send() for _ in range(12))]
    assert fading[-1].tolist() == [0.0, 0.0]
    assert graph.heard[SENT][-1].header.frame_id == ""
    assert corrector.change(ACTIVATE)
    coming = [corrector.send() for _ in range(12)]
    assert coming[-1] == pytest.approx(full, abs=1e-6)
    for steps in (added, fading, coming):
        assert np.abs(np.diff(steps, axis=0)).max() <= slew * (1.0 + 1e-9)
    assert np.abs(coming[0]).max() <= slew * (1.0 + 1e-9)


@pytest.mark.parametrize("enabled", [True, False])
def test_a_correction_fades_out_with_commands_without_a_stamp(graph, corrector, enabled):
    corrector.load()
    assert corrector.enable().success
    for _ in range(12):
        corrector.send()
    assert corrector.enable(enabled).success
    assert corrector.node.stream.applied.any()

    def passed():
        graph.joints(COMMANDS, 0, THETA)
        return graph.heard[SENT][-1].position.tolist() == list(THETA)

    graph.until(passed, "command without a correction")


def test_inactive_it_stops_where_it_is_told_to_once_the_correction_has_faded(graph):
    corrector = Corrector(graph, inactive_commands="stop")
    corrector.load()
    assert corrector.enable().success
    for _ in range(12):
        corrector.send()
    assert corrector.change(DEACTIVATE)
    after = [corrector.send() for _ in range(14)]
    assert after[0] is not None
    assert after[-1] is None
    status, _ = graph.status(NAME, lambda status, values: values["mode"] == "stopped")
    assert status.level == status.WARN
    assert "inactive_commands is stop" in status.message


def test_clean_up_forgets(graph, tmp_path):
    corrector = Corrector(graph, state_folder=str(tmp_path))
    corrector.load()
    assert graph.call(Trigger, f"/{NAME}/tare", Trigger.Request()).success
    assert corrector.enable().success
    assert list(tmp_path.iterdir())
    assert corrector.change(DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE)
    assert corrector.node.stream.loads.zero is None
    assert not corrector.node.stream.enabled
    assert corrector.send(None).tolist() == [0.0, 0.0]
    assert not list(tmp_path.iterdir())


def test_an_old_command_is_dropped_counted_and_told(graph):
    corrector = Corrector(graph, command_age_limit_s=0.5)
    now_ns = time.time_ns()
    for stamp_ns in (now_ns - SECOND, now_ns + SECOND, now_ns - 10 * SECOND):
        graph.joints(COMMANDS, stamp_ns)
    graph.joints(COMMANDS, time.time_ns())
    graph.joints(COMMANDS, 0)
    graph.until(lambda: len(graph.heard[SENT]) == 2, "the fresh one, and the one without a stamp")
    _, values = graph.status(NAME, lambda status, values: "refused StaleCommandError" in values)
    assert values["refused StaleCommandError"] == "3"
    plan = JointTrajectory(joint_names=NAMES, points=[JointTrajectoryPoint(positions=THETA)])
    graph.listen(JointTrajectory, "/motor_trajectory_corrected")
    graph.connected("/motor_trajectory_corrected")
    for seconds in (-3, 3600):
        plan.header.stamp = time_message(time.time_ns() + seconds * SECOND)
        graph.publish("/motor_trajectory", plan)
    graph.until(lambda: graph.heard["/motor_trajectory_corrected"], "the plan that begins later")
    assert corrector.node.health.faults == 4


def test_commands_are_answered_while_a_long_plan_is_corrected(graph, corrector):
    corrector.load()
    assert corrector.enable().success
    points = [
        JointTrajectoryPoint(positions=(1e-4 * i, 0.1), velocities=(0.1, 0.1)) for i in range(3000)
    ]
    plan = JointTrajectory(joint_names=NAMES, points=points)
    plan.header.stamp = time_message(corrector.stamp_ns)
    graph.listen(JointTrajectory, "/motor_trajectory_corrected")
    graph.connected("/motor_trajectory_corrected")
    graph.publish("/motor_trajectory", plan)
    graph.until(lambda: len(corrector.node._plans), "plan")
    for _ in range(5):
        assert corrector.send() is not None
    assert not graph.heard["/motor_trajectory_corrected"]
    graph.until(lambda: graph.heard["/motor_trajectory_corrected"], "corrected plan")
    corrected = graph.heard["/motor_trajectory_corrected"][0].points
    assert len(corrected) == len(points)
    assert corrected[-1].positions.tolist() != points[-1].positions.tolist()


def test_a_tare_outlives_its_node_for_a_while(graph, tmp_path):
    ages = {"tare_age_limit_s": 60.0, "load_age_limit_s": 60.0}
    needed = {"state_folder": str(tmp_path), "tare_needed": True, **ages}
    node = graph.add(PoseErrorPredictor, **needed)
    status, values = graph.status("pose_error_predictor", lambda status, values: True)
    assert (status.level, status.message, values["tared"]) == (status.WARN, "not tared", "no")
    graph.load(SECOND, (0, 0, -2.0, 0, 0, 0))
    graph.until(lambda: node.stream.loads.newest_ns, "load")
    assert graph.call(Trigger, "/pose_error_predictor/tare", Trigger.Request()).success
    zero = node.stream.loads.zero.load.wrench
    (kept,) = tmp_path.iterdir()
    node.destroy_node()
    graph.executor.remove_node(node)
    again = graph.add(PoseErrorPredictor, **needed)
    assert again.stream.loads.zero.load.wrench.tolist() == zero.tolist() == [0, 0, -2.0, 0, 0, 0]
    content = json.loads(kept.read_text())
    for other in ({"time_s": time.time() - 61.0}, {"time_s": time.time() + 9.0}, {"frames": "x"}):
        kept.write_text(json.dumps(content | other))
        later = AngleCorrector(  # The name of the node is that of the file.
            context=graph.context,
            cli_args=["--ros-args", "-r", "__node:=pose_error_predictor"],
            parameter_overrides=[Parameter(k, value=v) for k, v in needed.items()],
        )
        assert later.stream.loads.zero is None
        later.destroy_node()
    kept.write_text("{}")
    assert graph.add(PoseErrorPredictor, **needed).health.faults == 1


def test_a_tare_ends_with_the_frames_that_it_was_taken_in(graph, tmp_path):
    frames = "{{ft: {{parent: wrist_platform, acts_on: {}}}}}"
    needed = {"state_folder": str(tmp_path), "load_age_limit_s": 60.0}
    node = graph.add(PoseErrorPredictor, frames=frames.format("platform"), **needed)
    graph.load(SECOND, (0, 0, -2.0, 0, 0, 0), "ft")
    graph.until(lambda: node.stream.loads.newest_ns, "load")
    assert graph.call(Trigger, "/pose_error_predictor/tare", Trigger.Request()).success
    node.set_parameters([Parameter("load_age_limit_s", value=50.0)])
    assert node.stream.loads.zero is not None
    node.set_parameters([Parameter("frames", value=frames.format("environment"))])
    assert node.stream.loads.zero is None
    assert not list(tmp_path.iterdir())


def test_all_nodes_change_or_none(graph, model, tmp_path):
    """A model that one of them cannot load changes none; what all agree to changes all."""
    path = tmp_path / "model.yaml"
    save_model(model, path)
    nodes = [
        graph.add(make, model_file=str(path), load_policy="follow", load_age_limit_s=60.0)
        for make in (AngleCorrector, PoseErrorPredictor, ModelMonitor)
    ]
    before = [node.stream.model for node in nodes]

    def ask(action, kind=Trigger, **request):
        return graph.call(kind, f"/{action}_all", kind.Request(**request))

    refused = ask("enable", SetBool, data=True)
    assert not refused.success
    assert "nothing has changed" in refused.message
    assert "model_monitor: refused: no load estimate has arrived" in refused.message
    graph.load(SECOND, (0, 0, -2.0, 0, 0, 0))
    graph.until(lambda: all(node.stream.loads.newest_ns for node in nodes), "loads")
    assert ask("enable", SetBool, data=True).success
    assert nodes[0].stream.enabled
    assert ask("tare").success
    assert all(node.stream.loads.zero.load.wrench[2] == -2.0 for node in nodes)
    nodes[1].set_parameters([Parameter("model_file", value=str(tmp_path / "none.yaml"))])
    save_model(
        model.with_effects(
            Effect(find_law("load_scale"), "load_sensor", {"scale_percent": Estimate(1.0)})
        ),
        path,
    )
    refused = ask("reload_model")
    assert not refused.success
    assert "pose_error_predictor: " in refused.message
    assert "none.yaml" in refused.message
    assert [node.stream.model for node in nodes] == before
    assert all(node.stream.loads.zero.load.wrench[2] == -2.0 for node in nodes)
    nodes[1].set_parameters([Parameter("model_file", value=str(path))])
    assert ask("reload_model").success
    assert all(len(node.stream.model.effects) == 1 for node in nodes)
    new = [node.stream.model for node in nodes]
    graph.load(SECOND + 1, frame_id="wrist_platform")
    graph.until(lambda: all(node.stream.loads.newest_ns > SECOND for node in nodes), "loads")
    assert "loads in wrist_base and in wrist_platform are mixed" in ask("tare").message
    assert [node.stream.model for node in nodes] == new


@pytest.mark.filterwarnings("ignore:failed to send response")
def test_a_node_that_answers_too_late_keeps_the_change_before(graph, monkeypatch):
    nodes = [
        graph.add(make, load_age_limit_s=60.0, model_load_limit_s=0.1)
        for make in (AngleCorrector, PoseErrorPredictor)
    ]
    graph.load(SECOND)
    graph.until(lambda: all(node.stream.loads.newest_ns for node in nodes), "loads")
    assert graph.call(Trigger, "/tare_all", Trigger.Request()).success
    monkeypatch.setattr(changes, "LONGEST_ANSWER_S", 0.3)
    graph.executor.remove_node(nodes[1])
    refused = graph.call(SetBool, "/enable_all", SetBool.Request(data=False))
    assert "pose_error_predictor: no answer within 0.4 s" in refused.message
    graph.executor.add_node(nodes[1])
    graph.until(lambda: nodes[1]._prepared is not None, "the late answer")
    assert all(node.stream.loads.zero is not None for node in nodes)


def test_two_wrists_live_side_by_side(graph, model_path):
    """Each with topics, services and a status of its own; the diagnostics tell them apart."""
    for side in ("left", "right"):
        node = AngleCorrector(
            context=graph.context,
            cli_args=["--ros-args", "-r", f"__ns:=/{side}"],
            parameter_overrides=[
                Parameter("state_folder", value=""),
                Parameter("command_age_limit_s", value=0.0),
            ],
        )
        graph.executor.add_node(node)
        graph.listen(JointState, f"/{side}{SENT}")
        graph.connected(f"/{side}{SENT}")
    heard = []
    graph.probe.create_subscription(DiagnosticStatus, "/left/wrist_status", heard.append, STATE_QOS)
    graph.publish(f"/left{COMMANDS}", joint_message(SECOND, "", NAMES, np.array(THETA)))
    graph.until(lambda: graph.heard[f"/left{SENT}"], "command of the left wrist")
    graph.until(lambda: heard, "status")
    assert heard[0].name == "left/angle_corrector"
    for side in ("left", "right"):
        graph.status(f"{side}/angle_corrector", lambda status, values: values["state"] == "active")
    assert not graph.heard[f"/right{SENT}"]


def test_a_gripper_tells_what_it_holds(graph):
    corrector = Corrector(graph)
    message = InertiaStamped()
    message.header.frame_id = "wrist_platform"
    message.inertia.m, message.inertia.com.z = 0.2, 0.04
    graph.publish("/payload", message)
    expected = corrector.node.stream.supervisor
    graph.until(lambda: expected._expected is not None, "payload")
    assert (expected._expected.mass_kg, expected._expected.centre_m) == (0.2, (0.0, 0.0, 0.04))
    message.header.frame_id = "nowhere"
    graph.publish("/payload", message)
    graph.until(lambda: corrector.node.health.faults, "fault")
    message.inertia.m = 0.0
    graph.publish("/payload", message)
    graph.until(lambda: expected._expected is None, "no payload")


def finished(work):
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


@pytest.mark.parametrize("names", [NAMES, ("a", "bcd", "motor_1_joint")])
def test_trajectories_are_read_and_written_as_by_rclpy(names):
    rng = np.random.default_rng(1)
    message = JointTrajectory(joint_names=names)
    message.header.frame_id = "x" * len(names)
    message.header.stamp = time_message(3 * SECOND + 7)
    for i in range(5):
        point = JointTrajectoryPoint(time_from_start=Duration(sec=i, nanosec=3))
        point.positions = rng.normal(size=len(names)).tolist()
        point.velocities = rng.normal(size=len(names) * (i % 2)).tolist()
        point.accelerations = rng.normal(size=len(names) * (i > 2)).tolist()
        point.effort = rng.normal(size=i).tolist()
        message.points.append(point)
    payload = serialize_message(message)
    plan, points = finished(read_plan(payload))
    assert plan.header.stamp_ns == 3 * SECOND + 7
    written = finished(plan_payload(plan, "y", points))
    message.header.frame_id = "y"
    message = deserialize_message(serialize_message(message), JointTrajectory)
    assert deserialize_message(written, JointTrajectory) == message
    for end in range(0, len(written) - 4, 7):
        with pytest.raises(RecordingError, match="cannot be decoded|is not plain"):
            finished(read_plan(written[:end]))
