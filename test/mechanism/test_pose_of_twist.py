import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.mechanism.rigid_motion import pose_of_twist
from wrist_stiffness.mechanism.vectors import screws_to_origin


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-5, 0.1, 2.0])
def test_quaternion_is_that_of_the_rotation_vector(angle):
    vector = angle * np.array([0.6, 0.0, -0.8])
    position, quaternion = pose_of_twist(np.append([0.0, 0.0, 0.0], vector))
    wanted = Rotation.from_rotvec(vector).as_quat(canonical=True)
    assert np.allclose(quaternion, wanted, rtol=1e-14, atol=1e-16)
    assert position.tolist() == [0.0, 0.0, 0.0]


def test_a_pure_shift_is_the_position():
    position, quaternion = pose_of_twist(np.array([1e-5, -2e-5, 3e-5, 0.0, 0.0, 0.0]))
    assert position.tolist() == [1e-5, -2e-5, 3e-5]
    assert quaternion.tolist() == [0.0, 0.0, 0.0, 1.0]


def test_another_point_moves_by_the_rotation_too():
    twist = np.array([1e-3, -2e-3, 5e-4, 0.1, -0.2, 0.3])
    point = np.array([0.01, 0.05, -0.02])
    position, quaternion = pose_of_twist(screws_to_origin(-point) @ twist)
    shift, _ = pose_of_twist(twist)
    turned = Rotation.from_rotvec(twist[3:]).apply(point)
    assert np.allclose(position, turned + shift - point, rtol=1e-12)
    assert np.allclose(quaternion, Rotation.from_rotvec(twist[3:]).as_quat())
