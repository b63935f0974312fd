import numpy as np
import pytest

from wrist_stiffness.diagnosis import (
    Candidate,
    Observations,
    Parameter,
    averaged,
    compress,
    dwell_groups,
)
from wrist_stiffness.errors import InputError

# time     0 1 2 3 4 5 6 7 8 9
# moving   # . . . # # . . . .     session changes at 8
MOVING = np.array([1, 0, 0, 0, 1, 1, 0, 0, 0, 0], bool)
SESSION = np.array([0, 0, 0, 0, 0, 0, 0, 0, 1, 1])


def samples():
    values = np.arange(10.0)[:, None] ** 2
    values[2] = np.nan
    return Observations(values, {"x": np.arange(10.0)}, session=SESSION)


def test_dwells_end_where_something_moves_or_the_session_changes():
    groups = dwell_groups(MOVING, SESSION, shortest=2)
    assert groups.tolist() == [-1, 0, 0, 0, -1, -1, 1, 1, 2, 2]


def test_short_dwells_are_dropped():
    assert dwell_groups(MOVING, SESSION, shortest=3).tolist() == [-1, 0, 0, 0] + 6 * [-1]


def test_units_are_means_of_what_was_measured():
    units = compress(samples(), dwell_groups(MOVING, SESSION, shortest=2))
    assert units.values[:, 0].tolist() == [5.0, 42.5, 72.5]
    assert units.covariate("x").tolist() == [2.0, 6.5, 8.5]
    assert units.session.tolist() == [0, 0, 1]
    assert units.samples.tolist() == [3, 2, 2]


def test_a_memory_effect_is_averaged_and_found_again_after_taking_units():
    def running_sum(table, shape):
        return np.cumsum(table.covariate("x"))[:, None, None]

    candidate = Candidate("memory", "part", (Parameter("size"),), running_sum)
    groups = dwell_groups(MOVING, SESSION, shortest=2)
    units = compress(samples(), groups)
    on_units = averaged(candidate, samples(), groups)
    expected = [np.mean([1, 3, 6]), np.mean([21, 28]), np.mean([36, 45])]
    assert on_units.evaluate(units, ())[:, 0, 0].tolist() == pytest.approx(expected)
    last = on_units.evaluate(units.take(np.array([2])), ())
    assert last[0, 0, 0] == pytest.approx(expected[2])
    with pytest.raises(InputError, match="averaged over other units"):
        on_units.evaluate(samples(), ())


def test_a_recording_that_never_rests_is_refused():
    with pytest.raises(InputError, match="never comes to rest"):
        compress(samples(), np.full(10, -1))


def test_a_unit_over_two_sessions_is_refused():
    with pytest.raises(InputError, match="unit 0 spans two sessions"):
        compress(samples(), np.zeros(10, dtype=int))
