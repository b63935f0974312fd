"""The virtual cell's messages, where its own motion does not reach."""

import numpy as np
from scipy.spatial.transform import Rotation

from wrist_stiffness.commands.simulate import write_samples
from wrist_stiffness.recording import RecordingWriter, open_recording, read_samples
from wrist_stiffness.simulation.cell import SENSED, CellSample


def test_a_quaternion_does_not_jump_while_the_platform_turns_far(tmp_path):
    """As a plot of the recording shows it: each sign of it means the same rotation."""
    count = 170
    turned = Rotation.from_rotvec(np.radians(np.arange(count))[:, None] * [[-0.6, 0.0, -0.8]])
    two, six = np.zeros((count, 2)), np.zeros((count, 6))
    shift, matrix = np.zeros((count, 3)), turned.as_matrix()
    warmth = np.zeros((count, len(SENSED)))
    block = CellSample(two, two, six, matrix, shift, matrix, shift, warmth)
    path = tmp_path / "turned.mcap"
    with RecordingWriter(path) as writer:
        stamps_ns = np.arange(1, count + 1)
        write_samples(writer, stamps_ns, two, block, np.zeros(count, dtype=bool), whole=True)
    said = read_samples(open_recording(path)).poses.quaternion
    assert np.linalg.norm(np.diff(said, axis=0), axis=1).max() < np.radians(0.51)
    np.testing.assert_allclose(Rotation.from_quat(said).as_matrix(), matrix, atol=1e-12)
