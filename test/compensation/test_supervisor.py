"""The supervisor of the load: what it believes, and that it lets no measured load through."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.compensation import supervisor as module
from wrist_stiffness.compensation.belief import State, SupervisorSettings
from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.payload import ENOUGH, Payload, Thresholds
from wrist_stiffness.compensation.scales import Scales
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.supervisor import LATE_S, Supervisor
from wrist_stiffness.compensation.trajectory_plan import planned_point
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.error_model import ErrorModel, Load

SECOND = 1_000_000_000
NAMES = ("motor_1_joint", "motor_2_joint")
REACH = np.radians(0.5)
HERE, THERE = np.array([0.1, -0.2]), np.array([-0.3, 0.25])
PART = Payload(0.2, (0.01, -0.02, 0.03))
NOTHING = np.zeros(6)
TRUST = SupervisorSettings().trust
MOTION = 1e-3  # rad, some encoder steps: such a motion may bring a contact
BROUGHT = 5e-5  # rad, of a correction by which the wall of a test is touched
AGREED = 1e-5  # N m, of thresholds of 2e-3: what the first guess of the centre leaves


class Cell:
    """Loads for a supervisor, with a correction that turns the platform by `turn`."""

    rate_hz = 100

    def __init__(self, table, settings=None, turn=(0.0, 0.0, 0.0)):
        self.table, self.settings = table, settings or SupervisorSettings()
        self.supervisor, self.turn = Supervisor(), np.array(turn)
        self.theta, self.stamp, self.states = HERE, SECOND, []
        self.corrected = NOTHING

    def rotation(self):
        return self.table.mechanism.forward(self.theta).platform

    def weight(self, payload):
        """Return the load of a payload by the definition of weight and moment (6,)."""
        force = payload.mass_kg * self.table.geometry.gravity
        return np.concatenate([force, np.cross(self.rotation() @ payload.centre_m, force)])

    def feel(self, seconds, load, theta=None, on_platform=False):
        """Let a load (6,), a payload, or a function of the share of the correction act."""
        self.theta = self.theta if theta is None else theta
        rotation = self.rotation()
        for _ in range(round(self.rate_hz * seconds)):
            self.stamp += SECOND // self.rate_hz
            acting = load
            if callable(load):
                acting = load(self.supervisor.supervision.share, self.corrected)
            if isinstance(load, Payload):
                acting = self.weight(load)
            wrench = np.asarray(acting, dtype=float)
            if on_platform:
                wrench = np.concatenate([rotation.T @ each for each in wrench.reshape(2, 3)])
            load_in_f = Load(wrench, on_platform).in_base(self.table.mechanism.forward(self.theta))
            scales = self.supervisor.scales(self.table.geometry)
            reading = scales.reading(load_in_f.tolist(), rotation.tolist())
            judged = self.supervisor.judge(
                self.stamp, self.theta.tolist(), reading, self.settings, REACH
            )
            self.corrected = np.zeros(6) if judged is None else np.array(judged)
            self.supervisor.share(self.turn)
            state = self.supervisor.supervision.state
            if [state] != self.states[-1:]:
                self.states.append(state)
        return self.supervisor.supervision


@pytest.fixture
def cell(table):
    return Cell(table)


def side(newtons, newton_metres=0.0):
    return np.array([newtons, 0.0, 0.0, 0.0, 0.0, newton_metres])


payloads = st.builds(
    Payload,
    st.floats(0.08, 0.45),
    st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
)
angles = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)).map(np.array)


@settings(max_examples=20)
@given(part=payloads, pose=angles, on_platform=st.booleans())
def test_pick_carry_and_release_are_recognised_from_the_load(table, part, pose, on_platform):
    cell = Cell(table)
    cell.feel(1.0, NOTHING, pose, on_platform)
    held = cell.feel(3.0, part, None, on_platform)
    assert (held.state, held.valid, held.told) == (State.HOLDING, True, False)
    assert held.payload.mass_kg == pytest.approx(part.mass_kg, rel=1e-9)
    assert np.allclose(cell.corrected, cell.weight(part), rtol=0.0, atol=AGREED)
    cell.feel(1.0, part, pose + [0.3, -0.3], on_platform)
    carried = cell.feel(1.0, part, pose + [-0.3, -0.2], on_platform)
    assert carried.valid
    # Three poses show all of the centre, as well as a reading of the moment is known.
    assert np.allclose(carried.payload.centre_m, part.centre_m, rtol=0.0, atol=2e-3)
    empty = cell.feel(2.0, NOTHING, None, on_platform)
    assert (empty.state, empty.payload, empty.valid) == (State.FREE, None, True)
    assert not cell.corrected.any()
    after = [State.FREE, State.UNSURE, State.HOLDING, State.RELEASED, State.FREE]
    assert cell.states == [State.UNSURE, *after]


wrenches = st.lists(
    st.tuples(
        st.floats(0.0, 2.0), st.tuples(*[st.floats(-3.0, 3.0)] * 3, *[st.floats(-0.1, 0.1)] * 3)
    ),
    max_size=6,
)


@settings(max_examples=20)
@given(loads=wrenches, part=st.none() | payloads)
def test_whatever_acts_only_a_weight_is_corrected_for(table, loads, part):
    """The loop of a contact stays open: no side force and no spin comes through."""
    cell = Cell(table)
    if part is not None:
        cell.feel(2.0, part)
    for seconds, load in loads:
        cell.feel(seconds, load)
        assert np.allclose(cell.corrected[[0, 1, 5]], 0.0, rtol=0.0, atol=AGREED)
        assert cell.corrected[2] <= 0.0


@settings(max_examples=20)
@given(noise=st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 6), min_size=1, max_size=50))
def test_noise_below_the_thresholds_changes_nothing(table, noise):
    cell, limit = Cell(table), SupervisorSettings().limit
    cell.feel(3.0, PART)
    before, scale = list(cell.states), np.repeat([limit.force, limit.moment], 3) / 3.0
    for each in noise:
        cell.feel(0.03, cell.weight(PART) + scale * each)
    assert cell.states == before
    assert np.allclose(cell.corrected, cell.weight(PART), rtol=0.0, atol=np.max(scale))


@pytest.mark.parametrize("rate_hz", [50, 200, 1000])
def test_a_payload_is_learned_by_time_and_not_by_the_number_of_readings(cell, rate_hz):
    """Readings within `LATE_S` may all be wrong by the same: together they count as one."""
    cell.rate_hz, heavier = rate_hz, Payload(1.01 * PART.mass_kg, PART.centre_m)
    cell.feel(1.0, PART)
    learned = cell.feel(0.5, heavier).payload.mass_kg / PART.mass_kg - 1.0
    # The mean over all its time: a third of it heavier.
    assert learned == pytest.approx(0.01 / 3.0, rel=0.1)
    cell.feel(ENOUGH * LATE_S, heavier)
    known = cell.supervisor.supervision.payload
    # As much as is enough: no further, so that a contact that grows slowly is not learned.
    heaviest = Payload(1.02 * PART.mass_kg, PART.centre_m)
    assert cell.feel(1.0, heaviest).payload.mass_kg == known.mass_kg


def test_a_payload_is_learned_less_where_a_motion_turns_the_load(table):
    """What a late load turns is turned by the same all along a motion."""
    learned = []
    for speed in (0.0, 0.5):
        cell = Cell(table)
        cell.feel(1.0, PART)
        for step in range(50):
            heavier = Payload(1.01 * PART.mass_kg, PART.centre_m)
            held = cell.feel(0.01, heavier, HERE + speed * step * 0.01)
        assert held.state is State.HOLDING
        learned.append(held.payload.mass_kg / PART.mass_kg - 1.0)
    assert 0.0 < learned[1] < 0.8 * learned[0]


@pytest.mark.parametrize("push", [side(0.3), side(0.0, 0.01)], ids=["force", "couple"])
def test_in_contact_the_payload_alone_is_corrected_for(cell, push):
    cell.feel(3.0, PART)
    cell.theta = HERE + MOTION
    told = cell.feel(1.0, cell.weight(PART) + push)
    assert (told.state, told.valid, bool(told.text)) == (State.IN_CONTACT, False, True)
    assert np.allclose(cell.corrected, cell.weight(PART), rtol=0.0, atol=MOTION * 0.2 * 9.81)
    assert told.share == 1.0
    assert cell.feel(0.3, PART).state is State.IN_CONTACT
    assert cell.feel(0.3, PART).state is State.HOLDING


@pytest.mark.parametrize("push", [side(0.3), side(0.0, 0.01)], ids=["force", "couple"])
def test_a_contact_that_no_motion_brought_may_have_taken_the_payload(cell, push):
    """Released under a ceiling, whose load is as large as that of the part."""
    cell.feel(3.0, PART)
    told = cell.feel(2.0, cell.weight(PART) + push)
    assert (told.state, told.payload, told.share) == (State.IN_CONTACT, None, 0.0)


def test_a_part_that_is_lost_in_contact_is_not_corrected_for(cell):
    cell.feel(3.0, PART)
    cell.theta = HERE + MOTION
    cell.feel(1.0, cell.weight(PART) + side(0.3))
    told = cell.feel(0.5, side(0.3))
    assert (told.state, told.payload) == (State.IN_CONTACT, None)


def test_in_contact_a_payload_stands_in_only_where_its_moment_is_known(cell):
    """Its centre along gravity shows at another pose; there the contact hides it."""
    cell.feel(3.0, PART)
    cell.theta = HERE + MOTION
    assert cell.feel(1.0, cell.weight(PART) + side(1.5)).payload is not None
    cell.theta = THERE
    assert cell.feel(1.0, cell.weight(PART) + side(1.5)).payload is None


def test_another_weight_is_corrected_for_only_when_it_has_settled(cell):
    light = replace(PART, mass_kg=0.1)
    cell.feel(3.0, PART)
    assert cell.feel(0.3, light).state is State.UNSURE
    assert not cell.corrected.any()
    assert cell.feel(2.0, light).payload.mass_kg == pytest.approx(0.1)


def test_a_weight_that_grows_with_its_correction_is_a_contact_there(cell):
    """A ceiling above the tool, loop gain 1: it pushes down, as a part would weigh."""
    cell.turn = np.array([0.0, 1e-3, 0.0])

    def ceiling(share, corrected):
        return [
            0.0,
            0.0,
            -1.0 + share * corrected[2],
            0.0,
            -0.02 + 0.02 * share * corrected[2],
            0.0,
        ]

    cell.feel(20.0, ceiling)
    assert cell.states.count(State.HOLDING) == 1
    told = cell.supervisor.supervision
    assert (told.payload, told.valid, told.text) == (None, False, module.TOUCHED_HERE)
    assert cell.feel(5.0, ceiling, THERE).text == module.TOUCHED_HERE
    assert cell.states.count(State.HOLDING) == 2


def test_a_correction_yields_to_what_works_against_it_until_the_command_leaves(cell):
    cell.feel(2.0, NOTHING)
    push = np.array([0.2, 0.0, 0.0, 0.0, 0.01, 0.0])
    cell.turn = np.array([0.0, 1e-3, 0.0])
    assert cell.feel(1.0, push).share == 1.0
    cell.turn = -cell.turn
    shares = [cell.feel(0.01, push).share for _ in range(30)]
    assert np.all(np.diff(shares) <= 0.0)
    assert shares[-1] == 0.0
    told = cell.feel(5.0, NOTHING)
    assert (told.state, told.share, told.valid) == (State.FREE, 0.0, False)
    assert told.text == module.YIELDED
    assert cell.feel(2.0, NOTHING, HERE + 0.9 * REACH).share == 0.0
    assert cell.feel(2.0, NOTHING, HERE + 1.1 * REACH).valid


def test_a_weight_where_a_contact_was_is_judged_once_the_command_has_moved(cell):
    cell.feel(2.0, NOTHING)
    cell.turn = np.array([0.0, -1e-3, 0.0])
    assert cell.feel(1.0, np.array([0.2, 0.0, 0.0, 0.0, 0.01, 0.0])).share == 0.0
    for theta in (HERE, HERE + 0.9 * REACH):
        told = cell.feel(5.0, PART, theta)
        assert (told.state, told.payload) == (State.UNSURE, None)
        assert "once the command has moved by correction_limit_deg" in told.text
    assert cell.feel(5.0, PART, HERE + 1.1 * REACH).valid


def test_what_the_gripper_tells_counts_once_the_load_agrees(cell):
    feather = replace(PART, mass_kg=0.02)
    cell.supervisor.declare_payload(feather)
    cell.supervisor.forget()
    assert cell.feel(1.0, NOTHING).state is State.FREE
    told = cell.feel(3.0, feather)
    assert (told.state, told.told) == (State.HOLDING, True)
    assert told.payload.mass_kg == pytest.approx(feather.mass_kg)
    assert told.payload.centre_m == pytest.approx(feather.centre_m)
    cell.supervisor.declare_payload(None)
    assert cell.supervisor.supervision.state is State.RELEASED
    assert not cell.feel(3.0, feather).told


def test_a_told_payload_that_differs_gives_way_to_the_load(cell):
    cell.supervisor.declare_payload(replace(PART, mass_kg=0.4))
    told = cell.feel(3.0, PART)
    assert (told.told, told.payload.mass_kg) == (False, pytest.approx(PART.mass_kg))


def test_after_loads_were_lost_the_payload_must_be_seen_again(cell):
    cell.feel(3.0, PART)
    cell.supervisor.lost()
    assert cell.supervisor.supervision.text == module.NO_LOAD
    assert cell.supervisor.supervision.payload is None
    assert cell.feel(1.0, NOTHING).state is State.FREE
    assert cell.feel(3.0, PART).payload.mass_kg == pytest.approx(PART.mass_kg)


def test_a_contact_beyond_the_table_that_the_correction_brings_does_not_come_and_go(table):
    stream = CorrectionStream(
        ErrorModel("as the wrist", table, "closed_form"), StreamSettings(), enabled=True
    )
    cell, limits = Cell(table), table.geometry.limits
    weight, applied = cell.weight(PART), []
    for i in range(600):
        stamp = SECOND + i * SECOND // 100
        pressed = i >= 300 and np.abs(stream.applied).max() > BROUGHT
        wall = side(1.1 * limits.force) if pressed else NOTHING
        load = weight + wall
        stream.loads.add(stamp, "wrist_base", load[:3], load[3:])
        stream.on_command(stamp, "", NAMES, HERE.tolist())
        applied.append(np.abs(stream.applied).max())
    assert applied[299] > BROUGHT
    assert np.max(applied[-250:]) < BROUGHT
    assert not stream.supervision.valid
    cell.theta = THERE
    load = cell.weight(PART)
    for _ in range(300):
        stamp += SECOND // 100
        stream.loads.add(stamp, "wrist_base", load[:3], load[3:])
        stream.on_command(stamp, "", NAMES, THERE.tolist())
    assert stream.supervision.valid, "it comes back at another place"


def test_a_light_contact_does_not_come_and_go(cell):
    cell.feel(2.0, NOTHING)
    for _ in range(5):
        cell.feel(0.6, side(0.06))
        cell.feel(0.6, side(0.04))
    assert cell.states[2:] == [State.IN_CONTACT]


def test_where_it_is_not_known_what_is_carried_the_correction_fades(cell):
    cell.feel(2.0, NOTHING)
    assert cell.feel(2.0, side(0.3)).share == 1.0
    cell.feel(1.0, NOTHING)
    swinging = [replace(PART, mass_kg=0.2 + 0.1 * (i % 2)) for i in range(8)]
    shares = [cell.feel(0.3, each).share for each in swinging]
    assert np.all(np.diff(shares) <= 0.0)
    assert shares[-1] == 0.0
    assert cell.feel(3.0, PART).valid


def test_a_load_that_comes_late_while_the_wrist_moves_is_no_contact(cell):
    cell.supervisor.declare_payload(PART)
    cell.feel(3.0, PART)
    path = [HERE + (THERE - HERE) * i / 100.0 for i in range(101)]
    for i in range(20, 101):
        cell.theta = path[i - 10]
        late = cell.weight(PART)
        cell.feel(0.01, late, path[i])
    assert cell.feel(2.0, PART, THERE).valid
    assert cell.states[-1] is State.HOLDING
    assert cell.states.count(State.HOLDING) == 1


def test_the_farther_a_load_departs_the_sooner_it_is_believed(table):
    def seconds(push):
        cell = Cell(table)
        cell.feel(3.0, PART)
        for i in range(100):
            if cell.feel(0.01, cell.weight(PART) + side(push)).state is State.IN_CONTACT:
                return i / 100
        return np.inf

    assert seconds(0.049) == np.inf
    assert 0.08 <= seconds(0.055) <= 0.1
    assert 0.01 <= seconds(0.5) <= 0.02
    # One reading alone is believed never.
    assert seconds(50.0) == 0.01


def test_in_contact_with_a_lost_part_the_correction_fades_wherever_the_contact_points(cell):
    cell.feel(3.0, PART)
    cell.turn = np.array([0.0, 1e-3, 0.0])
    cell.theta = HERE + MOTION
    helping = np.array([0.3, 0.0, 0.0, 0.0, 0.01, 0.0])
    assert cell.feel(0.5, cell.weight(PART) + helping).share == 1.0
    told = cell.feel(1.5, helping)
    assert (told.state, told.payload, told.share) == (State.IN_CONTACT, None, 0.0)


@pytest.mark.parametrize("hertz", [20, 1000])
def test_a_payload_is_learned_by_time_not_by_the_number_of_readings(table, hertz):
    cell = Cell(table)
    scales = Scales(table.geometry)
    reading = scales.reading(cell.weight(PART).tolist(), cell.rotation().tolist())
    learned = scales.unknown(reading)
    for _ in range(hertz):
        assert learned.explains(reading, SupervisorSettings().limit, 1.0 / (hertz * LATE_S))
    # Five readings that are independent, each of a third of the threshold.
    wanted = SupervisorSettings().limit.moment / np.sqrt(5.0)
    assert learned.open_moment(reading.rows) == pytest.approx(wanted, rel=1e-3)


@settings(max_examples=50)
@given(doubt=st.floats(1.0, 10.0), stop=st.floats(-2.0, 2.0), place=st.floats(0.0, 1.0))
def test_beside_any_stop_the_trusted_part_leaves_no_more_than_no_correction(doubt, stop, place):
    softer = doubt ** (2.0 * place - 1.0)
    trust = SupervisorSettings(model_doubt=doubt).trust
    # An error of 1 before correction, and a rigid stop that bears what is beyond it.
    without, left = min(1.0, stop), min(1.0 - trust * softer, stop)
    assert abs(left) <= abs(without) + 1e-12
    assert SupervisorSettings(model_doubt=doubt, follow=True).trust == 1.0


def test_thresholds_are_not_below_the_scatter_of_the_load(cell):
    cell.supervisor.scatter = Thresholds(0.5, 0.05)
    assert cell.feel(2.0, side(0.3)).state is State.FREE


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan, np.inf])
def test_a_payload_without_a_weight_is_refused(mass):
    with pytest.raises(InputError, match="mass"):
        Payload(mass, (0.0, 0.0, 0.0))


def test_without_gravity_nothing_is_a_payload(table):
    geometry = dict(table.header.geometry)
    geometry["site"] = {**geometry["site"], "gravity_m_s2": [0.0, 0.0, 0.0]}
    floating = Cell(replace(table, header=replace(table.header, geometry=geometry)))
    floating.supervisor.declare_payload(PART)
    told = floating.feel(3.0, [0.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    assert (told.state, told.payload) == (State.IN_CONTACT, None)


def stream_of(table, **options):
    model = ErrorModel("soft", table, "closed_form")
    stream = CorrectionStream(model, StreamSettings(**options), enabled=True)
    return stream


def drive(stream, seconds, wrench, start=0.0, theta=HERE):
    for i in range(round(50 * seconds)):
        stamp = round((10.0 + start + i / 50) * SECOND)
        stream.loads.add(stamp, "wrist_base", wrench[:3], wrench[3:])
        command = stream.on_command(stamp, "", NAMES, theta)
    return command


@pytest.fixture(scope="module")
def soft(make_table):
    return make_table(softness=20.0)


def test_after_a_release_commands_are_as_if_nothing_had_been_held(soft):
    stream = stream_of(soft)
    weight = Cell(soft).weight(PART)
    held = drive(stream, 4.0, weight)
    assert held.valid
    assert np.max(np.abs(held.theta - HERE)) > soft.geometry.limits.encoder_step
    after = drive(stream, 3.0, NOTHING, start=4.0)
    never = drive(stream_of(soft), 3.0, NOTHING)
    assert np.array_equal(after.theta, never.theta)
    assert np.array_equal(after.correction.after, never.correction.after)
    assert after.valid


def test_a_plan_without_commands_is_corrected_for_what_was_held_before_it(soft):
    stream, weight = stream_of(soft), Cell(soft).weight(PART)
    for i in range(100):
        stream.loads.add(9 * SECOND + i * SECOND // 100, "wrist_base", weight[:3], weight[3:])
    plan = [planned_point(2, HERE, (), ())]
    found = stream.on_trajectory(10 * SECOND, "", NAMES, plan)
    assert stream.supervision.payload is not None
    follow = stream_of(soft, supervisor=SupervisorSettings(follow=True))
    follow.loads.add(10 * SECOND, "wrist_base", weight[:3], weight[3:])
    wanted = follow.on_trajectory(10 * SECOND, "", NAMES, plan)
    added, full = (each.points[0].positions - HERE for each in (found, wanted))
    assert np.allclose(added, TRUST * full, rtol=0.0, atol=1e-7)
    assert np.max(np.abs(added)) > 1e-4


def test_a_plan_is_valid_only_where_the_payload_is_known(soft):
    """One pose hides the height of a payload's centre, which another pose shows."""
    stream, cell = stream_of(soft), Cell(soft)
    drive(stream, 4.0, cell.weight(PART))
    here, there = planned_point(2, HERE), planned_point(2, THERE)
    assert stream.on_trajectory(14 * SECOND, "", NAMES, [here]).valid
    doubted = stream.on_trajectory(14 * SECOND, "", NAMES, [here, there])
    assert (doubted.fault, doubted.valid) == (None, False)
    cell.theta = THERE
    drive(stream, 4.0, cell.weight(PART), 4.0, THERE)
    assert stream.on_trajectory(18 * SECOND, "", NAMES, [here, there]).valid
