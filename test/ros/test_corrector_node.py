from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from wrist_stiffness.compensation.correction import correct
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.trajectory_plan import STEP as DIFFERENCE_RAD
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import save_model
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import nanoseconds, time_message

SECOND = 1_000_000_000
STEP = SECOND // 10
THETA = (0.1, -0.2)
DOWN = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
NAME = "angle_corrector"
NAMES = ("motor_1_joint", "motor_2_joint")
OUTPUTS = {
    "/motor_commands_corrected": JointState,
    "/motor_positions_corrected": Float64MultiArray,
    "/motor_trajectory_corrected": JointTrajectory,
    "/pose_error_residual": PoseWithCovarianceStamped,
}


AT_ONCE = {"slew_deg_s": 1000.0, "deadband_steps": 0.0} | {"load_policy": "follow"}
ROUNDING = 1e-15  # rad


def add_corrector(graph, model_path, **parameters):
    node = graph.add(AngleCorrector, model_file=str(model_path), **AT_ONCE | parameters)
    for topic, message_type in OUTPUTS.items():
        graph.listen(message_type, topic)
        graph.connected(topic)
    return node


@pytest.fixture
def corrector(graph, model_path):
    return add_corrector(graph, model_path, enabled_on_start=True)


def commands(graph):
    return graph.heard["/motor_commands_corrected"]


def wait_for_commands(graph, count):
    for topic in ("/motor_commands_corrected", "/motor_positions_corrected"):
        graph.until(lambda topic=topic: len(graph.heard[topic]) >= count, f"{topic} {count}")


def send_settled(graph, stamp_ns, theta=THETA, names=NAMES, frame_id=""):
    """Send a command twice, so that the correction has had time to slew, and return the second."""
    count = len(commands(graph))
    graph.joints("/motor_commands", stamp_ns, theta, names, frame_id)
    graph.joints("/motor_commands", stamp_ns + STEP, theta, names, frame_id)
    wait_for_commands(graph, count + 2)
    return commands(graph)[-1]


def send_load(graph, node, stamp_ns, wrench=DOWN):
    graph.load(stamp_ns, wrench)
    graph.until(lambda: node.stream.loads.newest_ns == stamp_ns, "load")


def expected(model, theta=THETA, name="pointing"):
    platform = model.table.geometry.platform
    objective = Objective(name, platform.normal, platform.tool_point)
    load = Load(np.array(DOWN))
    return correct(
        lambda angles: model.predict(angles, load),
        model.table.workspace,
        np.array(theta),
        objective,
    )


def test_an_enabled_corrector_corrects_as_the_core_does(graph, corrector, model):
    send_load(graph, corrector, SECOND)
    names = (NAMES[1], "gripper", NAMES[0])
    command = send_settled(graph, SECOND, (THETA[1], 9.0, THETA[0]), names)
    correction = expected(model)
    corrected = np.array(THETA) + correction.delta
    assert np.max(np.abs(correction.delta)) > 1e-6
    wanted = [corrected[1], 9.0, corrected[0]]
    assert command.position.tolist() == pytest.approx(wanted, rel=0, abs=ROUNDING)
    assert list(command.name) == list(names)
    assert nanoseconds(command.header.stamp) == SECOND + STEP
    assert command.header.frame_id == "wrist_corrected"
    positions = graph.heard["/motor_positions_corrected"][-1].data.tolist()
    assert positions == [command.position[2], command.position[0]]
    graph.until(lambda: len(graph.heard["/pose_error_residual"]) == 2, "residual")
    before = model.predict(np.array(THETA), Load(np.array(DOWN))).twist
    for message, twist in zip(
        graph.heard["/pose_error_residual"], (before, correction.after), strict=True
    ):
        pose = message.pose.pose
        position, quaternion = pose_of_twist(twist)
        # Before, nothing was applied yet: the residual is linear between the two, to 1e-3.
        scale = 1e-3 * np.abs(before)
        found = [pose.position.x, pose.position.y, pose.position.z]
        assert np.allclose(found, position, rtol=0, atol=scale[:3].max())
        found = [pose.orientation.x, pose.orientation.y, pose.orientation.z]
        assert np.allclose(found, quaternion[:3], rtol=0, atol=scale[3:].max())


def test_it_starts_disabled_and_passes_commands_unchanged(graph, model_path, model):
    node = add_corrector(graph, model_path)
    send_load(graph, node, SECOND)
    command = send_settled(graph, SECOND, frame_id="plan")
    assert command.position.tolist() == list(THETA)
    assert command.header.frame_id == "plan"
    answer = graph.call(SetBool, f"/{NAME}/enable", SetBool.Request(data=True))
    assert answer.success
    assert "on" in answer.message
    command = send_settled(graph, SECOND + 2 * STEP)
    wanted = (THETA + expected(model).delta).tolist()
    assert command.position.tolist() == pytest.approx(wanted, rel=0, abs=ROUNDING)
    graph.call(SetBool, f"/{NAME}/enable", SetBool.Request(data=False))
    assert send_settled(graph, SECOND + 4 * STEP).position.tolist() == list(THETA)


UNSAFE = {
    "no load yet": (None, THETA, "", "StaleLoadError"),
    "stale load": (SECOND - 2 * SECOND // 3, THETA, "", "StaleLoadError"),
    "corrected already": (SECOND, THETA, "wrist_corrected", "InputError"),
    "out of the domain": (SECOND, (1.35, 0.0), "", "UnreachablePoseError"),
}


@pytest.mark.parametrize(("load", "theta", "frame", "reason"), UNSAFE.values(), ids=UNSAFE)
def test_where_a_correction_is_not_safe_the_command_passes_unchanged(
    graph, corrector, load, theta, frame, reason
):
    if load is not None:
        send_load(graph, corrector, load)
    graph.joints("/motor_commands", SECOND, theta, frame_id=frame)
    wait_for_commands(graph, 1)
    assert commands(graph)[0].position.tolist() == list(theta)
    assert graph.heard["/motor_positions_corrected"][0].data.tolist() == list(theta)
    _, values = graph.status(NAME, lambda status, values: f"refused {reason}" in values)
    assert values[f"refused {reason}"] == "1"
    assert graph.heard["/pose_error_residual"] == []


BAD = {
    "nan": ((float("nan"), 0.0), NAMES),
    "infinite": ((0.0, float("-inf")), NAMES),
    "another joint is nan": ((0.0, 0.0, float("nan")), (*NAMES, "gripper")),
    "missing": ((0.1,), NAMES[:1]),
    "duplicated": ((0.1, 0.2, 0.3), (*NAMES, NAMES[1])),
}


@pytest.mark.parametrize(("theta", "names"), BAD.values(), ids=BAD)
@pytest.mark.parametrize("enabled", [True, False])
def test_a_command_that_is_no_command_is_not_forwarded(graph, model_path, theta, names, enabled):
    node = add_corrector(graph, model_path, enabled_on_start=enabled)
    send_load(graph, node, SECOND)
    graph.joints("/motor_commands", SECOND + 1, theta, names)
    graph.joints("/motor_commands", SECOND + 2)
    wait_for_commands(graph, 1)
    assert nanoseconds(commands(graph)[0].header.stamp) == SECOND + 2
    assert node.health.faults == 1


def trajectory(stamp_ns, points):
    message = JointTrajectory(joint_names=list(reversed(NAMES)))
    message.header.stamp = time_message(stamp_ns)
    for i, (first, second) in enumerate(points):
        message.points.append(
            JointTrajectoryPoint(
                positions=[second, first],
                velocities=[0.1, 0.2],
                time_from_start=Duration(sec=i),
            )
        )
    return message


def test_a_whole_trajectory_is_corrected_point_by_point(graph, corrector, model):
    send_load(graph, corrector, SECOND)
    points = [(0.0, 0.0), (0.2, 0.1), (0.4, -0.3)]
    graph.publish("/motor_trajectory", trajectory(SECOND, points))
    graph.until(lambda: graph.heard["/motor_trajectory_corrected"], "trajectory")
    message = graph.heard["/motor_trajectory_corrected"][0]
    assert message.header.frame_id == "wrist_corrected"
    for i, (point, theta) in enumerate(zip(message.points, points, strict=True)):
        corrected = theta + expected(model, theta).delta
        assert np.allclose(point.positions, corrected[::-1], rtol=0, atol=1e-15)
        # Motor 2 stands first: at 0.1 rad/s, motor 1 at 0.2.
        speed = np.array([0.2, 0.1])
        seconds = DIFFERENCE_RAD / np.linalg.norm(speed)
        ahead, behind = (expected(model, theta + sign * seconds * speed).delta for sign in (1, -1))
        wanted = speed + (ahead - behind) / (2.0 * seconds)
        assert np.allclose(point.velocities, wanted[::-1], rtol=0, atol=1e-9)
        assert len(point.accelerations) == 0
        assert point.time_from_start.sec == i
    known = "load known all along the last trajectory"
    graph.status("angle_corrector", lambda status, values: values[known] == "true")


def test_a_trajectory_is_corrected_whole_or_not_at_all(graph, corrector):
    send_load(graph, corrector, SECOND)
    graph.publish("/motor_trajectory", trajectory(SECOND, [(0.0, 0.0), (1.35, 0.0)]))
    graph.publish("/motor_trajectory", trajectory(SECOND, [(0.0, float("nan"))]))
    graph.publish("/motor_trajectory", trajectory(SECOND, [(0.3, 0.0)]))
    graph.until(lambda: len(graph.heard["/motor_trajectory_corrected"]) == 2, "trajectories")
    first, second = graph.heard["/motor_trajectory_corrected"]
    assert [point.positions.tolist() for point in first.points] == [[0.0, 0.0], [0.0, 1.35]]
    assert len(second.points) == 1
    assert second.points[0].positions[1] != 0.3


def test_of_two_correctors_in_a_chain_only_one_corrects(graph, corrector, model, model_path):
    rules = ["--ros-args", "-r", "__node:=second"]
    for topic in OUTPUTS:
        rules += ["-r", f"{topic}:=/second{topic}"]
    rules += ["-r", "/motor_commands:=/motor_commands_corrected"]
    second = AngleCorrector(
        context=graph.context,
        cli_args=rules,
        parameter_overrides=[
            Parameter("model_file", value=str(model_path)),
            Parameter("enabled_on_start", value=True),
            Parameter("command_age_limit_s", value=0.0),
        ],
    )
    graph.executor.add_node(second)
    graph.listen(JointState, "/second/motor_commands_corrected")
    graph.connected("/second/motor_commands_corrected")
    graph.until(lambda: graph.probe.count_subscribers("/motor_commands_corrected") == 2, "chain")
    send_load(graph, corrector, SECOND)
    graph.until(lambda: second.stream.loads.newest_ns == SECOND, "load")
    send_settled(graph, SECOND)
    graph.until(lambda: len(graph.heard["/second/motor_commands_corrected"]) == 2, "commands")
    message = graph.heard["/second/motor_commands_corrected"][1]
    assert message.position.tolist() == commands(graph)[1].position.tolist()
    assert message.position.tolist() != list(THETA)
    _, values = graph.status("second", lambda status, values: "refused InputError" in values)
    assert "not corrected twice" in values["last fault"]


def test_parameters_are_checked_when_they_change(graph, corrector, model):
    for name, value in (
        ("objective", "beauty"),
        ("correction_limit_deg", -1.0),
        ("frames", "{ft: {parent: moon}}"),
        ("motor_1_joint", "motor_2_joint"),
        ("motor_1_joint", ""),
        ("enabled_on_start", False),
        ("load_age_limit_s", "long"),
    ):
        (result,) = corrector.set_parameters([Parameter(name, value=value)])
        assert not result.successful, name
        assert result.reason
    (result,) = corrector.set_parameters([Parameter("objective", value="orientation")])
    assert result.successful
    send_load(graph, corrector, SECOND)
    wanted = (THETA + expected(model, name="orientation").delta).tolist()
    found = send_settled(graph, SECOND).position.tolist()
    assert found == pytest.approx(wanted, rel=0, abs=ROUNDING)


def test_a_correction_beyond_the_limit_is_not_applied(graph, model_path):
    node = add_corrector(graph, model_path, enabled_on_start=True, correction_limit_deg=1e-6)
    send_load(graph, node, SECOND)
    assert send_settled(graph, SECOND).position.tolist() == list(THETA)
    _, values = graph.status(NAME, lambda status, values: values["last fault"])
    assert "larger than the limit" in values["last fault"]
    assert (values["load"], values["residual holds"]) == ("followed", "false")
    assert not graph.heard["/pose_error_residual"]
    node.set_parameters([Parameter("correction_limit_deg", value=5.0)])
    send_settled(graph, SECOND + 2 * STEP)
    graph.status(NAME, lambda status, values: values["residual holds"] == "true")


def test_a_damaged_model_leaves_the_running_one_in_use(graph, corrector, model, tmp_path):
    path = tmp_path / "damaged.yaml"
    path.write_text("schema: 7")
    assert corrector.set_parameters([Parameter("model_file", value=str(path))])[0].successful
    answer = graph.call(Trigger, f"/{NAME}/reload_model", Trigger.Request())
    assert not answer.success
    assert "damaged.yaml" in answer.message
    send_load(graph, corrector, SECOND)
    wanted = (THETA + expected(model).delta).tolist()
    found = send_settled(graph, SECOND).position.tolist()
    assert found == pytest.approx(wanted, rel=0, abs=ROUNDING)


def test_the_residual_is_also_given_at_the_task_point(graph, model, tmp_path):
    tool = np.array([0.0, 0.01, 0.05])
    geometry = dict(model.table.header.geometry)
    geometry["platform"] = {**geometry["platform"], "tool_point_mm": (1e3 * tool).tolist()}
    table = replace(model.table, header=replace(model.table.header, geometry=geometry))
    save_table(table, tmp_path / "table.npz")
    path = tmp_path / "model.yaml"
    path.write_text("{schema: 1, name: tool, table: {path: table.npz}, effects: []}")
    node = add_corrector(graph, path, enabled_on_start=True)
    topic = "/pose_error_residual/task_point"
    graph.listen(PoseWithCovarianceStamped, topic)
    graph.connected(topic)
    send_load(graph, node, SECOND)
    send_settled(graph, SECOND)
    graph.until(lambda: len(graph.heard[topic]) == 2, "residuals")
    twist = expected(model).after
    arm = model.table.mechanism.forward(np.array(THETA)).platform @ tool
    place = graph.heard[topic][1].pose.pose.position
    # One micrometre of O and the rotation that is left, times 51 mm.
    assert [place.x, place.y, place.z] == pytest.approx(
        (twist[:3] + np.cross(twist[3:], arm)).tolist(), rel=0, abs=1e-9
    )


def test_an_effect_that_is_left_out_is_reported(graph, model, tmp_path):
    path = tmp_path / "warm.yaml"
    save_model(model.with_effects(Effect(find_law("thermal_expansion"), "link_1", {})), path)
    node = add_corrector(graph, path, enabled_on_start=True)
    send_load(graph, node, SECOND)
    send_settled(graph, SECOND)
    status, _ = graph.status(NAME, lambda status, values: "temperature" in status.message)
    assert status.level == status.WARN
