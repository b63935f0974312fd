"""Replay: the nodes' own path over recordings, among them one that this project did not write."""

import dataclasses

import numpy as np
import pytest
from replayed import MILLISECOND, MOTORS, joints, load, outputs, shifts, write
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.parameter_file import node_settings
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointTrajectory,
    JointTrajectoryPoint,
    Quaternion,
    String,
    Temperature,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
)
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")
STORE = get_typestore(Stores.ROS2_JAZZY)


COMMAND = dataclasses.replace(
    joints(30 * MILLISECOND, (6.0, 10.0)), velocity=(0.1, 0.2), effort=(0.3, 0.4)
)

# t [ms]      0     10    20    30
# load       -1 N        -2 N (logged at 31: late, but by its stamp it belongs to the state at 20)
# joints           10    20    30
TIMELINE = [
    (0, "/load_estimate", load(0, (0.0, 0.0, -1.0))),
    (10, "/joint_states", joints(10 * MILLISECOND, (5.0, 10.0))),
    (20, "/joint_states", joints(20 * MILLISECOND, (5.0, 10.0))),
    (30, "/joint_states", joints(30 * MILLISECOND, (6.0, 10.0))),
    (30, "/motor_commands", COMMAND),
    (31, "/load_estimate", load(20 * MILLISECOND, (0.0, 0.0, -2.0))),
]


def test_load_belongs_by_stamp_not_by_arrival(tmp_path):
    summary = replay(write(tmp_path / "in", TIMELINE), MODEL, tmp_path / "out")
    assert (summary.joint_states, summary.predictions, summary.corrections) == (3, 3, 1)
    model = load_model(MODEL)
    wanted = [
        model.predict(np.radians((m1, 10.0)), Load(np.array([0.0, 0.0, f, 0.0, 0.0, 0.0]))).motion[
            1
        ]
        for m1, f in ((5.0, -1.0), (5.0, -2.0), (6.0, -2.0))
    ]
    assert np.array_equal(shifts(tmp_path / "out"), np.array(wanted))


def test_output_holds_the_input_and_is_the_same_every_time(tmp_path):
    source = write(tmp_path / "in.mcap", TIMELINE)
    replay(source, MODEL, tmp_path / "a.mcap")
    replay(source, MODEL, tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    for topic in ("/joint_states", "/load_estimate", "/motor_commands"):
        assert outputs(tmp_path / "a.mcap", topic) == outputs(source, topic)
    corrected = outputs(tmp_path / "a.mcap", "/motor_commands_corrected")
    assert [message.header.frame_id for message in corrected] == ["wrist_corrected"]
    assert [(m.velocity, m.effort) for m in corrected] == [((0.1, 0.2), (0.3, 0.4))]


def test_the_residual_is_what_the_sent_angles_leave(tmp_path):
    """A second command, for the first one's correction starts at zero and changes nothing yet."""
    later = dataclasses.replace(COMMAND, header=Header(90 * MILLISECOND))
    timeline = [*TIMELINE, (90, "/load_estimate", load(89 * MILLISECOND, (0.0, 0.0, -2.0)))]
    follow = StreamSettings(supervisor=SupervisorSettings(follow=True))
    source = write(tmp_path / "in", [*timeline, (90, "/motor_commands", later)])
    replay(source, MODEL, tmp_path / "out", (StreamSettings(), follow))
    model = load_model(MODEL)
    sent = outputs(tmp_path / "out", "/motor_commands_corrected")[-1].position
    said = outputs(tmp_path / "out", "/pose_error_residual")[-1].pose.pose.orientation
    error = model.predict(np.array(sent), Load(np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0])))
    desired = model.table.mechanism.forward(np.radians((6.0, 10.0))).platform
    left = Rotation.from_matrix(
        error.motion[0] @ error.configuration.platform @ desired.T
    ).as_rotvec()
    rotvec = Rotation.from_quat((said.x, said.y, said.z, said.w)).as_rotvec()
    assert np.linalg.norm(np.array(sent) - later.position) > 1e-5
    # The residual is moved by the rigid Jacobian: off by the square of the correction, 1e-8 rad.
    assert np.allclose(rotvec, left, rtol=0.0, atol=3e-8)


def test_trajectories_are_corrected_as_by_the_node(tmp_path, capsys):
    """A zero stamp says "at once": when it was logged.  The second plan is out of the domain."""
    points = tuple(JointTrajectoryPoint((0.1 * i, 0.2), (0.3, 0.1), (), (), i) for i in range(3))
    plan = JointTrajectory(Header(0), MOTORS, points)
    wild = JointTrajectory(Header(0), MOTORS, (JointTrajectoryPoint((1.35, 0.2)),))
    timeline = [*TIMELINE, (31, "/motor_trajectory", plan), (31, "/motor_trajectory", wild)]
    source = write(tmp_path / "in", timeline)
    assert main(["replay", str(source), "-o", str(tmp_path / "out")]) == 0
    assert "1 of 2 trajectories corrected" in capsys.readouterr().out
    first, second = outputs(tmp_path / "out", "/motor_trajectory_corrected")
    stream = CorrectionStream(load_model(MODEL), node_settings(None)[1], enabled=True)
    for stamp, force in ((0, -1.0), (20 * MILLISECOND, -2.0)):
        stream.loads.add(stamp, "wrist_base", (0.0, 0.0, force), (0.0, 0.0, 0.0))
    # What is on at the first command is the payload.
    stream.on_command(30 * MILLISECOND, "", COMMAND.name, COMMAND.position)
    wanted = stream.on_trajectory(
        31 * MILLISECOND, "", MOTORS, [planned_point(2, p.positions, p.velocities) for p in points]
    )
    assert wanted.fault is None
    for found, point in zip(first.points, wanted.points, strict=True):
        assert found.positions == tuple(point.positions)
        assert found.velocities == tuple(point.velocities)
        assert found.accelerations == ()
    assert first.header.frame_id == "wrist_corrected"
    assert [point.time_from_start_ns for point in first.points] == [0, 1, 2]
    assert second.points == wild.points


def test_the_residual_at_the_tool_point_is_the_same_motion(tmp_path):
    model = load_model(MODEL)
    header = model.table.header
    platform = {**header.geometry["platform"], "tool_point_mm": [10.0, 0.0, 40.0]}
    header = dataclasses.replace(header, geometry={**header.geometry, "platform": platform})
    save_table(dataclasses.replace(model.table, header=header), tmp_path / "table.npz")
    path = tmp_path / "model.yaml"
    path.write_text("{schema: 1, name: x, table: {path: table.npz}, effects: []}")
    replay(write(tmp_path / "in", TIMELINE), path, tmp_path / "out")
    (at_origin,), (at_tool,) = (
        outputs(tmp_path / "out", f"/pose_error_residual{name}") for name in ("", "/task_point")
    )
    turn = at_origin.pose.pose.orientation
    assert at_tool.pose.pose.orientation == turn
    turned = Rotation.from_quat((turn.x, turn.y, turn.z, turn.w))
    desired = model.table.mechanism.forward(np.array(COMMAND.position)).platform
    # The platform is nearly where it is desired: off by some 4e-4 rad, which move 41 mm by 16 um;
    # these times the residual turn of some 4e-4 rad.
    point = desired @ [0.01, 0.0, 0.04]
    origin, tool = at_origin.pose.pose.position, at_tool.pose.pose.position
    shift = np.array([origin.x, origin.y, origin.z]) + turned.apply(point) - point
    assert np.allclose([tool.x, tool.y, tool.z], shift, rtol=0, atol=1e-8)
    assert np.linalg.norm(shift - [origin.x, origin.y, origin.z]) > 1e-6


def test_replay_of_a_replay_replaces_the_outputs(tmp_path):
    replay(write(tmp_path / "in", TIMELINE), MODEL, tmp_path / "once")
    summary = replay(tmp_path / "once", MODEL, tmp_path / "twice")
    assert summary.replaced == 13
    assert np.array_equal(shifts(tmp_path / "once"), shifts(tmp_path / "twice"))


def test_recording_of_rosbags_with_foreign_names(tmp_path, capsys):
    """Written by rosbags, other topics and joints in another order, read through the command."""
    time_type = STORE.types["builtin_interfaces/msg/Time"]
    header_type = STORE.types["std_msgs/msg/Header"]
    state_type = STORE.types["sensor_msgs/msg/JointState"]
    wrench_type = STORE.types["geometry_msgs/msg/WrenchStamped"]
    vector, wrench = (
        STORE.types["geometry_msgs/msg/Vector3"],
        STORE.types["geometry_msgs/msg/Wrench"],
    )
    path = tmp_path / "foreign"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        states = writer.add_connection("/arm/joints", state_type.__msgtype__, typestore=STORE)
        loads = writer.add_connection("/ft/wrench", wrench_type.__msgtype__, typestore=STORE)
        for i in range(5):
            ns = (i + 1) * MILLISECOND
            stamp = header_type(time_type(0, ns), "wrist_base")
            message = wrench_type(stamp, wrench(vector(0.1 * i, 0.0, -1.0), vector(0.0, 0.0, 0.0)))
            writer.write(loads, ns, STORE.serialize_cdr(message, wrench_type.__msgtype__))
            positions = np.radians([-10.0, 77.0, 20.0 + i])
            message = state_type(stamp, ["b", "gripper", "a"], positions, np.zeros(0), np.zeros(0))
            writer.write(states, ns, STORE.serialize_cdr(message, state_type.__msgtype__))
    names = ["--topic", "/joint_states:=/arm/joints", "--topic", "/load_estimate:=/ft/wrench"]
    names += ["--joint", "a", "--joint", "b"]
    assert main(["replay", str(path), "-o", str(tmp_path / "out"), *names]) == 0
    assert "5 predictions for 5 joint states" in capsys.readouterr().out
    model = load_model(MODEL)
    wanted = [
        model.predict(
            np.radians((20.0 + i, -10.0)), Load(np.array([0.1 * i, 0.0, -1.0, 0.0, 0.0, 0.0]))
        ).motion[1]
        for i in range(5)
    ]
    assert np.array_equal(shifts(tmp_path / "out"), np.array(wanted))


def test_frames_of_tf_static_are_used_and_a_transform_that_is_none_is_counted(tmp_path):
    """The sensor hangs at the platform over two steps, both turned by 90 deg about x."""
    half = float(np.sqrt(0.5))
    turn = Transform(Vector3(0.0, 0.0, 0.0), Quaternion(half, 0.0, 0.0, half))
    steps = tuple(
        TransformStamped(Header(0, parent), child, turn)
        for parent, child in (("wrist_platform", "tool"), ("tool", "ft"))
    )
    broken = TransformStamped(Header(0, "a"), "b", Transform(Vector3(), Quaternion(w=2.0)))
    timeline = [
        (0, "/tf_static", TFMessage(steps)),
        (0, "/tf_static", TFMessage((broken,))),
        (1, "/load_estimate", load(MILLISECOND, (0.0, 0.0, 1.0), "ft")),
        (1, "/joint_states", joints(MILLISECOND, (5.0, 10.0))),
    ]
    summary = replay(write(tmp_path / "in", timeline), MODEL, tmp_path / "out")
    (reason,) = summary.refused
    assert "static transform a -> b" in reason
    down = Load(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]), on_platform=True)
    wanted = load_model(MODEL).predict(np.radians((5.0, 10.0)), down).motion[1]
    assert np.allclose(shifts(tmp_path / "out"), [wanted], rtol=0, atol=1e-13)


# Of the bushing the temperature counts, of the platform the humidity.
WARM_AND_HUMID = """schema: 1
name: warm and humid
table: {path: TABLE}
effects:
- effect: thermal_softening
  component: joint_1
  parameters: {softening_percent_per_K: 5.0}
- effect: formula
  id: swelling
  component: platform
  direction: [0, 0, 1, 0, 0, 0]
  expression: "growth_um * humidity"
  covariates: [humidity]
  parameters: {growth_um: 0.1}
"""


@pytest.fixture
def warm_and_humid(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(
        WARM_AND_HUMID.replace("TABLE", str(shipped_file("precomputed/palmieri2015.npz")))
    )
    return path


# t [ms]       0        10      20           30      35        40
# load        -1 N
# joint_1     30 degC          40 degC
# humidity     50 %            70 %                  90 %
# joints                10                   30                40
def warm_timeline(covariate="/covariates/humidity"):
    return [
        (0, "/load_estimate", load(0, (0.0, 0.0, -1.0))),
        (0, "/temperatures", Temperature(Header(0, "joint_1"), 30.0)),
        (0, covariate, Float64(50.0)),
        (10, "/joint_states", joints(10 * MILLISECOND, (5.0, 10.0))),
        (20, "/temperatures", Temperature(Header(20 * MILLISECOND, "joint_1"), 40.0)),
        (20, covariate, Float64(70.0)),
        (30, "/joint_states", joints(30 * MILLISECOND, (5.0, 10.0))),
        (35, covariate, Float64(90.0)),
        (40, "/joint_states", joints(40 * MILLISECOND, (5.0, 10.0))),
    ]


@pytest.mark.parametrize("covariate", ["/covariates/humidity", "/hygrometer"])
def test_temperatures_and_covariates_are_heard_as_by_the_nodes(tmp_path, warm_and_humid, covariate):
    source = write(tmp_path / "in", warm_timeline(covariate))
    names = {} if covariate.startswith("/covariates") else {"/covariates/humidity": covariate}
    summary = replay(source, warm_and_humid, tmp_path / "out", remaps=names)
    assert not summary.warnings
    wanted = (
        load_model(warm_and_humid)
        .batch(
            Block(
                time=np.array([0.010, 0.030, 0.040]),
                theta=np.tile(np.radians((5.0, 10.0)), (3, 1)),
                load=np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (3, 1)),
                temperatures={"joint_1": np.array([30.0, 40.0, 40.0])},
                covariates={"humidity": np.array([50.0, 70.0, 90.0])},
            )
        )
        .twist
    )
    # Shift and translation of a twist differ by the angle times itself, 1e-4 of it; the humidity
    # alone moves the platform by 5 um.
    assert np.allclose(shifts(tmp_path / "out"), wanted[:, :3], atol=1e-9)


def test_what_the_model_had_to_leave_out_is_said(tmp_path, warm_and_humid, capsys):
    timeline = [row for row in warm_timeline() if row[1] in ("/load_estimate", "/joint_states")]
    # Somebody else's topic of that name is no thermometer; no node would hear it.
    timeline.append((50, "/temperatures", String("warm")))
    source = write(tmp_path / "in", timeline)
    summary = replay(source, warm_and_humid, tmp_path / "out")
    assert sorted(summary.warnings.values()) == [3, 3]
    command = ["replay", str(source), "-o", str(tmp_path / "again")]
    assert main([*command, "--model", str(warm_and_humid)]) == 0
    assert "3 predictions, the first: thermal_softening@joint_1: " in capsys.readouterr().out


def test_a_warning_that_differs_in_its_numbers_alone_is_one_line(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(
        f"schema: 1\nname: m\ntable: {{path: {shipped_file('precomputed/palmieri2015.npz')}}}\n"
        "effects: [{effect: formula, id: own, component: platform, direction: [0, 0, 0, 0, 0, 1], "
        "expression: size * time, parameters: {size: 1.0}}]\n"
    )
    summary = replay(write(tmp_path / "in", TIMELINE), path, tmp_path / "out")
    ((text, count),) = summary.warnings.items()
    assert text.startswith("own@platform: turns by 10.00 mrad, past the first order")
    assert count == 3
