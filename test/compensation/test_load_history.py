import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.compensation.intake import Frames
from wrist_stiffness.compensation.load_history import LoadHistory
from wrist_stiffness.compensation.payload import Thresholds
from wrist_stiffness.errors import InputError, StaleLoadError
from wrist_stiffness.model.error_model import Load

SECOND = 1_000_000_000
AGE_LIMIT_S = 0.5
LIMIT = Thresholds(0.05, 0.002)


def load_of(value, on_platform=False):
    return Load(np.full(6, float(value)), on_platform)


# Within the age limit of each other, so that no clock jump is seen.
stamps = st.integers(SECOND, SECOND + SECOND // 2)


@given(st.lists(stamps, min_size=1, max_size=30), st.integers(SECOND // 2, 3 * SECOND))
def test_the_newest_load_that_is_not_younger_belongs_to_a_joint_state(arriving, asked):
    history = LoadHistory(AGE_LIMIT_S, Frames())
    last = {}
    for value, stamp in enumerate(arriving):
        history.keep(stamp, load_of(value))
        last[stamp] = value
    older = [stamp for stamp in arriving if stamp <= asked]
    if older and asked - max(older) <= SECOND // 2:
        found, load = history.at(asked)
        assert found == max(older)
        assert load.wrench[0] == last[max(older)]
    else:
        with pytest.raises(StaleLoadError):
            history.at(asked)


@given(st.permutations(range(8)))
def test_arrival_order_does_not_matter(order):
    history = LoadHistory(AGE_LIMIT_S, Frames())
    for i in order:
        history.keep(SECOND + i, load_of(i))
    assert [history.at(SECOND + i)[1].wrench[0] for i in range(8)] == list(range(8))


def test_a_stale_load_is_named_with_age_and_limit():
    history = LoadHistory(AGE_LIMIT_S, Frames())
    history.keep(SECOND, load_of(1))
    with pytest.raises(StaleLoadError, match=r"1\.250 s older.*limit 0\.5 s"):
        history.at(2 * SECOND + SECOND // 4)


def test_loads_that_come_too_late_for_their_joint_state_are_counted():
    # load stamps      10       12   13
    # joint state          11           14
    # arrival: 10, ask 11, 12, ask 14, 13 (late), 15
    history = LoadHistory(AGE_LIMIT_S, Frames())
    history.keep(10, load_of(10))
    history.at(11)
    history.keep(12, load_of(12))
    assert history.late == 0
    history.at(14)
    history.keep(13, load_of(13))
    assert history.late == 1
    history.keep(15, load_of(15))
    assert history.late == 1


def test_after_the_clock_jumped_back_old_loads_are_forgotten():
    history = LoadHistory(AGE_LIMIT_S, Frames())
    for i in range(10):
        history.keep(100 * SECOND + i, load_of(1))
    history.keep(2 * SECOND, load_of(2))
    assert history.at(2 * SECOND)[1].wrench[0] == 2
    assert len(history.since(0, 10**12)) == 1


def test_memory_is_bounded_and_the_newest_stay():
    history = LoadHistory(AGE_LIMIT_S, Frames())
    for i in range(3 * LoadHistory.CAPACITY):
        history.keep(i, load_of(i))
    assert len(history.since(0, 10**12)) == LoadHistory.CAPACITY
    assert history.at(3 * LoadHistory.CAPACITY)[1].wrench[0] == 3 * LoadHistory.CAPACITY - 1


def intake():
    return LoadHistory(AGE_LIMIT_S, Frames())


def tare(loads):
    loads.zero = loads.measured_zero(LIMIT)
    return loads.zero.load.wrench


def test_tare_takes_the_mean_of_the_last_second_as_zero():
    loads = intake()
    loads.add(0, "wrist_base", [9.0, 0, 0], [0, 0, 0])
    for i in range(5):
        loads.add(2 * SECOND + i * SECOND // 10, "wrist_base", [2.0 + i % 2, 0, 0], [0, 0, 1.0])
    assert tare(loads).tolist() == pytest.approx([2.4, 0, 0, 0, 0, 1.0])
    _, load = loads.at(2 * SECOND + SECOND // 10)
    assert load.wrench.tolist() == pytest.approx([0.6, 0, 0, 0, 0, 0])


@settings(max_examples=25)
@given(
    hertz=st.floats(0.5, 2.0),
    phase=st.floats(0.0, 6.3),
    rate=st.sampled_from([50, 200]),
    couple=st.booleans(),
)
def test_tare_under_a_swinging_load_is_refused(hertz, phase, rate, couple):
    """Six thresholds of swing; a tenth of one is not worth a word."""
    limit = LIMIT.moment if couple else LIMIT.force
    for size in (6.0, 0.1):
        loads, wrench = intake(), np.zeros(6)
        for i in range(2 * rate):
            wrench[3 * couple] = size * limit * np.sin(2.0 * np.pi * hertz * i / rate + phase)
            loads.add(SECOND + i * SECOND // rate, "wrist_base", wrench[:3], wrench[3:])
        if size < 1.0:
            assert np.abs(tare(loads)).max() <= size * limit
            continue
        with pytest.raises(InputError, match="tare: the load moves by"):
            tare(loads)
        assert loads.zero is None


@settings(max_examples=25)
@given(seed=st.integers(0, 1000), rate=st.sampled_from([50, 200]), size=st.floats(0.0, 3.0))
def test_tare_of_a_noisy_sensor_is_no_swing(seed, rate, size):
    """Its thresholds grow with its noise instead."""
    noise = np.random.default_rng(seed).normal(size=(rate + 1, 6))
    loads = intake()
    for i, each in enumerate(size * noise * np.repeat(LIMIT, 3)):
        loads.add(SECOND + i * SECOND // rate, "wrist_base", each[:3], each[3:])
    tare(loads)


def test_tare_without_a_load_is_refused():
    with pytest.raises(StaleLoadError, match="no load estimate has arrived"):
        tare(intake())


def test_tare_of_mixed_frames_is_refused():
    loads = intake()
    loads.add(SECOND, "wrist_base", [0, 0, 0], [0, 0, 0])
    loads.add(SECOND + 1, "wrist_platform", [0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="mixed"):
        tare(loads)


def test_a_tare_in_another_frame_than_the_load_is_refused():
    loads = intake()
    loads.add(SECOND, "wrist_base", [1, 0, 0], [0, 0, 0])
    tare(loads)
    loads.add(2 * SECOND, "wrist_platform", [0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="another frame"):
        loads.at(2 * SECOND)
