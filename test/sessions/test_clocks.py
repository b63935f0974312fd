"""The stated uncertainty of a clock's offset is the scatter that it has."""

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.sessions.reading.clocks import clock_offset
from wrist_stiffness.sessions.reading.session import OWN_CLOCK_GAIN
from wrist_stiffness.sessions.reading.signals import Signal

NANOSECONDS = 1_000_000_000
NOISE = np.radians(0.02)


def turned(t):
    angles = np.radians([20.0, 15.0, 0.0]) * np.sin(
        2 * np.pi * t[:, None] / np.array([4.0, 2.7, 1.0])
    )
    return Rotation.from_euler("xyz", angles)


def test_stated_uncertainty_is_the_scatter_over_repetitions():
    rng = np.random.default_rng(12)
    own = np.arange(0.0, 40.0, 0.04)
    rigid = Signal((own * NANOSECONDS).astype(np.int64), turned(own).as_matrix())
    seen = np.arange(1.0, 39.0, 0.1)
    stamps = ((seen + 0.1) * NANOSECONDS).astype(np.int64)
    found = []
    for _ in range(12):
        noise = Rotation.from_rotvec(NOISE * rng.standard_normal((len(seen), 3)))
        found.append(clock_offset(stamps, (noise * turned(seen)).as_matrix(), rigid))
    scatter = np.std([each.seconds for each in found], ddof=1)
    stated = np.sqrt(np.mean([each.sigma**2 for each in found]))
    # Twelve repetitions tell the scatter to a fifth.
    assert 0.6 < stated / scatter < 1.7
    assert abs(np.mean([each.seconds for each in found]) - 0.1) < 4.0 * scatter / np.sqrt(12)


def test_rows_at_rest_alone_are_of_one_clock():
    """An offset that moves every motion into the holes between the rows explains none of it."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 40.0, 0.01)
    step, within = np.divmod(t, 2.0)
    t, pose = t[within > 0.45], step[within > 0.45]
    angles = np.radians(20.0 * rng.standard_normal((20, 3)))[pose.astype(int)]
    rigid = Signal((t * NANOSECONDS).astype(np.int64), Rotation.from_rotvec(angles).as_matrix())
    # A wrist off its drawing turns a little more than it should.
    noise = Rotation.from_rotvec(np.radians(0.005) * rng.standard_normal((len(t), 3)))
    seen = (noise * Rotation.from_rotvec(1.01 * angles)).as_matrix()
    found = clock_offset(rigid.time_ns, seen, rigid)
    assert abs(found.seconds) < 0.01 or found.gain < OWN_CLOCK_GAIN
