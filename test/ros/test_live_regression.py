"""The stored recording through live nodes: the outputs are those of its replay."""

from pathlib import Path

from geometry_msgs.msg import PoseWithCovarianceStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory

from wrist_stiffness.commands.output_changes import output_changes
from wrist_stiffness.recording import messages
from wrist_stiffness.recording.channel import channel_of
from wrist_stiffness.recording.reader import open_recording
from wrist_stiffness.recording.writer import RecordingWriter
from wrist_stiffness.ros.angle_corrector import AngleCorrector
from wrist_stiffness.ros.conversions import nanoseconds, time_message
from wrist_stiffness.ros.pose_error_predictor import PoseErrorPredictor

FOLDER = Path(__file__).parents[1] / "data/replay"
HUMIDITY = "/covariates/humidity"
PREDICTED, CORRECTED = "/pose_error_predicted", "/motor_commands_corrected"
RESIDUAL, PLANNED = "/pose_error_residual", "/motor_trajectory_corrected"
INPUTS = {
    "/load_estimate": WrenchStamped,
    "/temperatures": Temperature,
    HUMIDITY: Float64,
    "/joint_states": JointState,
    "/motor_commands": JointState,
    "/motor_trajectory": JointTrajectory,
}
OUTPUTS = {
    PREDICTED: (PoseWithCovarianceStamped, messages.PoseWithCovarianceStamped),
    RESIDUAL: (PoseWithCovarianceStamped, messages.PoseWithCovarianceStamped),
    CORRECTED: (JointState, messages.JointState),
    PLANNED: (JointTrajectory, messages.JointTrajectory),
}
"""Without /motor_positions_corrected, which has no stamp to be found by."""


class Player:
    """Sends a recording's messages one by one, each when the one before has been answered."""

    def __init__(self, graph):
        self.graph = graph
        rules = ["--ros-args", "--params-file", str(FOLDER / "parameters.yaml")]
        rules += ["-p", f"model_file:={FOLDER / 'effects.yaml'}", "-p", "use_sim_time:=true"]
        self.nodes = [
            make_node(context=graph.context, cli_args=rules)
            for make_node in (PoseErrorPredictor, AngleCorrector)
        ]
        for node in self.nodes:
            graph.executor.add_node(node)
        for topic, (message_type, _) in OUTPUTS.items():
            graph.listen(message_type, topic)
            graph.connected(topic)
        self.sent = dict.fromkeys(INPUTS, 0)
        self.now_ns = 0

    def play(self, raw):
        topic = raw.channel.topic
        message = deserialize_message(raw.payload, INPUTS[topic])
        if raw.log_time_ns != self.now_ns:
            self.now_ns = raw.log_time_ns
            self.graph.publish("/clock", Clock(clock=time_message(self.now_ns)))
            self.graph.until(self.is_now, "clock")
        self.sent[topic] += 1
        self.graph.publish(topic, message)
        what = f"answer to {topic} {self.sent[topic]}"
        self.graph.until(lambda: self.is_answered(topic, message), what)

    def is_now(self):
        return all(node.get_clock().now().nanoseconds == self.now_ns for node in self.nodes)

    def is_answered(self, topic, message):
        if topic == "/joint_states":
            answers = len(self.graph.heard[PREDICTED]) + self.nodes[0].health.faults
            return answers == self.sent[topic]
        if topic == "/motor_commands":
            return len(self.graph.heard[CORRECTED]) == self.sent[topic]
        if topic == "/motor_trajectory":
            return len(self.graph.heard[PLANNED]) == self.sent[topic]
        streams = [node.stream for node in self.nodes]
        if topic == "/load_estimate":
            stamp_ns = nanoseconds(message.header.stamp)
            return all(stream.loads.newest_ns == stamp_ns for stream in streams)
        if topic == HUMIDITY:
            held = [stream.covariates.at(self.now_ns).get("humidity") for stream in streams]
            return held == [message.data] * 2
        name = message.header.frame_id
        held = [stream.temperatures.at(self.now_ns).get(name) for stream in streams]
        return held == [message.temperature] * 2


def test_live_nodes_give_what_is_stored(graph, tmp_path):
    player = Player(graph)
    for raw in open_recording(FOLDER / "recording.mcap").raw_messages(tuple(INPUTS)):
        player.play(raw)
    wanted = sum(1 for _ in open_recording(FOLDER / "effects.mcap").raw_messages((RESIDUAL,)))
    graph.until(lambda: len(graph.heard[RESIDUAL]) >= wanted, "residuals")
    with RecordingWriter(tmp_path / "live") as writer:
        for topic, (_, recorded_type) in OUTPUTS.items():
            for message in graph.heard[topic]:
                payload = serialize_message(message)
                stamp_ns = nanoseconds(message.header.stamp)
                writer.write_raw(channel_of(topic, recorded_type), payload, stamp_ns)
    changes = output_changes(FOLDER / "effects.mcap", tmp_path / "live", tuple(OUTPUTS))
    assert [topic for topic in changes if not topic.same] == []
    assert [topic.topic for topic in changes] == list(OUTPUTS)
