"""What correction buys on the true error: `python bench/ros_closed_loop.py [MODEL]`.

The commands of the corrector drive a wrist that is made of the same table, at random poses of the
operative workspace under random forces.  Printed are the pointing error (RMS, mdeg) before and
after, the floor that rounding to encoder steps makes alone, and the shift of O before and after
the Cartesian manipulator has taken the residual.
"""

from __future__ import annotations

import sys

import numpy as np

from wrist_stiffness.compensation.belief import SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.mechanism.components import Array
from wrist_stiffness.model.error_model import ErrorModel, Load
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

POSES = 300
FORCES_N = (0.2, 1.0, 3.0)
NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000
COMMANDS_PER_POSE = 30


def corrected(stream: CorrectionStream, stamp_ns: int, theta: Array, force: Array) -> Array:
    """Return the settled command (2,) and the residual (6,) of one pose as one row."""
    for i in range(COMMANDS_PER_POSE):
        now_ns = stamp_ns + i * SECOND // 10
        stream.loads.add(now_ns, "wrist_base", force.tolist(), (0.0, 0.0, 0.0))
        command = stream.on_command(now_ns, "", NAMES, theta.tolist())
    if command.correction is None:
        raise SystemExit(f"no correction: {command.fault}")
    return np.concatenate([command.theta, command.correction.after])


def main() -> None:
    """Print the table."""
    path = sys.argv[1] if len(sys.argv) > 1 else shipped_file("config/palmieri2015_model.yaml")
    model = load_model(path)
    print("force  drive     before   after   floor   useless   s before   s after residual")
    print("  [N]            [mdeg]  [mdeg]  [mdeg]   [poses]       [um]               [um]")
    for force in FORCES_N:
        run(model, force)


def run(model: ErrorModel, newtons: float) -> None:
    """Print the lines of one force."""
    rng = np.random.default_rng(1)
    lower, upper = model.table.workspace.rectangle
    theta = rng.uniform(lower, upper, (4 * POSES, 2))
    theta = theta[model.table.workspace.operative(theta)][:POSES]
    force = rng.normal(size=(len(theta), 3))
    force *= newtons / np.linalg.norm(force, axis=1)[:, None]
    step = model.table.geometry.limits.encoder_step
    normal = model.table.geometry.platform.normal

    def pose(angles: Array, load: Array) -> tuple[Array, Array]:
        prediction = model.predict(angles, Load(np.concatenate([load, np.zeros(3)])))
        rotation, shift = prediction.motion
        return rotation @ prediction.configuration.platform @ normal, shift

    for drive, play in (("ideal", 0.0), ("encoder", 0.15)):
        settings = StreamSettings(supervisor=SupervisorSettings(follow=True))
        safety = settings.safety
        settings = StreamSettings(
            supervisor=settings.supervisor, safety=type(safety)(slew=1.0, deadband_steps=play)
        )
        stream = CorrectionStream(model, settings, enabled=True)
        before, after, floor, shifts, left = [], [], [], [], []
        for i, (angles, load) in enumerate(zip(theta, force, strict=True)):
            found = corrected(stream, (i + 1) * 10 * SECOND, angles, load)
            wanted = model.table.mechanism.forward(angles).platform @ normal
            rounded = angles if drive == "ideal" else step * np.round(angles / step)
            driven = found[:2] if drive == "ideal" else step * np.round(found[:2] / step)
            normal_before, shift_before = pose(rounded, load)
            normal_after, shift_after = pose(driven, load)
            rigid = model.table.mechanism.forward(rounded).platform @ normal
            before.append(np.linalg.norm(np.cross(normal_before, wanted)))
            after.append(np.linalg.norm(np.cross(normal_after, wanted)))
            floor.append(np.linalg.norm(np.cross(rigid, wanted)))
            shifts.append(np.linalg.norm(shift_before))
            left.append(np.linalg.norm(shift_after - found[2:5]))
        useless = int(np.sum(np.array(after) >= np.array(before)))

        def rms(values: list[float], scale: float) -> float:
            return scale * float(np.sqrt(np.mean(np.square(values))))

        mdeg = 1e3 * float(np.degrees(1.0))
        print(
            f"{newtons:5.1f}  {drive:8} {rms(before, mdeg):7.3f} {rms(after, mdeg):7.3f} "
            f"{rms(floor, mdeg):7.3f} {useless:6d}/{len(theta)} {rms(shifts, 1e6):10.3f} "
            f"{rms(left, 1e6):15.4f}"
        )


if __name__ == "__main__":
    main()
