"""Faults of a cell in operation: what goes on, what stops, what comes back."""

import threading
from dataclasses import replace

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped, WrenchStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.model_file import load_model, save_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.ros import wrist_node
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import joint_message, nanoseconds, time_message
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor
from wrist_stiffness.ros.qos import RELIABLE_QOS

SECOND = 1_000_000_000
THETA = (0.1, -0.2)
NAMES = ("motor_1_joint", "motor_2_joint")
PREDICTOR, CORRECTOR = "pose_error_predictor", "angle_corrector"
PREDICTED, CORRECTED = "/pose_error_predicted", "/motor_commands_corrected"
BURST = 100
DEADLINE_S = 20.0


@pytest.fixture
def predictor(graph, model_path):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path))
    graph.listen(PoseWithCovarianceStamped, PREDICTED)
    graph.connected(PREDICTED)
    return node


def send_load(graph, node, stamp_ns):
    graph.load(stamp_ns)
    graph.until(lambda: node.stream.loads.newest_ns == stamp_ns, "load")


def stamps(graph, topic):
    return [nanoseconds(message.header.stamp) for message in graph.heard[topic]]


def wait_for(graph, topic, count):
    graph.until(lambda: len(graph.heard[topic]) >= count, f"{topic} {count}")


def test_the_output_has_no_gap_while_a_model_is_loaded(graph, predictor, monkeypatch):
    send_load(graph, predictor, SECOND)
    released = threading.Event()

    def slow(path):
        assert released.wait(DEADLINE_S)
        return load_model(path)

    monkeypatch.setattr(wrist_node, "load_model", slow)
    client = graph.probe.create_client(Trigger, f"/{PREDICTOR}/reload_model")
    graph.until(client.service_is_ready, "service")
    answer, before = client.call_async(Trigger.Request()), predictor.stream.model
    for i in range(20):
        graph.joints("/joint_states", SECOND + i)
        wait_for(graph, PREDICTED, i + 1)
    assert not answer.done()
    assert predictor.stream.model is before
    released.set()
    graph.until(answer.done, "answer")
    assert answer.result().success, answer.result().message
    assert predictor.stream.model is not before


@pytest.mark.parametrize("kind", ["damaged", "missing", "another geometry"])
def test_a_table_that_was_replaced_by_a_wrong_one_is_not_taken(
    graph, predictor, model, tmp_path, kind
):
    table = tmp_path / "table.npz"
    if kind == "another geometry":
        header = replace(model.table.header, geometry={**model.table.header.geometry, "name": "b"})
        save_table(replace(model.table, header=header), table)
    elif kind == "damaged":
        save_table(model.table, table)
        content = bytearray(table.read_bytes())
        content[len(content) // 2] ^= 0xFF
        table.write_bytes(content)
    path = tmp_path / "model.yaml"
    path.write_text(
        yaml.safe_dump({"schema": 1, "name": "x", "table": {"path": table.name}, "effects": []})
    )
    assert predictor.set_parameters([Parameter("model_file", value=str(path))])[0].successful
    answer = graph.call(Trigger, f"/{PREDICTOR}/reload_model", Trigger.Request())
    assert not answer.success
    assert ("table.npz" if kind != "another geometry" else "geometry b") in answer.message
    send_load(graph, predictor, SECOND)
    graph.joints("/joint_states", SECOND)
    wait_for(graph, PREDICTED, 1)
    _, values = graph.status(PREDICTOR, lambda status, values: values["last fault"])
    assert "palmieri2015" in values["model"]


FAILING_LAW = """
from wrist_stiffness.model.law import Law

class Failing(Law):
    id, stage, places, sentence, check, excited_by = "own", "reaction", ("platform",), "", "", ""
    def __init__(self): 1 / 0
    def parameters(self, place): return ()
    def advance(self, at, place, values, state): return None, None
"""


def test_no_model_file_ends_a_node(graph, model_path, model, tmp_path):
    """A law of the user's own is code, which can fail in any way."""
    trusting = {"model_file": str(model_path), "allow_python_laws": True}
    predictor = graph.add(PoseErrorPredictor, **trusting)
    graph.listen(PoseWithCovarianceStamped, PREDICTED)
    graph.connected(PREDICTED)
    (tmp_path / "own.py").write_text(FAILING_LAW)
    effect = {"effect": "python", "class": "own.py:Failing", "component": "platform"}
    content = {"schema": 1, "name": "x", "table": {"path": "table.npz"}, "effects": [effect]}
    save_table(model.table, tmp_path / "table.npz")
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(content))
    assert predictor.set_parameters([Parameter("model_file", value=str(path))])[0].successful
    answer = graph.call(Trigger, f"/{PREDICTOR}/reload_model", Trigger.Request())
    assert not answer.success
    assert "ZeroDivisionError" in answer.message
    send_load(graph, predictor, SECOND)
    graph.joints("/joint_states", SECOND)
    wait_for(graph, PREDICTED, 1)


def test_a_burst_of_joint_states_is_predicted_in_full(graph, predictor):
    send_load(graph, predictor, SECOND)
    for i in range(BURST):
        graph.joints("/joint_states", SECOND + i)
    wait_for(graph, PREDICTED, BURST)
    assert stamps(graph, PREDICTED) == [SECOND + i for i in range(BURST)]


def test_after_a_burst_of_commands_the_last_one_is_sent(graph, model_path):
    graph.add(AngleCorrector, model_file=str(model_path), enabled_on_start=True)
    graph.listen(JointState, CORRECTED)
    graph.connected(CORRECTED)
    for i in range(BURST):
        graph.joints("/motor_commands", SECOND + i, (0.001 * i, 0.0))
    graph.until(lambda: SECOND + BURST - 1 in stamps(graph, CORRECTED), "last command")
    found = stamps(graph, CORRECTED)
    assert found == sorted(set(found))
    assert graph.heard[CORRECTED][-1].position[0] == pytest.approx(0.001 * (BURST - 1))


def test_doubled_and_late_joint_states_are_predicted_with_their_own_load(graph, predictor):
    graph.load(SECOND, (0, 0, 0, 0, 0, 0))
    send_load(graph, predictor, SECOND + 10)
    order = [SECOND + 12, SECOND + 12, SECOND + 5]
    for stamp in order:
        graph.joints("/joint_states", stamp)
    wait_for(graph, PREDICTED, 3)
    assert stamps(graph, PREDICTED) == order
    first, second, late = (message.pose.pose.position.x for message in graph.heard[PREDICTED])
    assert first == second != late


def test_a_model_with_a_memory_refuses_late_joint_states(graph, model, tmp_path):
    """What it remembers is of later; a doubled one is the same moment again."""
    path = tmp_path / "loose.yaml"
    width = {"width_mdeg": Estimate(20.0)}
    save_model(model.with_effects(Effect(find_law("backlash"), "motor_1", width)), path)
    node = graph.add(PoseErrorPredictor, model_file=str(path))
    graph.listen(PoseWithCovarianceStamped, PREDICTED)
    graph.connected(PREDICTED)
    send_load(graph, node, SECOND)
    for stamp in (SECOND + 12, SECOND + 12, SECOND + 5, SECOND + 13):
        graph.joints("/joint_states", stamp)
    wait_for(graph, PREDICTED, 3)
    assert stamps(graph, PREDICTED) == [SECOND + 12, SECOND + 12, SECOND + 13]
    _, values = graph.status(PREDICTOR, lambda status, values: values["last fault"])
    assert "is before the last one" in values["last fault"]


def test_doubled_and_late_commands_are_forwarded_and_move_nothing(graph, model_path):
    slow = {"slew_deg_s": 0.01, "deadband_steps": 0.0, "enabled_on_start": True}
    node = graph.add(AngleCorrector, model_file=str(model_path), **slow)
    graph.listen(JointState, CORRECTED)
    graph.connected(CORRECTED)
    send_load(graph, node, SECOND)
    sent = [SECOND + ms * SECOND // 1000 for ms in (0, 50, 50, 25, 75)]
    for count, stamp in enumerate(sent, start=1):
        graph.joints("/motor_commands", stamp)
        wait_for(graph, CORRECTED, count)
    assert stamps(graph, CORRECTED) == sent
    angles = [message.position.tolist() for message in graph.heard[CORRECTED]]
    assert angles[0] == list(THETA)
    assert angles[1] != angles[0]
    # Neither the doubled one nor the late one is time that passes.
    assert angles[2] == angles[1] == angles[3] != angles[4]


def test_after_the_clock_jumped_back_predictions_go_on(graph, predictor):
    send_load(graph, predictor, 100 * SECOND)
    graph.joints("/joint_states", 100 * SECOND)
    wait_for(graph, PREDICTED, 1)
    graph.joints("/joint_states", 2 * SECOND)
    graph.until(lambda: predictor.health.faults == 1, "refused sample")
    send_load(graph, predictor, 2 * SECOND)
    graph.joints("/joint_states", 2 * SECOND + 1)
    wait_for(graph, PREDICTED, 2)
    assert stamps(graph, PREDICTED) == [100 * SECOND, 2 * SECOND + 1]


def test_silence_is_reported(graph, predictor):
    status, _ = graph.status(PREDICTOR, lambda status, values: True)
    assert status.level == status.STALE
    assert status.message == "no input"


def test_when_the_load_falls_silent_the_correction_fades_to_none(graph, model_path):
    node = graph.add(
        AngleCorrector,
        model_file=str(model_path),
        enabled_on_start=True,
        load_policy="follow",
        deadband_steps=0.0,
        slew_deg_s=0.01,
    )
    graph.listen(JointState, CORRECTED)
    graph.connected(CORRECTED)
    send_load(graph, node, SECOND)
    count = 12
    for i in range(count):
        graph.joints("/motor_commands", SECOND + i * SECOND // 10)
        wait_for(graph, CORRECTED, i + 1)
    deltas = np.array([np.array(m.position) - THETA for m in graph.heard[CORRECTED]])
    # 0.5 s after the load the correction begins to fade, by at most 0.001 deg a command.
    steps = np.degrees(np.abs(np.diff(deltas, axis=0)))
    assert np.max(steps) <= 1.0001e-3
    assert np.max(np.abs(deltas[5])) > 0.0
    assert deltas[-1].tolist() == [0.0, 0.0]
    _, values = graph.status(CORRECTOR, lambda status, values: "refused StaleLoadError" in values)
    assert "older than the joint state" in values["last fault"]


def test_lifecycle_stops_and_starts_the_output(graph, model_path):
    node = graph.add(PoseErrorPredictor, model_file=str(model_path), autostart=False)

    def state():
        answer = graph.call(GetState, f"/{PREDICTOR}/get_state", GetState.Request())
        return answer.current_state.id

    def change(transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return graph.call(ChangeState, f"/{PREDICTOR}/change_state", request).success

    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    for _ in range(2):
        assert change(Transition.TRANSITION_CONFIGURE)
        assert change(Transition.TRANSITION_ACTIVATE)
        assert state() == State.PRIMARY_STATE_ACTIVE
        if PREDICTED not in graph.heard:
            graph.listen(PoseWithCovarianceStamped, PREDICTED)
        graph.until(lambda: graph.probe.count_publishers(PREDICTED), "output")
        graph.heard[PREDICTED].clear()
        send_load(graph, node, SECOND)
        graph.until(lambda: graph.probe.count_subscribers("/joint_states"), "input")
        graph.until(
            lambda: (graph.joints("/joint_states", SECOND), graph.heard[PREDICTED])[1], "prediction"
        )
        assert change(Transition.TRANSITION_DEACTIVATE)
        count = len(graph.heard[PREDICTED])
        graph.joints("/joint_states", SECOND)
        send_load(graph, node, SECOND + 1)
        assert len(graph.heard[PREDICTED]) == count
        assert change(Transition.TRANSITION_CLEANUP)
        assert state() == State.PRIMARY_STATE_UNCONFIGURED


def test_simulated_time_stamps_the_diagnostics(graph, model_path):
    graph.add(PoseErrorPredictor, model_file=str(model_path), use_sim_time=True)
    graph.publish("/clock", Clock(clock=time_message(1234 * SECOND)))
    graph.until(
        lambda: any(m.header.stamp.sec == 1234 for m in graph.heard["/diagnostics"]), "sim time"
    )


def test_a_message_without_a_stamp_has_no_load(graph, predictor):
    send_load(graph, predictor, SECOND)
    graph.publish("/joint_states", joint_message(0, "", NAMES, np.array(THETA)))
    _, values = graph.status(PREDICTOR, lambda status, values: "refused StaleLoadError" in values)
    assert "has no stamp" in values["last fault"]


@pytest.mark.parametrize("topic", ["/joint_states", "/load_estimate"])
def test_a_payload_that_cannot_be_read_is_told_and_the_next_one_is_answered(
    graph, predictor, topic
):
    kind = {"/joint_states": JointState, "/load_estimate": WrenchStamped}[topic]
    damaged = graph.probe.create_publisher(kind, topic, RELIABLE_QOS)
    graph.until(damaged.get_subscription_count, "subscription")
    damaged.publish(serialize_message(kind())[:14])
    graph.until(lambda: predictor.health.faults == 1, "fault")
    graph.status(
        PREDICTOR, lambda status, values: kind.__name__ in values.get("last RecordingError", "")
    )
    send_load(graph, predictor, SECOND)
    graph.joints("/joint_states", SECOND)
    wait_for(graph, PREDICTED, 1)
