"""The shipped wrist and its measurements, for the tests of several rooms.

A small recording of a known wrist in known motion is built in code and changed by each test.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.identification.wrist_fit import WristFit
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.inference import Observations
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.recording import RecordingWriter
from wrist_stiffness.recording.messages import (
    Float64,
    Header,
    JointState,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    Quaternion,
    String,
    Temperature,
    Vector3,
    Wrench,
    WrenchStamped,
)
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import QUANTITIES
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import SENSED, CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import instrument

START_NS = 1_700_000_000_000_000_000
MILLISECOND = 1_000_000
MOTORS = ("motor_1_joint", "motor_2_joint")

SCATTER = np.repeat([1e-6, 1e-4], 3)
"""Of each component of a dwell in a table made by hand [m, rad]."""

POSE_SCATTER = np.repeat([1e-6, np.radians(2e-3)], 3)
"""Of each component of poses that are measured one by one [m, rad]."""


def pose_of(rotation, shift):
    quaternion = Rotation.from_matrix(rotation).as_quat().tolist()
    return Pose(Point(*np.asarray(shift).tolist()), Quaternion(*quaternion))


def random_poses(rng, n, force, moment=0.01):
    """Return poses one by one, each under a load of its own [N], [N m]."""
    theta = np.radians(rng.uniform(-30.0, 30.0, (n, 2)))
    load = rng.normal(size=(n, 6)) * np.repeat([force, moment], 3)
    return Block(2.0 * np.arange(n), theta, load)


def measured_in(model, block, rng, hidden_counts=False, **more):
    """Return a session in which the wrist is the model; hidden counts turn its encoders."""
    scattered = model.batch(block).measured + rng.normal(size=(len(block), 6)) * POSE_SCATTER
    rotation, shift = exp_twist(scattered)
    theta = block.theta
    if hidden_counts:
        step = model.table.geometry.limits.encoder_step
        theta = theta + step * rng.uniform(-0.5, 0.5, theta.shape)
    rotation = rotation @ model.table.mechanism.forward(theta).platform
    return MeasuredSession("day", block, shift, rotation, np.diag(POSE_SCATTER**2), **more)


@dataclass
class Campaign:
    """Eight seconds: joint states every 10 ms, loads every 10 ms, poses 5 ms after each of them.

    Motor 1 swings by 20 deg in 4 s, motor 2 by 15 deg in 2.7 s; 1 N and more pulls down.
    """

    mechanism: object
    count: int = 800
    frame_id: str = "wrist_base"
    entries: list = field(default_factory=list)

    def theta(self, time_ns):
        """Motor angles (n, 2) at stamps [rad]."""
        t = 1e-9 * (np.asarray(time_ns) - START_NS)
        swing = np.stack([20 * np.sin(2 * np.pi * t / 4), 15 * np.sin(2 * np.pi * t / 2.7)], -1)
        return np.radians(swing)

    def rigid(self, time_ns):
        """Rotation U -> F (n, 3, 3) at stamps."""
        return self.mechanism.forward(self.theta(time_ns)).platform

    @property
    def joint_ns(self):
        return START_NS + 10 * MILLISECOND * np.arange(self.count)

    @property
    def pose_ns(self):
        return self.joint_ns[:-1] + 5 * MILLISECOND

    def add(self, topic, stamp_ns, message):
        self.entries.append((topic, int(stamp_ns), message))

    def with_joints(self, names=MOTORS, **others):
        for stamp, angles in zip(self.joint_ns, self.theta(self.joint_ns), strict=True):
            state = JointState(Header(int(stamp), ""), names, tuple(angles.tolist()), **others)
            self.add("/joint_states", stamp, state)
        return self

    def with_loads(self, frame_id="wrist_base", force=lambda i: (0.0, 0.0, -1.0 - 0.005 * i)):
        for i, stamp in enumerate(self.joint_ns):
            wrench = Wrench(Vector3(*force(i)), Vector3())
            self.add("/load_estimate", stamp, WrenchStamped(Header(int(stamp), frame_id), wrench))
        return self

    def with_poses(self, shift=None, rotation=None, stamps=None, late_ns=0):
        """Poses of the rigid wrist unless they are given; stamped late where asked."""
        stamps = self.pose_ns if stamps is None else stamps
        rotation = self.rigid(stamps) if rotation is None else rotation
        shift = np.zeros((len(stamps), 3)) if shift is None else shift
        for stamp, turned, moved in zip(stamps, rotation, shift, strict=True):
            header = Header(int(stamp) + late_ns, self.frame_id)
            message = PoseStamped(header, pose_of(turned, moved))
            self.add("/platform_pose_measured", stamp, message)
        return self

    def with_markers(self, points):
        for stamp, places in zip(self.pose_ns, points, strict=True):
            poses = tuple(Pose(Point(*place)) for place in places.tolist())
            header = Header(int(stamp), self.frame_id)
            self.add("/platform_markers_measured", stamp, PoseArray(header, poses))
        return self

    def with_temperature(self, component, stamp_ns, value):
        self.add("/temperatures", stamp_ns, Temperature(Header(int(stamp_ns), component), value))
        return self

    def with_covariate(self, name, stamp_ns, value):
        self.add(f"/covariates/{name}", stamp_ns, Float64(value))
        return self

    def with_note(self, text):
        self.add("/recording_notes", START_NS, String(text))
        return self

    def written(self, path: Path) -> Path:
        with RecordingWriter(path) as writer:
            for topic, stamp, message in sorted(self.entries, key=lambda entry: entry[1]):
                writer.write(topic, message, stamp)
        return path


@pytest.fixture(scope="session")
def table():
    return load_table(shipped_file("precomputed/palmieri2015.npz"))


@pytest.fixture(scope="session")
def model():
    return load_model(shipped_file("config/palmieri2015_model.yaml"))


def problem_of_a_wrist_that_misses_something(model, *units):
    """Return the problem as `WristProblem` would, without asking whether a valley leads to noise.

    None does, and what that search finds is thrown away.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WristFit, "rough", False)
        return WristProblem(model, units)


def wrong_wrist(seconds, program_seed, base_seed, rate_hz=10.0, **more):
    """Return settings of the cell with a wrist that is off its drawing."""
    return CellSettings(
        rate_hz=rate_hz,
        program_seconds=seconds,
        program_seed=program_seed,
        base="wrong",
        base_seed=base_seed,
        **more,
    )


@pytest.fixture(scope="session")
def in_the_cell():
    """Return a function of a table, settings and a seed: one run of the virtual cell's program."""

    def session(table, settings, seed, **more):
        cell = VirtualCell(table, settings, np.random.default_rng(seed))
        time = np.arange(round(settings.rate_hz * settings.program_seconds)) / settings.rate_hz
        sample = cell.run(time, cell.desired(time))
        warm = {name: sample.temperature[:, place] for place, name in enumerate(SENSED)}
        return MeasuredSession(
            "a session",
            Block(time, sample.encoder, sample.wrench, sample.speed, temperatures=warm),
            sample.measured_shift,
            sample.measured_rotation,
            np.diag(instrument(settings.instrument).sigma ** 2),
            **more,
        )

    return session


@pytest.fixture
def campaign(table):
    """An empty one; a test adds what it needs."""
    return Campaign(table.mechanism)


def _dwells(rng, change=None, n=400):
    """Random dwells three seconds apart: 1 um and 0.1 mrad of noise in each component."""
    force, moment = rng.normal(0, 0.6, (n, 3)), rng.normal(0, 0.01, (n, 3))
    force[::10], moment[::10] = 0.0, 0.0
    conditions = {
        **{f"theta_{motor}": rng.uniform(-0.8, 0.8, n) for motor in (1, 2)},
        **{f"approach_{motor}": rng.choice([-1.0, 1.0], n) for motor in (1, 2)},
        **{f"speed_{motor}": np.zeros(n) for motor in (1, 2)},
        **dict(zip(("fx", "fy", "fz"), force.T, strict=True)),
        **dict(zip(("mx", "my", "mz"), moment.T, strict=True)),
        "force": np.linalg.norm(force, axis=1),
        "moment": np.linalg.norm(moment, axis=1),
        "held_s": rng.uniform(0.5, 20, n),
        "loaded_at_rest": rng.integers(0, 2, n).astype(float),
        "time_s": 3.0 * np.arange(n),
        "T_link_1": 20 + 5 * (1 - np.exp(-np.arange(n) / 150)),
        "humidity": rng.uniform(30, 70, n),
    }
    values = SCATTER * rng.normal(size=(n, 6))
    if change is not None:
        values = values + change(conditions)
    return Observations(
        values,
        conditions,
        np.diag(SCATTER**2),
        conditions["time_s"],
        np.zeros(n, dtype=int),
        quantities=QUANTITIES,
    )


@pytest.fixture(scope="session")
def dwells():
    """Return the function that makes a table of random dwells."""
    return _dwells
