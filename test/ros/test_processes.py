"""Nodes as processes: started, stopped, and the whole cell recorded and replayed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sensor_msgs.msg import JointState
from waiting import wait_until

from wrist_stiffness.cli import main as command_line
from wrist_stiffness.commands import cell
from wrist_stiffness.commands.node_list import CELL_PARAMETERS, WRIST_NODES
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.errors import InputError
from wrist_stiffness.lookup.table_file import save_table
from wrist_stiffness.recording import open_recording
from wrist_stiffness.ros.conversions import nanoseconds

DEADLINE_S = 60.0
NODES = {node.name: node for node in WRIST_NODES}

pytestmark = pytest.mark.slow


def listed_nodes(graph):
    graph.executor.spin_once(timeout_sec=0.05)
    return graph.probe.get_node_names()


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_cleanly(graph, name, ending):
    with subprocess.Popen(NODES[name].command(), stderr=subprocess.PIPE, text=True) as process:
        try:
            graph.until(lambda: name in listed_nodes(graph), name)
            graph.status(name, lambda status, values: True)
            # In the midst of its work, where publishing fails from one moment to the next.
            topic = "/motor_commands" if name == "angle_corrector" else "/joint_states"
            graph.until(lambda: graph.probe.count_subscribers(topic), topic)
            until, sent = time.monotonic() + DEADLINE_S, 0
            while process.poll() is None and time.monotonic() < until:
                graph.joints(topic, time.time_ns())
                sent += 1
                if sent == 200:
                    process.send_signal(ending)
            _, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert process.returncode == 0
    assert "Traceback" not in errors


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_cleanly_while_its_libraries_are_loaded(tmp_path, ending):
    # It works on, as an import does: a signal just before a blocking read would wait for its end.
    slow = "import time\nprint('loading', flush=True)\nend = time.monotonic() + 60.0\n"
    slow += "while time.monotonic() < end:\n    pass\n"
    (tmp_path / "numpy.py").write_text(slow)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        NODES["angle_corrector"].command(),
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout.readline() == "loading\n"
            process.send_signal(ending)
            process.wait(DEADLINE_S)
            assert (process.returncode, process.stderr.read()) == (0, "")
        finally:
            process.kill()


def test_an_impatient_user_sees_no_traceback(graph):
    with subprocess.Popen(
        NODES["angle_corrector"].command(), stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            graph.status("angle_corrector", lambda status, values: True)
            until = time.monotonic() + DEADLINE_S
            while process.poll() is None and time.monotonic() < until:
                process.send_signal(signal.SIGINT)
                time.sleep(0.001)  # the pace of the signals; nothing is waited for
            _, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert process.returncode in (0, -signal.SIGINT)  # the latter once Python itself is gone
    assert "Traceback" not in errors


HANGING_LAW = """
import time
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Parameter
{at_once}
class Hanging(Law):
    id, stage, places, sentence, check, excited_by = "own", "geometry", ("platform",), "x", "x", "x"
    def parameters(self, place): return (Parameter("x_um", lower=0.0, upper=1.0, scale=1.0),)
    def advance(self, at, place, values, state):
        if at.block.theta[0, 0] > 0.3:
            open({ready!r}, "w").close()
            time.sleep(3600.0)
        return at.screw(place, [0.0] * 6), state
"""


@pytest.mark.slow
@pytest.mark.parametrize("where", ["pipe", "loading", "predicting"])
def test_a_node_ends_wherever_it_hangs(graph, model, tmp_path, where):
    """A callback that never returns never sees that it is told to end."""
    path, ready = tmp_path / "model.yaml", tmp_path / "ready"
    if where == "pipe":
        os.mkfifo(path)
    else:
        hang = f"open({str(ready)!r}, 'w').close()\ntime.sleep(3600.0)"
        at_once = hang if where == "loading" else ""
        text = HANGING_LAW.format(at_once=at_once, ready=str(ready))
        (tmp_path / "own.py").write_text(text)
        save_table(model.table, tmp_path / "table.npz")
        effect = "{effect: python, class: 'own.py:Hanging', component: platform}"
        path.write_text(f"schema: 1\nname: x\ntable: {{path: table.npz}}\neffects: [{effect}]\n")
    options = {"model_file": str(path), "allow_python_laws": True, "model_load_limit_s": 3600.0}
    node = NODES["pose_error_predictor"].having(options | {"state_folder": "", "frames": ""})
    with subprocess.Popen(node.command(), stderr=subprocess.PIPE, text=True) as process:
        try:
            if where == "pipe":
                status, _ = graph.status(node.name, lambda status, values: True)
                assert "is no regular file" in status.message
            elif where == "loading":
                graph.until(ready.exists, "law")
            else:
                graph.status(node.name, lambda status, values: values["state"] == "active")

                def is_stuck():
                    graph.load(10**9)
                    graph.joints("/joint_states", 10**9, (0.4, 0.0))
                    return ready.exists()

                graph.until(is_stuck, "law that hangs")
            process.send_signal(signal.SIGTERM)
            _, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert process.returncode == (where == "predicting")
    assert ("in advance" in errors) is (where == "predicting")


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"load_age_limit_s": -1.0}, "load_age_limit_s"),
        ({"load_age_limit_s": "long"}, "load_age_limit_s"),
        ({"frames": "'{ft: {parent: moon}}'"}, "'moon' is not one of"),
        ({"covariates": '"humidity b!c"'}, "covariates: 'b!c' cannot be the name of a topic"),
        ({"model_fle": "x"}, "unknown parameter 'model_fle'; did you mean model_file?"),
        ({"frames.ft.parent": "x"}, "'frames.ft.parent': frames is one text"),
    ],
)
def test_a_node_does_not_start_with_wrong_parameters(parameters, text):
    node = NODES["pose_error_predictor"].having(parameters)
    ended = subprocess.run(node.command(), capture_output=True, text=True, timeout=DEADLINE_S)
    assert ended.returncode == 2
    assert "Traceback" not in ended.stderr
    assert text in ended.stderr.splitlines()[-1]


@pytest.mark.parametrize("arguments", ["-p begin_with:=", "--params-file nowhere.yaml", "--bogus"])
def test_a_node_does_not_start_with_ros_arguments_that_cannot_be_read(arguments):
    command = [*NODES["pose_error_predictor"].command(), "--ros-args", *arguments.split()]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
    assert ended.returncode == 2
    assert "Traceback" not in ended.stderr
    last = ended.stderr.splitlines()[-1]
    assert last.startswith("wrist-stiffness node: error: ROS 2 cannot start: ")
    assert arguments.split()[-1] in last


def test_a_killed_node_comes_back(graph):
    node = NODES["pose_error_predictor"]
    for _ in range(2):
        with subprocess.Popen(node.command()) as process:
            try:
                graph.heard["/diagnostics"].clear()
                status, _ = graph.status(node.name, lambda status, values: True)
                assert status.level != status.ERROR
            finally:
                process.kill()


def test_a_killed_corrector_comes_back_and_ramps_from_zero(graph):
    """Nobody forwards while it is away; who comes back does not step to the full correction."""
    node = NODES["angle_corrector"].having(
        {"enabled_on_start": True, "deadband_steps": 0.0, **CELL_PARAMETERS}
    )
    corrected, theta = "/motor_commands_corrected", [0.1, -0.2]
    graph.listen(JointState, corrected)
    for start_ns in (10**9, 10**10):
        with subprocess.Popen(node.command()) as process:
            try:
                graph.heard["/diagnostics"].clear()
                graph.status(node.name, lambda status, values: True)
                sent_ns = [start_ns]

                def answers(start_ns=start_ns):
                    # What the killed one said last may come late, with its earlier stamps.
                    stamped = ((nanoseconds(m.header.stamp), m) for m in graph.heard[corrected])
                    return [(ns, list(m.position)) for ns, m in stamped if ns >= start_ns]

                def moved(sent_ns=sent_ns, answers=answers):
                    # Time stands still until the node is heard: its first answers may get lost.
                    sent_ns.append(sent_ns[-1] + (10**8 if answers() else 0))
                    graph.load(sent_ns[-1])
                    graph.joints("/motor_commands", sent_ns[-1], theta)
                    return any(position != theta for _, position in answers())

                graph.until(moved, "correction")
                assert answers()[0] == (start_ns, theta)
                # Killed while it writes, it leaves shared memory with which Fast DDS 2.14 crashes
                # at the end of the next process that heard it: of this one.
                graph.until(
                    lambda answers=answers, sent_ns=sent_ns: answers()[-1][0] == sent_ns[-1],
                    "answer to the last command",
                )
            finally:
                process.kill()


def payloads(path, topic):
    """Return the stored bytes of a topic by the stamp of their header."""
    recording = open_recording(path)
    stamps = [message.header.stamp_ns for _, _, message in recording.messages([topic])]
    raws = recording.raw_messages([topic])
    return {stamp: raw.payload for stamp, raw in zip(stamps, raws, strict=True)}


def test_live_and_replayed_predictions_are_equal_to_the_bit(tmp_path, model_path):
    live, replayed = tmp_path / "live", tmp_path / "replayed"
    assert cell.run_cell(seconds=2.0, record=live, rate_hz=50.0)
    counts = {topic.name: topic.count for topic in open_recording(live).topics}
    assert counts["/joint_states"] > 100
    for topic in (
        "/load_estimate",
        "/motor_commands",
        "/platform_pose_measured",
        "/pose_error_predicted",
        "/pose_error/s_um",
        "/pose_error/phi_mdeg",
    ):
        assert counts[topic] == counts["/joint_states"], topic
    # A corrector that is kept waiting drops old commands instead of lagging.
    assert 0.9 * counts["/motor_commands"] < counts["/motor_commands_corrected"]
    assert 0 < counts["/pose_error_residual"] < counts["/joint_states"]
    late = [
        value.value
        for _, _, message in open_recording(live).messages(["/diagnostics"])
        for status in message.status
        for value in status.values
        if status.name == "pose_error_predictor" and value.key == "loads that came late"
    ]
    replay(live, model_path, replayed)
    before = payloads(live, "/pose_error_predicted")
    after = payloads(replayed, "/pose_error_predicted")
    assert before.keys() == after.keys()
    differing = sum(payload != after[stamp] for stamp, payload in before.items())
    assert differing <= int(late[-1])


@pytest.mark.parametrize(
    ("ending", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 128 + signal.SIGTERM)]
)
def test_a_signal_ends_the_cell_with_all_its_nodes(tmp_path, ending, code):
    path = tmp_path / "interrupted.mcap"
    with subprocess.Popen(
        [sys.executable, "-m", "wrist_stiffness", "cell", "--record", str(path)],
        stderr=subprocess.PIPE,
        text=True,
        # Tests that run in the background are started deaf to SIGINT, and hand that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        try:
            wait_until(lambda: list(tmp_path.glob(f".{path.name}.*")), process)
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            process.send_signal(ending)
            _, errors = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert process.returncode == code
    assert "Traceback" not in errors
    assert open_recording(path).damage == ""
    assert len(children) == 5
    assert [child for child in children if Path(f"/proc/{child}").exists()] == []


def is_running(pid):
    """Whether a process is there and no zombie; who adopts an orphan may never reap it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_killed_cell_leaves_no_node_behind_and_a_whole_recording(tmp_path):
    path = tmp_path / "killed.mcap"
    command = [sys.executable, "-m", "wrist_stiffness", "cell", "--record", str(path)]
    with subprocess.Popen(command) as process:
        try:
            wait_until(lambda: list(tmp_path.glob(f".{path.name}.*")), process)
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        finally:
            process.kill()
    assert len(children) == 5
    end_s = time.monotonic() + DEADLINE_S
    while any(map(is_running, children)):
        assert time.monotonic() < end_s
        os.sched_yield()
    assert open_recording(path).damage == ""


def test_the_cell_says_which_node_failed(monkeypatch, capfd):
    monkeypatch.setitem(cell.CELL_PARAMETERS, "noise_s_um", -1.0)
    with pytest.raises(InputError, match="node model_monitor ended with code 2"):
        cell.run_cell(seconds=20.0)
    assert "noise_s_um" in capfd.readouterr().err


def test_the_cell_refuses_wrong_input(tmp_path, capsys):
    assert command_line.main(["cell", "--seconds", "-1"]) == 2
    assert command_line.main(["cell", "--model", str(tmp_path / "none.yaml")]) == 2
    assert "none.yaml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "number", "limits"),
    [
        ("seconds", "0", "2 to 172800"),
        ("seconds", "1", "2 to 172800"),
        ("seconds", "1e9", "2 to 172800"),
        ("seconds", "nan", "2 to 172800"),
        ("seconds", "inf", "2 to 172800"),
        ("rate", "0", "1 to 2000"),
        ("rate", "-100", "1 to 2000"),
        ("rate", "1e6", "1 to 2000"),
        ("rate", "nan", "1 to 2000"),
        ("rate", "inf", "1 to 2000"),
        ("seed", "-1", "0 to 2147483647"),
        ("seed", str(2**31), "0 to 2147483647"),
    ],
)
def test_a_number_that_cannot_be_is_refused_before_a_node_starts(
    monkeypatch, capsys, option, number, limits
):
    monkeypatch.setattr(subprocess, "Popen", None)
    assert command_line.main(["cell", f"--{option}", number]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"wrist-stiffness: error: {option}: ")
    assert f"is not {limits}" in line


@pytest.mark.parametrize(
    ("place", "why"), [("taken", "exists already"), ("nowhere/live", "does not exist")]
)
def test_a_place_that_takes_no_recording_is_refused_before_a_node_starts(
    tmp_path, monkeypatch, capsys, place, why
):
    (tmp_path / "taken").mkdir()
    monkeypatch.setattr(subprocess, "Popen", None)
    assert command_line.main(["cell", "--record", str(tmp_path / place)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"wrist-stiffness: error: {tmp_path / place}")
    assert why in line
