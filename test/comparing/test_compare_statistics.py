"""On what an error depends: planted in sessions of the virtual cell, and in tables made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from measured_wrist import wrong_wrist
from scipy.stats import rankdata

from wrist_stiffness.commands.compare import Compared
from wrist_stiffness.commands.provenance import Provenance
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.comparison import ComparedModel, Comparison, worst_poses
from wrist_stiffness.comparing.curve import CLASSES, classes_of
from wrist_stiffness.comparing.explained import explain
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.comparing.set_up import without_set_up
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.inference.evidence import SURE_OF_NOISE
from wrist_stiffness.inference.noise import KNOWN
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings

N = 400

PROVENANCE = Provenance("wrist-stiffness compare", "2026-01-01", {}, {})


def along(observations, component, values):
    out = np.zeros_like(observations.values)
    out[:, component] = values
    return out


def angles(observations):
    return np.degrees([observations.covariate(f"theta_{motor}") for motor in (1, 2)])


@pytest.fixture(scope="module")
def cell(model, in_the_cell):
    """Return what the right model leaves of two minutes of the cell, with something planted."""
    sessions = {}

    def left(planted=None, seed=0, stated=True):
        key = seed, stated
        if key not in sessions:
            settings = CellSettings(rate_hz=10.0, program_seconds=120.0, program_seed=41 + seed)
            session = in_the_cell(model.table, settings, seed)
            session = session if stated else replace(session, covariance=None)
            units = (as_units(model, session),)
            sessions[key] = units, *without_set_up(model, units, ())[1:]
        units, observations, (set_up,) = sessions[key]
        if planted is not None:
            observations = observations.with_values(observations.values + planted(observations))
        rows = units[0].measured
        return explain(
            observations, units, set_up.columns[rows], set_up.moved, set_up.weights[rows]
        )

    return left


@pytest.mark.parametrize("stated", [True, False])
def test_sound_wrists_depend_on_nothing(cell, stated):
    """A few of those that bench/compare_alarms.py draws."""
    for seed in range(5):
        found = cell(seed=seed, stated=stated)
        assert found.every == ()
        assert found.answer.nothing > 0.8
        assert found.above == {"s_um": 0.0, "phi_mdeg": 0.0}
    assert sentences(found)[0].startswith("What is left depends on nothing that was recorded")


def zone(o):
    one, two = angles(o)
    return along(o, 2, 4e-6 * (np.hypot(one - 10.0, two + 5.0) < 10.0))


def saw_tooth(o):
    return along(o, 0, 3e-6 * (2.0 * (o.times / 30.0 % 1.0) - 1.0))


def both_angles(o):
    return along(o, 4, np.radians(10e-3) * np.sin(np.radians(8.0 * (angles(o)[0] - angles(o)[1]))))


def ripple(o):
    return along(o, 0, 2e-6 * np.sin(np.radians(36.0 * angles(o)[0])))


@pytest.mark.parametrize(
    ("planted", "name", "key"),
    [
        (zone, "a zone of poses", "s_um"),
        (saw_tooth, "the time", "s_um"),
        (both_angles, "the difference of the motor angles", "phi_mdeg"),
        (ripple, "the angle of motor 1", "s_um"),
        (lambda o: along(o, 0, 1.5e-6 * o.covariate("approach_1")), "the side of approach", "s_um"),
        (lambda o: along(o, 2, 3e-6 * o.covariate("fz")), "the load", "s_um"),
    ],
    ids=["zone", "saw-tooth", "both angles", "ripple", "approach", "load"],
)
def test_what_is_planted_in_a_session_is_told_first_with_its_size(cell, planted, name, key):
    found = cell(planted)
    first = found.told[0]
    assert first.name == name
    assert first.probability > 0.97
    # What a new set-up takes up of it is no error any more.
    grown = np.sqrt(found.error[key] ** 2 - cell().error[key] ** 2)
    assert first.sizes[key] == pytest.approx(grown, rel=0.25)
    assert found.above[key] == pytest.approx(grown, rel=0.25)
    # Jumps that no smooth curve follows may pass for noise, as far as noise is not known.
    unsure = np.expm1(0.5 * SURE_OF_NOISE * KNOWN)
    assert found.noise[key] == pytest.approx(cell().noise[key], rel=unsure)


def table(dwells, change=None, seed=1):
    """Dwells made by hand; what follows from them."""
    return by_hand(dwells(np.random.default_rng(seed), change))


def by_hand(observations):
    """Beside a registration that shifts and turns all alike."""
    n = observations.n_units
    registration = np.broadcast_to(np.diag(np.repeat(1e-3, 6)), (n, 6, 6))
    weights = observations.measured / np.repeat([1e-6, 1e-4], 3) ** 2
    return explain(observations, [Units(n)], registration, np.zeros(6), weights)


@pytest.mark.slow
def test_what_a_calibration_could_not_take_up_is_told(model, in_the_cell):
    settings = CellSettings(
        rate_hz=10.0,
        hidden=(HiddenEffect("backlash", "motor_1", "single", 1e-3, 5),),
        base="wrong",
        base_seed=3,
    )
    session = in_the_cell(model.table, settings, 3)
    calibrated = calibrate(model, [session]).model
    found = compare_models([("calibrated", calibrated)], [session]).models[0].explained
    first = found.told[0]
    assert first.name == "the side of approach"
    assert first.curve.names == ("approach_1",)
    assert first.sizes["phi_mdeg"] > 0.7 * found.error["phi_mdeg"]


def test_parts_are_no_more_than_the_whole(model, in_the_cell):
    """A wrist off its drawing: laws of turns shift the platform too, by way of the new set-up."""
    settings = wrong_wrist(60.0, 4, 4)
    session = in_the_cell(model.table, settings, 4)
    found = compare_models([("drawn", model)], [session]).models[0].explained
    for key, error in found.error.items():
        assert 0.0 < found.above[key] ** 2 <= error**2
        sizes = [each.sizes[key] for each in found.told if key in each.sizes]
        assert 0.0 < max(sizes) <= found.above[key]


class Units:
    """What is asked of a session beside its table: the scatter of one measurement."""

    def __init__(self, n):
        self.drift, self.white = np.zeros(6), np.repeat([1e-6, 1e-4], 3)
        self.measured, self._n = np.ones(n, dtype=bool), n

    def __len__(self):
        return self._n


def shift(component, values):
    out = np.zeros((len(values), 6))
    out[:, component] = values
    return out


def test_a_signal_is_told_with_the_direction_and_a_curve_that_is_right(dwells):
    found = table(dwells, lambda c: shift(2, 0.2e-6 * (c["humidity"] - 50.0)))
    (told,) = found.told
    assert told.name == "humidity"
    assert told.sizes == pytest.approx({"s_um": 0.2 * np.std(told.curve.values)}, rel=0.1)
    assert told.curve.where == "along +z"
    expected = 0.2 * (told.curve.places[:, 0] - 50.0)
    pulls = (
        told.curve.mean - told.curve.mean.mean() - expected + expected.mean()
    ) / told.curve.sigma
    assert np.sqrt(np.mean(pulls**2)) < 2.0
    assert "As humidity goes from 3" in sentences(found)[0]
    assert " um along +z." in sentences(found)[0]


def test_a_zero_has_no_sign(dwells):
    (told,) = table(dwells, lambda c: shift(2, 0.2e-6 * (c["humidity"] - 50.0))).told
    turned = replace(told.curve, direction=np.array([0.8, -0.001, 0.6]))
    assert turned.where == "along (0.80, 0.00, 0.60)"


def test_two_signals_together_are_told_where_neither_alone_shows(dwells):
    found = table(dwells, lambda c: shift(2, 0.2e-6 * (c["humidity"] - 50.0) * c["theta_1"]))
    assert found.told[0].name == "humidity and the pose together"
    assert found.told[0].probability > 0.99


def test_lost_motion_is_told_as_what_the_other_side_changes(dwells):
    found = table(dwells, lambda c: shift(4, 1e-3 * c["approach_2"]))
    assert found.told[0].name == "the side of approach"
    text = sentences(found)[0]
    assert "When motor 2 is approached with rising rather than falling angle, the platform" in text
    # 2 mrad between both sides.
    assert float(text.partition("turns by ")[2].split(" +-")[0]) == pytest.approx(115.0, rel=0.1)
    assert "about +y" in text


def test_what_these_data_cannot_tell_apart_is_told_as_one(dwells):
    def with_twin(c):
        c["spindle"] = 2 * c["humidity"] + 5
        return shift(0, 0.2e-6 * (c["humidity"] - 50.0))

    (told,) = table(dwells, with_twin).told
    assert set(told.members) == {"humidity", "spindle"}
    assert told.probability > 0.99
    assert all(0.3 < share < 0.7 for share in told.members.values())
    assert "cannot tell which" in sentences(table(dwells, with_twin))[0]


def test_what_was_not_varied_is_said(dwells):
    assert "the speed" in table(dwells).not_varied
    assert sentences(table(dwells))[-1].startswith("Not varied here")


def test_a_signal_that_stood_still_is_said_once(dwells):
    def stood_still(c):
        c["humidity"] = np.full_like(c["humidity"], 44.5)
        return 0.0

    idle = table(dwells, stood_still).not_varied
    assert "humidity" in idle
    assert "humidity and the pose together" not in idle


def test_laws_are_judged_by_stretches_that_they_have_not_seen(dwells):
    found = table(dwells, lambda c: shift(2, 4e-6 * c["fz"] + 3e-6 * np.sin(2 * c["theta_2"])))
    # The noise of three components of 1 um.
    assert found.error["s_um"] > 2.5
    assert 0.97 * np.sqrt(3) < found.reachable["s_um"] < 1.1 * np.sqrt(3)
    assert table(dwells).reachable == pytest.approx(table(dwells).error, rel=0.01)


def test_blanks_stay_blanks(dwells):
    o = dwells(np.random.default_rng(7), lambda c: shift(2, 3e-6 * c["fz"]))
    values = o.values.copy()
    values[::3, 3:], values[:, 0] = np.nan, np.nan
    found = by_hand(o.with_values(values))
    (told,) = found.told
    assert told.name == "the load"
    assert told.curve.where == "along +z"


def compared(dwells, *sizes):
    """Models that leave a wave of these sizes [um] over the noise."""
    models = []
    for place, size in enumerate(sizes):
        found = table(dwells, lambda c, size=size: shift(2, 1e-6 * size * np.sin(3 * c["theta_1"])))
        models.append(ComparedModel(f"m{place}", found.observations, found, ()))
    return Comparison(("day",), tuple(models), {}, {})


def test_a_noise_that_nothing_tells_is_an_upper_bound(dwells):
    """What jumps with the conditions, as play does, counts as noise there."""
    seen = dwells(
        np.random.default_rng(15), lambda c: shift(2, 20e-6 * np.sign(np.sin(40.0 * c["theta_1"])))
    )
    told, untold = (
        Comparison(("day",), (ComparedModel("m", each, by_hand(each), ()),), {}, {})
        for each in (seen, replace(seen, covariance=None))
    )
    assert told.noise_known
    assert not any("at most" in line for line in told.verdict)
    assert not untold.noise_known
    assert untold.noise["s_um"] > 5.0 * told.noise["s_um"]
    assert f"at most {untold.noise['s_um']:.3g} um of s" in untold.verdict[-1]
    assert not untold.as_values()["models"][0]["noise_known"]
    names = [name for name, _ in Compared(untold, np.empty((0, 2)), (), (), PROVENANCE).levels()]
    assert "instrument noise at most" in names


@pytest.mark.slow
def test_headroom_is_the_share_of_what_could_fall(dwells):
    found = compared(dwells, 10.0, 4.0, 0.0)
    assert found.headroom(found.models[2], "s_um") == pytest.approx(1.0, abs=0.05)
    assert 0.6 < found.headroom(found.models[1], "s_um") < 0.85
    assert "m0 is off by" in found.verdict[0]
    assert "surely above noise and drift" in found.verdict[0]
    assert "noise and drift of the instrument, no more (" in found.verdict[2]
    assert "s falls from" in found.verdict[3]
    assert "% of what the conditions could explain" in compared(dwells, 10.0, 4.0).verdict[2]


def test_no_more_is_claimed_where_a_model_knows_what_no_condition_shows(dwells):
    """A model with a memory may do better than laws of the conditions, and still err."""
    found = compared(dwells, 10.0, 0.5)
    better = {key: 2.0 * size for key, size in found.models[1].explained.error.items()}
    found.models[0].explained.__dict__["reachable"] = better
    assert found.headroom(found.models[1], "s_um") > 1.0
    assert "(laws of the conditions alone reach " in found.verdict[2]


def test_no_headroom_is_claimed_where_nothing_could_fall(dwells):
    found = compared(dwells, 0.0, 0.0)
    assert found.headroom(found.models[1], "s_um") is None
    assert "s stays at 1.7" in found.verdict[2]
    assert "laws of the conditions alone reach 1.7" in found.verdict[2]
    assert "s rises from" in compared(dwells, 0.0, 3.0).verdict[2]


def test_worst_poses_are_apart_and_in_order(dwells):
    rng = np.random.default_rng(14)
    observations = dwells(rng)
    values = observations.values.copy()
    values[100, 2], values[200, 4], values[300, 0] = 50e-6, 3e-3, 20e-6
    floor = {"s_um": 1.7, "phi_mdeg": 9.9}
    worst = worst_poses(observations.with_values(values), floor, ("day",), most=3)
    assert [each.time_s for each in worst] == [300, 600, 900]
    assert worst[0].errors["s_um"] == pytest.approx(50, rel=0.05)
    assert worst[1].errors["phi_mdeg"] == pytest.approx(np.degrees(3e-3) * 1e3, rel=0.05)
    bad = observations.with_values(values)
    close = replace(bad, time_s=0.001 * np.arange(N))
    assert len(worst_poses(close, floor, ("day",), most=3)) == 1
    same = {name: np.zeros(N) for name in ("theta_1", "theta_2", "fx", "fy", "fz")}
    once = replace(bad, covariates={**bad.covariates, **same})
    assert len(worst_poses(once, floor, ("day",), most=3)) == 1


@pytest.mark.parametrize("levels", [20, 40, 1000])
def test_classes_are_cut_by_the_ranks_of_scipy_also_of_ties(levels):
    values = np.random.default_rng(levels).integers(levels, size=200).astype(float)
    cut = np.floor((rankdata(values) - 0.5) * CLASSES / len(values))
    np.testing.assert_array_equal(classes_of(values), np.unique(cut, return_inverse=True)[1])
