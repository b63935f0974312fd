"""Cost of the core path per sample: `python bench/ros_core_path.py [MODEL]`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from wrist_stiffness.compensation.contact_policy import ContactSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.pose import pose_of_twist
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.lookup.response import respond
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

NAMES = ("motor_1_joint", "motor_2_joint")
SAMPLES = 500
ROUNDS = 7


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
    settings = StreamSettings(contact=ContactSettings("gain", gain=1.0))
    predicting = PredictionStream(model, settings)
    correcting = CorrectionStream(model, settings, enabled=True)
    for stream in (predicting, correcting):
        stream.loads.add(1, "wrist_base", load.wrench[:3].tolist(), load.wrench[3:].tolist())
    configurations = [table.workspace.configuration(each) for each in theta]
    operators = [table.operators_at(each) for each in configurations]
    twist = model.predict(theta[0], load).twist
    lines = {
        "kinematics and domain": lambda i: table.workspace.configuration(theta[i]),
        "operators": lambda i: table.operators_at(configurations[i]),
        "contact and response": lambda i: respond(operators[i], load.wrench),
        "model.predict": lambda i: model.predict(theta[i], load),
        "predict a sample": lambda i: predicting.on_joint_state(i + 2, NAMES, theta[i].tolist()),
        "correct a command": lambda i: correcting.on_command(i + 2, "", NAMES, theta[i].tolist()),
        "pose of the twist": lambda i: pose_of_twist(twist),
    }
    for name, step in lines.items():
        print(f"{name:24} {microseconds(step):8.1f} us")


if __name__ == "__main__":
    main()
