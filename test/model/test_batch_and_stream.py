"""One law, two uses: any split of a recording gives the same predictions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.errors import InputError, LoadRangeError, UnreachablePoseError
from wrist_stiffness.model import batch
from wrist_stiffness.model.block import Block, Load, Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.evaluation import evaluate, evaluate_beside
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.pin_play import Play
from wrist_stiffness.model.registry import catalogue

PLACED = [(law.id, place) for law in catalogue().values() for place in law.places]


def plausible(name, place):
    """Return an effect away from its null, with every parameter uncertain."""
    law = catalogue()[name]
    values = {p.key: p.mean or min(p.scale, p.upper) for p in law.parameters(place)}
    if name == "flange_contact":
        values = {"gap_um": -200.0}
    return Effect(
        law,
        place,
        {p.key: Estimate(values[p.key], 0.1 * p.scale) for p in law.parameters(place)},
    )


@pytest.fixture(scope="module")
def whole(model, make):
    """A model with every law once, and its batch over a lively recording."""
    chosen = dict(reversed(PLACED))
    loaded = model.with_effects(*(plausible(name, place) for name, place in chosen.items()))
    block = make.block()
    return loaded, block, loaded.batch(block)


@settings(max_examples=10)
@given(st.lists(st.integers(1, 59), max_size=6))
def test_any_split_gives_the_same(whole, cuts):
    loaded, block, at_once = whole
    edges = [0, *sorted(set(cuts)), len(block)]
    memory = None
    for start, stop in zip(edges, edges[1:], strict=False):
        result = evaluate(loaded, block.take(slice(start, stop)), memory)
        memory = result.memory
        for part, all_ in ((result.twist, at_once.twist), (result.measured, at_once.measured)):
            scale = np.abs(all_).max(axis=0)
            assert np.all(np.abs(part - all_[start:stop]) <= 1e-12 * scale)


@pytest.mark.parametrize(("name", "place"), PLACED)
def test_session_is_the_batch_sample_by_sample(model, make, name, place):
    """Every law at every place; and none is without effect."""
    loaded = model.with_effects(plausible(name, place))
    block = make.block(10)
    at_once, plain = loaded.batch(block), model.batch(block)
    assert np.abs(at_once.measured - plain.measured).max() > 1e-13
    session = loaded.session()
    for row in range(len(block)):
        prediction = session.advance(sample_of(block, row))
        scale = np.abs(at_once.twist).max(axis=0)
        assert np.all(np.abs(prediction.twist - at_once.twist[row]) <= 1e-12 * scale)
        scale = np.abs(at_once.measured).max(axis=0)
        assert np.all(np.abs(prediction.measured - at_once.measured[row]) <= 1e-12 * scale)
    assert np.linalg.eigvalsh(prediction.covariance).min() > -1e-20


def test_constant_effects_are_the_same_together_as_one_by_one(model, make, monkeypatch):
    """Screws, wrench, gaps and sensor, put together at home, beside laws that see them."""
    constant = [place for place in PLACED if catalogue()[place[0]].constant]
    assert {name for name, _ in constant} > {"load_bias", "flange_contact", "target_mounting"}
    far = Effect(catalogue()["encoder_offset"], "motor_1", {"offset_mdeg": Estimate(300.0)})
    beside = (
        ("encoder_eccentricity", "motor_1"),
        ("thermal_expansion", "link_1"),
        ("thermal_expansion", "link_2"),
        ("drift", "pose_sensor"),
        ("joint_clearance", "joint_3"),
    )
    block = make.block(10)
    for others in ((), beside[:4], beside):
        rest = [plausible(*place) for place in (*constant, *others)]
        loaded = model.with_effects(far, *(each for each in rest if each.name != far.name))
        session, found = loaded.session(), loaded.batch(block)
        streamed = [session.advance(sample_of(block, row)) for row in range(len(block))]
        with monkeypatch.context() as patch:
            for name, _ in constant:
                patch.setattr(type(catalogue()[name]), "constant", False)
            apart = loaded.with_effects(*loaded.effects).batch(block)
        for key in ("twist", "measured"):
            expected = getattr(apart, key)
            scale = np.abs(expected).max(axis=0)
            assert np.all(np.abs(getattr(found, key) - expected) <= 1e-12 * scale)
            live = np.array([getattr(each, key) for each in streamed])
            assert np.all(np.abs(live - expected) <= 1e-12 * scale)
        assert set(apart.warnings) == set(found.warnings) == set(streamed[-1].warnings) != set()


def test_a_calibrated_model_is_predicted_in_any_order(model, make):
    """Parts, axes, bias and scale of the load: one sample says all of it."""
    own = [place for place in PLACED if catalogue()[place[0]].constant]
    own += [("link_stiffness", "link_2"), ("load_scale", "load_sensor")]
    loaded, block = model.with_effects(*(plausible(*place) for place in own)), make.block(10)
    at_once, tilted = loaded.batch(block), replace(block, load_on_platform=True)
    on_platform = loaded.batch(tilted)
    assert loaded.stateless
    for row in reversed(range(len(block))):
        for found, turned in ((at_once, False), (on_platform, True)):
            one = loaded.predict(block.theta[row], Load(block.load[row], turned))
            for key in ("twist", "measured"):
                expected = getattr(found, key)
                scale = np.abs(expected).max(axis=0)
                assert np.all(np.abs(getattr(one, key) - expected[row]) <= 1e-12 * scale)
    assert not loaded.with_effects(*loaded.effects, plausible("backlash", "motor_1")).stateless


def test_preview_leaves_no_trace(model, make):
    loaded = model.with_effects(
        make.effect("backlash@motor_1", width_mdeg=(50.0, 1.0)),
        make.effect("creep@joint_2", delayed_percent=30.0, time_constant_s=0.2),
        make.effect("joint_friction@joint_3", coefficient=0.3),
    )
    block = make.block(12)
    at_once, session = loaded.batch(block), loaded.session()
    for row in range(len(block)):
        sample = sample_of(block, row)
        session.preview(replace(sample, theta=sample.theta + 0.2))
        preview = session.preview(sample)
        prediction = session.advance(sample)
        assert np.array_equal(preview.twist, prediction.twist)
        assert np.array_equal(preview.covariance, prediction.covariance)
        assert np.allclose(preview.twist, at_once.twist[row], rtol=1e-9, atol=1e-15)


def sample_of(block, row):
    return Sample(
        block.time[row],
        block.theta[row],
        Load(block.load[row]),
        temperatures={name: values[row] for name, values in block.temperatures.items()},
    )


def test_chunks_do_not_show(whole, monkeypatch):
    loaded, block, at_once = whole
    monkeypatch.setattr(batch, "CHUNK", 7)
    in_chunks = loaded.batch(block)
    scale = np.abs(at_once.twist).max(axis=0)
    assert np.all(np.abs(in_chunks.twist - at_once.twist) <= 1e-12 * scale)
    assert in_chunks.warnings


def test_refused_samples_are_passed_over(model, make):
    """Out of the domain, too large, not finite: NaN there, and no trace in the memory."""
    loaded = model.with_effects(
        make.effect("backlash@motor_1", width_mdeg=50.0), make.effect("creep@joint_2",
        delayed_percent=30.0, time_constant_s=0.2),
    )  # fmt: skip
    block = make.block(40)
    theta, load = block.theta.copy(), block.load.copy()
    theta[5] = np.radians([90.0, 0.0])
    theta[11, 1] = np.nan
    load[20, 2] = -7.0
    load[21, 0] = np.nan
    result = loaded.batch(replace(block, theta=theta, load=load))
    refused = [5, 11, 20, 21]
    assert np.flatnonzero(~result.accepted).tolist() == refused
    assert np.isnan(result.twist[refused]).all()
    kept = np.setdiff1d(np.arange(40), refused)
    without = loaded.batch(block.take(np.isin(np.arange(40), kept)))
    assert np.array_equal(result.twist[kept], without.twist)
    session = loaded.session()
    session.advance(sample_of(block, 0))
    for row, error in ((5, UnreachablePoseError), (11, InputError), (20, LoadRangeError)):
        with pytest.raises(error):
            session.advance(sample_of(replace(block, theta=theta, load=load), row))
    assert session.advance(sample_of(block, 1)).twist == pytest.approx(
        loaded.batch(block.take(slice(0, 2))).twist[1], rel=1e-12
    )


def test_time_does_not_run_backwards(model):
    session = model.session()
    session.advance(Sample(1.0, np.zeros(2), Load(np.zeros(6))))
    with pytest.raises(InputError, match="0.500000 s is before the last one, 1.000000 s"):
        session.advance(Sample(0.5, np.zeros(2), Load(np.zeros(6))))
    with pytest.raises(InputError, match="time nan is not finite"):
        session.advance(Sample(np.nan, np.zeros(2), Load(np.zeros(6))))
    with pytest.raises(InputError, match="speeds .* are not finite"):
        session.advance(Sample(2.0, np.zeros(2), Load(np.zeros(6)), np.array([np.nan, 0.0])))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"time": np.zeros(2)}, "theta has shape"),
        ({"load": np.zeros((3, 3))}, "load has shape"),
        ({"time": np.array([0.0, 2.0, 1.0])}, "time falls from 2.000000 to 1.000000"),
        ({"temperatures": {"link_1": np.zeros(2)}}, "link_1 has shape"),
        ({"covariates": {"humidity": np.array([1.0, np.nan, 1.0])}}, "humidity is not finite"),
    ],
)
def test_bad_blocks_are_refused(changes, text):
    good = {"time": np.arange(3.0), "theta": np.zeros((3, 2)), "load": np.zeros((3, 6))}
    with pytest.raises(InputError, match=text):
        Block(**{**good, **changes})


def test_load_in_platform_axes_is_the_same_load(model, make):
    block = make.block(20)
    turn = model.table.mechanism.forward(block.theta).platform
    halves = np.einsum("nji,nhj->nhi", turn, block.load.reshape(-1, 2, 3)).reshape(-1, 6)
    on_platform = replace(block, load=halves, load_on_platform=True)
    loaded = model.with_effects(make.effect("load_scale@load_sensor", scale_percent=5.0))
    assert np.allclose(loaded.batch(on_platform).twist, loaded.batch(block).twist, rtol=1e-9)


def test_missing_signal_leaves_the_effect_out_and_says_so(model, make):
    warm = make.effect("thermal_expansion@link_1")
    loaded = model.with_effects(warm)
    prediction = loaded.predict(np.zeros(2), Load(np.zeros(6)))
    assert prediction.warnings == (
        "thermal_expansion@link_1: temperature of ambient is missing, left out",
    )
    assert np.allclose(
        prediction.twist, model.predict(np.zeros(2), Load(np.zeros(6))).twist, rtol=1e-12
    )


def test_past_first_order_is_said(model, make):
    """2 mrad are 114.6 mdeg."""
    block = make.rest((0.0, 0.0), (0.0, 0.0, -1.0))
    for size, said in ((110.0, 0), (120.0, 1)):
        off = make.effect("encoder_offset@motor_1", offset_mdeg=size)
        assert len(model.with_effects(off).batch(block).warnings) == said


@pytest.mark.parametrize("degrees", [1e9, 1e108, 1e200])
def test_an_error_that_is_no_error_is_refused_and_forgotten(model, make, degrees):
    """One number from a broken thermometer must not stop a node or stay in its memory."""
    loaded = model.with_effects(make.effect("thermal_expansion@link_1"))
    session = loaded.session()
    cold = {"ambient": 20.0, "link_1": 21.0}
    samples = [
        Sample(float(n), np.zeros(2), Load(np.zeros(6)), temperatures=cold | changed)
        for n, changed in enumerate([{}, {"link_1": degrees}, {}])
    ]
    first = session.advance(samples[0])
    with pytest.raises(InputError, match="rad, the limit is 1 rad: is a temperature"):
        session.advance(samples[1])
    assert np.array_equal(session.advance(samples[2]).twist, first.twist)


@pytest.mark.parametrize("chunk", [batch.CHUNK, 7])
def test_pins_begin_where_they_rested_last(model, make, monkeypatch, chunk):
    """Beside another model, or before at the same block: it costs less and changes nothing."""
    monkeypatch.setattr(batch, "CHUNK", chunk)
    loaded = model.with_effects(make.effect("joint_clearance@joint_4", clearance_um=8.0))
    block, steps = make.block(40), []
    bent = make.effect("link_stiffness@link_1", flexibility_percent=0.5)
    monkeypatch.setattr(
        Play,
        "_hessian",
        lambda self, *a, own=Play._hessian: steps.append(len(a[0])) or own(self, *a),
    )

    def cost(predict):
        steps.clear()
        return predict(), sum(steps)

    # Chunks that are kept would cost nothing.
    monkeypatch.setattr(batch, "MOST_KEPT", 0)
    recent = batch.Recent()
    (cold,), at_first = cost(lambda: loaded.batch_with(block, [()], recent))
    (warm,), again = cost(lambda: loaded.batch_with(block, [()], recent))
    (_, beside), both = cost(lambda: loaded.batch_with(block, [(), (bent,)], recent))
    (alone,), apart = cost(lambda: loaded.batch_with(block, [(bent,)]))
    assert again < 0.5 * at_first
    assert both - again < 0.8 * apart
    scale = np.abs(cold.twist).max(axis=0)
    assert np.all(np.abs(warm.twist - cold.twist) <= 1e-12 * scale)
    assert np.all(np.abs(beside.twist - alone.twist) <= 1e-12 * scale)


def test_candidates_in_one_pass_are_their_own_batches(model, make):
    """Also where a candidate changes the parts, and where memory crosses chunks."""
    base = model.with_effects(make.effect("encoder_offset@motor_1", offset_mdeg=20.0))
    names = (
        "link_stiffness@link_1",
        "creep@joint_3",
        "joint_friction@joint_2",
        "drift@pose_sensor",
    )
    candidates = [(), *((plausible(*name.split("@")),) for name in names)]
    block = make.block(50)
    together = base.batch_with(block, candidates)
    for extra, found in zip(candidates, together, strict=True):
        alone = base.with_effects(*base.effects, *extra).batch(block)
        scale = np.abs(alone.measured).max(axis=0)
        assert np.all(np.abs(found.measured - alone.measured) <= 1e-12 * scale)
    assert not np.array_equal(together[0].measured, together[4].measured)


def test_candidates_share_no_more_than_they_have_in_common(model, make, monkeypatch):
    """A memory, a load, a sensor: what a candidate changes, the base's later effects see."""
    monkeypatch.setattr(batch, "CHUNK", 20)
    base = model.with_effects(
        *(plausible(*name.split("@")) for name in ("load_scale@load_sensor", "backlash@motor_1")),
        plausible("joint_friction", "joint_2"),
        plausible("drive_compliance", "motor_2"),
    )
    own = base.effects
    moved = own[1].with_values({"width_mdeg": 7.0})
    candidates = [
        own,
        (*own, plausible("cable_wrench", "platform")),
        (*own, plausible("creep", "joint_3")),
        (*own, plausible("drift", "pose_sensor")),
        (own[0], moved, *own[2:]),
        (*own[:2], *own[3:]),
        (*own, plausible("encoder_offset", "motor_1")),
    ]
    block = make.block(70)
    together = model.with_effects().batch_with(block, candidates)
    for effects, found in zip(candidates, together, strict=True):
        alone = model.with_effects(*effects).batch(block)
        scale = np.abs(alone.measured).max(axis=0)
        assert np.all(np.abs(found.measured - alone.measured) <= 1e-12 * scale)
        assert np.all(np.abs(found.twist - alone.twist) <= 1e-12 * scale)
    for found in together[1:]:
        assert not np.allclose(found.measured, together[0].measured, rtol=1e-9, atol=0.0)


def test_beside_itself_with_another_past(model, make):
    """The same model at the same block, but what was before differs."""
    loaded = model.with_effects(plausible("backlash", "motor_1"))
    block = make.block(10)
    first = evaluate(loaded, block, None)
    past = replace(first.memory, states=(block.theta[0, 0] + 1e-3,))
    (found,) = evaluate_beside([loaded], [past], first)
    wanted = evaluate(loaded, block, past)
    assert np.allclose(found.twist, wanted.twist, rtol=1e-12)
    assert not np.allclose(found.twist, first.twist, rtol=1e-6)


def test_a_formula_without_a_value_says_where_why_and_when(free_model, make):
    law = FormulaLaw("own", "joint_3", np.eye(6)[0], "k * sqrt(time - 17002.5)", [], ["k"])
    model = free_model.with_effects(Effect(law, "joint_3", {"k": Estimate(1e-6)}))
    started = make.block(100)
    backwards = replace(started, time=17000.0 + started.time - started.time[0])
    with pytest.raises(
        InputError, match=r"own: sqrt\(time - 17002\.5\) .* time = 17000.000, 0\.000 s"
    ):
        model.batch(backwards)
    falling = FormulaLaw("own", "joint_3", np.eye(6)[0], "k * log(17001 - time)", [], ["k"])
    model = free_model.with_effects(Effect(falling, "joint_3", {"k": Estimate(1e-6)}))
    stamp = backwards.time[backwards.time >= 17001.0][0]
    told = f"for time = {stamp:.3f}, {stamp - 17000.0:.3f} s after the start"
    with pytest.raises(InputError, match=told):
        model.batch(backwards)
