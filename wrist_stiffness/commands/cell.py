"""Run the nodes with the virtual cell, each as a process of its own."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from wrist_stiffness import topics
from wrist_stiffness.commands.node_list import (
    CELL_PARAMETERS,
    LARGEST_SEED,
    PARENT_PID,
    RATES_HZ,
    RECORDER_NODE,
    SIMULATOR_NODE,
    UNANSWERED,
    WRIST_NODES,
    NodeEntry,
    ParameterValue,
)
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.progress import Progress, silent
from wrist_stiffness.recording import RecordingWriter

LOOK_EVERY_S = 0.1

PATIENCE_S = 60.0
"""How long beyond its due time a run may take to start and to end."""

END_PATIENCE_S = 15.0
"""How long a node may take to end once it is told to."""

SPOKEN = (
    topics.POSE_ERROR_PREDICTED,
    topics.MOTOR_COMMANDS_CORRECTED,
    topics.MODEL_RESIDUAL,
    topics.LOAD_ESTIMATE,
    topics.JOINT_STATES,
    topics.MOTOR_COMMANDS,
    topics.PLATFORM_POSE,
    topics.PLATFORM_POSE_TRUE,
)
"""What the recorder must know of before it listens: of whom it does not know it hears nothing."""

SHORTEST_S, LONGEST_S = 2.0, 172800.0
"""Two motions of a second each, or of a day."""

DOMAINS = 90
"""ROS domains 1 to 90; those above 101 clash with ports that Linux hands out."""

Tell = Callable[[str], None]


def run_cell(
    model: Path | None = None,
    seconds: float | None = None,
    record: Path | None = None,
    rate_hz: float = 100.0,
    seed: int = 0,
    progress: Progress = silent,
    tell: Tell = lambda line: None,
    experiment: str = "rich",
) -> bool:
    """Run predictor, corrector and virtual cell until the motion is over; in the main thread.

    The same motion runs twice, first with the corrector off and then with it on, so that before and
    after can be compared; the notes in the recording say where the second one begins.

    `model`: of nodes and cell; the shipped one if None; `seconds`: about how long both runs of the
    motion take together [s]; without it the motion goes on, uncorrected, until the process is
    interrupted; `record`: rosbag2 folder or `.mcap` file to write; `rate_hz`: samples per second;
    `seed`: of the motion and of the sensors' noise; `progress`: called with seconds done and in
    all; `tell`: called with a line for every node that had to be killed in the end; `experiment`:
    one of `simulation.experiment.EXPERIMENTS`.  Gives whether all nodes answered all along and
    ended when they were told to; the virtual cell itself says on stderr which one fell silent.
    Raises `WristError` if a number, the model or the recording's place cannot be used, a node ends
    with an error, the run does not end in time, or the recording is not complete.
    """
    if find_spec("rclpy") is None:
        raise InputError("cell: ROS 2 (rclpy) is not installed; pip install 'wrist_stiffness[ros]'")
    check_numbers(seconds, rate_hz, seed)
    chosen: dict[str, ParameterValue] = {}
    if model is not None:
        load_model(model)
        chosen["model_file"] = str(Path(model).resolve())
    nodes = [node.having({**CELL_PARAMETERS, **chosen}) for node in WRIST_NODES]
    if record is not None:
        RecordingWriter(record, keep_partial=True).check_target()
        output = {"output": str(Path(record).resolve()), "begin_with": " ".join(SPOKEN)}
        nodes.append(RECORDER_NODE.having(output))
    moves: dict[str, ParameterValue] = {
        "rate_hz": float(rate_hz),
        "seed": seed,
        "experiment": experiment,
    }
    # Predictor and monitor listen to the joint states, and so does the recorder.
    moves["listeners"] = 2 if record is None else 3
    if seconds is not None:
        moves |= {"program_s": seconds / 2.0, "programs": 2, "enable_at_repeat": True}
    killed: list[str] = []

    def tell_killed(name: str) -> None:
        killed.append(name)
        tell(f"cell: node {name} had not ended {END_PATIENCE_S:g} s after it was told to; killed")

    with _processes([*nodes, SIMULATOR_NODE.having({**chosen, **moves})], tell_killed) as running:
        answered = _wait(running, seconds, progress)
    if record is not None:
        code = running[RECORDER_NODE.name].returncode
        # A recording that has its name is complete, however the middleware ends after that.
        if code > 0 or not Path(record).exists():
            raise InputError(f"cell: node {RECORDER_NODE.name} ended with code {code}")
    return answered and not killed


def check_numbers(seconds: float | None, rate_hz: float = 100.0, seed: int = 0) -> None:
    """Refuse numbers with which no run can be, before any node is started (InputError)."""
    if seconds is not None and not SHORTEST_S <= seconds <= LONGEST_S:
        raise InputError(f"seconds: {seconds:g} is not {SHORTEST_S:g} to {LONGEST_S:g}")
    if not RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
        raise InputError(f"rate: {rate_hz:g} is not {RATES_HZ[0]:g} to {RATES_HZ[1]:g} per second")
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"seed: {seed} is not 0 to {LARGEST_SEED}")


def _wait(
    running: Mapping[str, subprocess.Popen[bytes]], seconds: float | None, progress: Progress
) -> bool:
    """Wait for the virtual cell to end; False where a node did not answer it."""
    start_s = time.monotonic()
    while True:
        for name, process in running.items():
            code = process.poll()
            if code in (0, UNANSWERED) and name == SIMULATOR_NODE.name:
                return code == 0
            if code is not None:
                raise InputError(f"cell: node {name} ended with code {code}")
        elapsed_s = time.monotonic() - start_s
        if seconds is not None:
            if elapsed_s > 2.0 * seconds + PATIENCE_S:
                raise InputError(f"cell: the motion is not over after {elapsed_s:.0f} s")
            progress(round(min(elapsed_s, seconds)), round(seconds))
        time.sleep(LOOK_EVERY_S)


@contextmanager
def _processes(
    nodes: Sequence[NodeEntry], tell_killed: Tell
) -> Iterator[Mapping[str, subprocess.Popen[bytes]]]:
    """Start nodes; end them in any case, first asked and then forced, which is told by name.

    The recorder ends last, so that it hears what the others say until they end.
    """
    environment = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % DOMAINS),
        **os.environ,
        PARENT_PID: str(os.getpid()),
    }
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for node in nodes:
            # In a session of their own: an interrupt reaches them once, from here.
            running[node.name] = subprocess.Popen(
                node.command(), env=environment, start_new_session=True
            )
        yield running
    finally:
        for last in (False, True):
            ending = {n: each for n, each in running.items() if (n == RECORDER_NODE.name) is last}
            for name in _end(ending):
                tell_killed(name)


def _end(processes: Mapping[str, subprocess.Popen[bytes]]) -> list[str]:
    """Ask processes to end, force those that have not after one patience for all; name these."""
    for process in processes.values():
        process.terminate()
    end_s = time.monotonic() + END_PATIENCE_S
    killed = []
    for name, process in processes.items():
        try:
            process.wait(max(end_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed.append(name)
    return killed
