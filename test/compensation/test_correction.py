from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.correction import UNCHECKED, correct, residual_twist
from wrist_stiffness.compensation.objective import OBJECTIVES, Objective
from wrist_stiffness.errors import LoadRangeError, SingularPoseError, UnreachablePoseError
from wrist_stiffness.model.error_model import ErrorModel, Load

FIXED_POINT = 1e-9  # rad; the search ends at steps of 1e-10 rad
PLAY = 4e-5  # rad; 0.15 encoder steps
FORCE, MOMENT = 1.0, 0.03


def corrected(model, theta, load, objective):
    return correct(
        lambda angles: model.predict(angles, load), model.table.workspace, theta, objective
    )


def random_cases(model, count, seed=3):
    rng = np.random.default_rng(seed)
    lower, upper = model.table.workspace.rectangle
    for _ in range(count):
        wrench = rng.normal(size=6) * np.repeat([FORCE, MOMENT], 3) / np.sqrt(3.0)
        yield 0.6 * rng.uniform(lower, upper), Load(wrench, bool(rng.integers(2)))


def actual_pose(model, theta, load):
    """Return rotation and shift of the platform by composing the parts, without `correction`."""
    prediction = model.predict(theta, load)
    bent = Rotation.from_rotvec(prediction.twist[3:]).as_matrix()
    return bent @ model.table.mechanism.forward(theta).platform, prediction.motion[1]


@pytest.mark.parametrize("seed", range(3))
def test_the_normal_points_where_it_was_commanded(model, objective, seed):
    normal = model.table.geometry.platform.normal
    for theta, load in random_cases(model, 20, seed):
        correction = corrected(model, theta, load, objective("pointing"))
        wanted = model.table.mechanism.forward(theta).platform @ normal
        before = actual_pose(model, theta, load)[0] @ normal
        after = actual_pose(model, theta + correction.delta, load)[0] @ normal
        assert np.linalg.norm(np.cross(after, wanted)) < FIXED_POINT
        assert np.linalg.norm(np.cross(before, wanted)) > 1e3 * FIXED_POINT


def test_the_bound_of_the_search_holds_where_it_converges_slowly(make_table, objective):
    soft = ErrorModel("soft", make_table(softness=300.0), "closed_form")
    normal = soft.table.geometry.platform.normal
    for theta, load in random_cases(soft, 20):
        correction = corrected(soft, theta, load, objective("pointing"))
        wanted = soft.table.mechanism.forward(theta).platform @ normal
        after = actual_pose(soft, theta + correction.delta, load)[0] @ normal
        assert np.linalg.norm(np.cross(after, wanted)) < FIXED_POINT


@pytest.mark.parametrize("name", ["orientation", "tool_point"])
def test_no_small_change_of_the_angles_is_better(model, objective, name):
    def size(theta, load, wanted):
        rotation, shift = actual_pose(model, theta, load)
        if name == "tool_point":
            point = objective(name).tool_point
            return np.linalg.norm(rotation @ point + shift - wanted @ point)
        return Rotation.from_matrix(rotation @ wanted.T).magnitude()

    for theta, load in random_cases(model, 10):
        correction = corrected(model, theta, load, objective(name))
        wanted = model.table.mechanism.forward(theta).platform
        best = size(theta + correction.delta, load, wanted)
        assert best < size(theta, load, wanted)
        change = 0.05 * np.max(np.abs(correction.delta))
        for direction in ([1, 0], [-1, 0], [0, 1], [0, -1]):
            moved = theta + correction.delta + change * np.array(direction)
            assert best < size(moved, load, wanted)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_objective_is_the_derivative_of_the_task(model, objective, name):
    rng = np.random.default_rng(5)
    configuration = model.table.mechanism.forward(np.array([0.3, -0.2]))
    twist = 1e-6 * rng.normal(size=6)
    moved = Rotation.from_rotvec(twist[3:]).as_matrix() @ configuration.platform
    task = objective(name).matrix(configuration) @ twist
    if name == "pointing":
        normal = objective(name).normal
        change = np.linalg.norm((moved - configuration.platform) @ normal)
        assert np.linalg.norm(task) == pytest.approx(change, rel=1e-5)
    elif name == "orientation":
        assert np.allclose(task, twist[3:], rtol=1e-12)
    else:
        point = objective(name).tool_point
        change = (moved - configuration.platform) @ point + twist[:3]
        assert np.allclose(task, change, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_motors_cancel_the_task_by_least_squares(model, objective, name):
    mechanism = model.table.mechanism
    for theta, _ in random_cases(model, 10):
        configuration = mechanism.forward(theta)
        jacobian = mechanism.jacobian(configuration)
        task = objective(name).matrix(configuration)
        wanted = np.linalg.pinv(task[:, 3:] @ jacobian) @ task
        found = objective(name).cancelling(configuration, jacobian)
        assert np.allclose(found, wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


def test_motors_stay_where_they_do_not_reach_the_task(model):
    """A tool point at O moves with neither motor; along motor 2's axis it moves with one."""
    mechanism = model.table.mechanism
    configuration = mechanism.forward(np.zeros(2))
    jacobian = mechanism.jacobian(configuration)
    normal = model.table.geometry.platform.normal
    for point in (np.zeros(3), 0.05 * jacobian[:, 1]):
        goal = Objective("tool_point", normal, point)
        task = goal.matrix(configuration)
        wanted = np.linalg.pinv(task[:, 3:] @ jacobian) @ task
        assert np.allclose(goal.cancelling(configuration, jacobian), wanted, rtol=0.0, atol=1e-9)


def test_residuals_are_actual_minus_desired(model, objective):
    theta, load = next(random_cases(model, 1))
    correction = corrected(model, theta, load, objective("pointing"))
    wanted = model.table.mechanism.forward(theta).platform
    rotation, shift = actual_pose(model, theta + correction.delta, load)
    turn = Rotation.from_rotvec(correction.after[3:]).as_matrix()
    assert np.allclose(turn, rotation @ wanted.T, atol=1e-14)
    # Half of the rotation acts on the shift: 1e-4 rad times 1e-5 m.
    assert np.allclose(correction.after[:3], shift, atol=1e-8)


@pytest.mark.parametrize(
    ("share", "predictions"),
    [(-0.01, 1), (0.9 * UNCHECKED, 1), (10.0 * UNCHECKED, 2)],
    ids=["inside", "a small step", "a large step"],
)
def test_a_step_that_is_small_next_to_the_play_costs_one_prediction(
    model, objective, share, predictions
):
    pointing, mechanism = objective("pointing"), model.table.mechanism
    for theta, load in random_cases(model, 20):
        tried = []

        def predict(angles, load=load, tried=tried):
            tried.append(angles)
            return model.predict(angles, load)

        exact = corrected(model, theta, load, pointing).delta
        held = exact + np.array([1.0, -1.0]) * (1.0 + share) * PLAY
        found = correct(predict, model.table.workspace, theta, pointing, held, PLAY)
        assert len(tried) == predictions
        desired = mechanism.forward(theta)
        left = pointing.cancelling(desired, mechanism.jacobian(desired)) @ residual_twist(
            model.predict(theta + found.delta, load), desired.platform
        )
        if share < 0.0:
            assert np.array_equal(found.delta, held)
        else:
            # The error of this wrist changes by less than 1e-2 of a step.
            assert np.allclose(np.abs(left), PLAY, rtol=0.0, atol=1e-2 * share * PLAY)


def test_a_load_in_the_platform_frame_turns_with_the_platform(model, objective):
    theta = np.array([0.3, -0.4])
    wrench = np.array([0.4, -0.7, 0.2, 0.01, 0.0, -0.02])
    turn = model.table.mechanism.forward(theta).platform
    in_base = Load(np.concatenate([turn @ wrench[:3], turn @ wrench[3:]]))
    on_platform = Load(wrench, on_platform=True)
    assert np.allclose(
        model.predict(theta, in_base).twist, model.predict(theta, on_platform).twist, rtol=1e-12
    )
    moved = theta + 0.2
    assert not np.allclose(
        model.predict(moved, in_base).twist, model.predict(moved, on_platform).twist, rtol=1e-3
    )


@pytest.mark.parametrize(
    ("theta", "wrench", "error"),
    [
        ([2.0, 0.0], [0, 0, -1.0, 0, 0, 0], UnreachablePoseError),
        ([0.0, 0.0], [0, 0, -6.0, 0, 0, 0], LoadRangeError),
        ([0.0, 0.0], [0, 0, 0, 0, 0.2, 0], LoadRangeError),
    ],
)
def test_outside_of_the_table_nothing_is_corrected(model, objective, theta, wrench, error):
    with pytest.raises(error):
        corrected(
            model, np.array(theta), Load(np.array(wrench, dtype=float)), objective("pointing")
        )


def test_a_singular_pose_is_refused(make_table, objective):
    table = make_table()
    header = replace(table.header, geometry=dict(table.header.geometry))
    header.geometry["limits"] = {**header.geometry["limits"], "singularity": 0.9}
    strict = ErrorModel("strict", replace(table, header=header), "closed_form")
    with pytest.raises(SingularPoseError, match="below the limit 0.9"):
        corrected(strict, np.array([0.8, 0.0]), Load(np.zeros(6)), objective("pointing"))
