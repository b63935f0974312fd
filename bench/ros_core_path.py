"""Cost of the core path per sample: `python bench/ros_core_path.py [MODEL]`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from itertools import count

import numpy as np

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction import Correction, correct, residual_twist
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.objective import Objective
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.model.error_model import Load, Prediction
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.ros.stream_messages import (
    JointSample,
    error_payload,
    joint_payload,
    joint_reader,
)
from wrist_stiffness.shipped import shipped_file

NAMES = ("motor_1_joint", "motor_2_joint")
SAMPLES = 500
ROUNDS = 7
MICROSECOND = 1_000


def microseconds(step: Callable[[int], object]) -> float:
    """Return the processor time of a step, the best of several rounds."""
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.process_time()
        for i in range(SAMPLES):
            step(i)
        best = min(best, time.process_time() - start)
    return 1e6 * best / SAMPLES


def main() -> None:
    """Print the split."""
    path = sys.argv[1] if len(sys.argv) > 1 else shipped_file("config/palmieri2015_model.yaml")
    model = load_model(path)
    table = model.table
    second = 1e-3 * np.arange(SAMPLES)
    theta = 0.6 * np.stack([np.sin(2.0 * np.pi * second), np.cos(3.0 * np.pi * second)], axis=1)
    load = Load(np.array([0.3, -0.2, -0.8, 0.005, 0.0, -0.01]))
    settings = StreamSettings(supervisor=SupervisorSettings(follow=True))
    predicting = PredictionStream(model, settings)
    correcting = CorrectionStream(model, settings, enabled=True)
    for stream in (predicting, correcting):
        stream.loads.add(1, "wrist_base", load.wrench[:3].tolist(), load.wrench[3:].tolist())
    configurations = [table.workspace.configuration(each) for each in theta]
    predictions = [model.predict(each, load) for each in theta]
    objective = Objective("pointing", table.geometry.platform.normal, np.zeros(3))
    jacobian = table.mechanism.jacobian(configurations[0])
    read, covariance = joint_reader(), predictions[0].covariance
    state = joint_payload(JointSample(1, "", NAMES, tuple(theta[0].tolist()), (), ()))
    # Models with a memory refuse a stamp before the last one.
    clock = count(2, MICROSECOND)
    unlike = np.random.default_rng(0).permutation(SAMPLES)

    compiled = model.compiled
    if compiled is None:
        raise SystemExit("this model has no compiled form here: no C compiler at installation?")

    def guess(i: int) -> np.ndarray:
        return predictions[i - 1].active

    def predict(i: int) -> Prediction:
        return model.predict(theta[i], load, guess(i))

    def correction(i: int) -> Correction:
        return correct(
            lambda angles: model.predict(angles, load, guess(i)),
            table.workspace,
            theta[i],
            objective,
        )

    lines = {
        "kinematics and domain": lambda i: table.workspace.configuration(theta[i]),
        "response with contact": lambda i: compiled.respond(
            configurations[i], load.wrench, guess(i)
        ),
        "model.predict": predict,
        "  of an unlike pose before": lambda i: model.predict(
            theta[unlike[i]], load, predictions[i].active
        ),
        "covariance of the table": lambda i: model.table_covariance(
            configurations[i], predictions[i].twist
        ),
        "predict a sample": lambda i: predicting.on_joint_state(
            next(clock), NAMES, theta[i].tolist()
        ),
        "what cancels the task": lambda i: objective.cancelling(configurations[i], jacobian),
        "residual twist": lambda i: residual_twist(predictions[i], configurations[i].platform),
        "fixed point in Python": correction,
        "correct a command": lambda i: correcting.on_command(
            next(clock), "", NAMES, theta[i].tolist()
        ),
        "joint state from bytes": lambda i: read(state),
        "pose error to bytes": lambda i: error_payload(i, predictions[i].twist, covariance),
        "pose of the twist": lambda i: pose_of_twist(predictions[i].twist),
        "general operators, response": lambda i: respond(
            table.operators_at(configurations[i]), load.wrench
        ),
    }
    print(f"smallest matrix product {microseconds(lambda i: jacobian.T.dot(jacobian)):14.2f} us")
    for name, step in lines.items():
        print(f"{name:28} {microseconds(step):8.1f} us")


if __name__ == "__main__":
    main()
