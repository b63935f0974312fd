"""A user's formula: what it means, and that nothing else gets through."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.errors import InputError
from wrist_stiffness.mechanism.configuration import TURNING
from wrist_stiffness.model.block import Load
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.formula import (
    DEEPEST,
    FUNCTIONS,
    LONGEST,
    Formula,
    Past,
    UndefinedFormulaError,
)
from wrist_stiffness.model.formula_law import FormulaLaw
from wrist_stiffness.model.model_file import load_model
from wrist_stiffness.shipped import shipped_file

NAMES = ("fx", "theta_1", "k")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * fx", 7.0),
        ("-fx ** 2", -9.0),
        ("2 ** 3 ** 2", 512.0),
        ("k * tanh(fx / k)", 0.5 * math.tanh(6.0)),
        ("min(fx, k) - max(fx, k)", -2.5),
        ("sqrt(abs(-4)) + sign(-2) + log(exp(1.5))", 2.5),
        ("sin(theta_1)**2 + cos(theta_1)**2", 1.0),
        ("+tan(theta_1)", math.tan(0.3)),
        ("1e-3", 1e-3),
    ],
)
def test_formulas_mean_what_they_say(text, value):
    variables = {"fx": 3.0, "theta_1": 0.3, "k": 0.5}
    assert Formula(text, NAMES)(variables) == pytest.approx(value, rel=1e-14)


def test_formulas_take_whole_recordings():
    fx = np.linspace(-2.0, 2.0, 7)
    made = Formula("k * abs(fx)", NAMES)({"fx": fx, "k": 2.0})
    assert np.array_equal(made, 2.0 * np.abs(fx))
    assert Formula("k * abs(fx)", NAMES).names == {"k", "fx"}


@pytest.mark.parametrize(
    ("text", "column", "why"),
    [
        ("fx + ", 6, "invalid syntax"),
        ("fx * humidity", 6, "unknown name humidity"),
        ("__import__('os')", 1, "unknown function __import__"),
        ("fx.real", 1, "only numbers"),
        ("k + fx[0]", 5, "only numbers"),
        ("(lambda: 1)()", 1, "only numbers"),
        ("fx if k else 2", 1, "only numbers"),
        ("fx < k", 1, "only numbers"),
        ("[fx]", 1, "only numbers"),
        ("fx // 2", 1, "only numbers"),
        ("not fx", 1, "only numbers"),
        ("sin(fx, k)", 1, "sin takes 1 values, not 2"),
        ("max(fx)", 1, "max takes 2 values, not 1"),
        ("sin(x=fx)", 1, "only numbers"),
        ("1 + sin", 5, "unknown name sin"),
        ("'a'", 1, "'a' is not a number"),
        ("1 + True", 5, "True is not a number"),
        ("2j", 1, "2j is not a number"),
        ("1e999", 1, "too large"),
        ("", 1, "invalid syntax"),
        ("fx; k", 3, "invalid syntax"),
        ("(fx := 3)", 2, "only numbers"),
        ("sin(*fx)", 5, "only numbers"),
    ],
)
def test_anything_else_is_refused_with_its_column(text, column, why):
    with pytest.raises(InputError) as caught:
        Formula(text, NAMES)
    assert why in str(caught.value)
    assert f"column {column}:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_endless_formulas_are_refused():
    with pytest.raises(InputError, match="nested deeper"):
        Formula("-" * (DEEPEST + 5) + "fx", NAMES)
    with pytest.raises(InputError, match=f"at most {LONGEST}"):
        Formula("fx+" * LONGEST + "fx", NAMES)
    with pytest.raises(InputError):
        Formula("(" * 300 + "fx" + ")" * 300, NAMES)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("k * (1 + sqrt(fx - 3 * theta_1))", "sqrt(fx - 3 * theta_1) has no finite value for fx"),
        ("sin(theta_1) / (fx + k) ** 2", "sin(theta_1) / (fx + k) ** 2 has no finite value for"),
        ("max(log(fx + k), 1)", "log(fx + k) has no finite value for fx = -0.5, k = 0.5"),
        ("fx * 1e308 ** 2", "1e308 ** 2 has no finite value"),
    ],
)
def test_the_term_that_is_undefined_is_named_with_its_signals(text, words):
    values = {"fx": -0.5, "theta_1": 0.25, "k": 0.5}
    assert Formula(text, NAMES).undefined(values).startswith(words)


def test_parameters_of_an_undefined_term_are_told_in_their_units():
    law = FormulaLaw("own", "frame", np.eye(6)[2], "gap_um / (fz - fz)", (), ("gap_um",))
    effect = Effect(law, "frame").with_values({"gap_um": 2.0})
    model = load_model(shipped_file("config/palmieri2015_model.yaml")).with_effects(effect)
    with pytest.raises(UndefinedFormulaError, match=r"fz = -?\S+, gap_um = 2(,|$)"):
        model.predict(np.zeros(2), Load(np.array([0, 0, -1.0, 0, 0, 0])))


def test_a_lag_follows_a_step_and_a_ramp_as_the_differential_equation_says():
    time = np.array([0.0, 0.5, 0.5, 1.0, 4.0, 9.0])
    ramp = Formula("lag(fx, 2)", NAMES)({"fx": 3.0 * time}, Past(time))
    assert ramp == pytest.approx(3.0 * (time - 2.0 * (1.0 - np.exp(-time / 2.0))), abs=1e-12)
    held = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    step = Formula("lag(fx, 2)", NAMES)({"fx": held}, Past(time))
    assert step[2:] == pytest.approx(1.0 - np.exp(-(time[2:] - 0.5) / 2.0), abs=1e-12)


def test_play_loses_its_slack_at_every_reversal():
    fx = np.array([0.0, 2.0, 1.5, 0.5, -2.0, 0.0])
    followed = Formula("play(fx, 0.5)", NAMES)({"fx": fx}, Past(np.arange(6.0)))
    assert followed == pytest.approx([0.0, 1.5, 1.5, 1.0, -1.5, -0.5])


def test_what_remembers_is_the_same_sample_by_sample_and_needs_a_positive_size():
    rng, made = np.random.default_rng(3), Formula("lag(play(fx, 0.3), 2) * theta_1", NAMES)
    time = np.cumsum(rng.exponential(1.0, 50))
    values = {"fx": np.cumsum(rng.normal(size=50)), "theta_1": rng.normal(size=50)}
    whole = made(values, Past(time))
    past, single = Past(time[:1]), []
    for n in range(50):
        past = Past(time[n : n + 1], past.states)
        single.append(made({name: each[n : n + 1] for name, each in values.items()}, past)[0])
    assert np.array_equal(whole, single)
    assert made.remembers
    assert not Formula("fx * k", NAMES).remembers
    assert not np.isfinite(Formula("lag(fx, -1)", NAMES)({"fx": 1.0})).any()


def test_undefined_values_are_not_finite_and_not_loud():
    assert not np.isfinite(Formula("log(fx)", NAMES)({"fx": -1.0}))
    assert not np.isfinite(Formula("1 / fx", NAMES)({"fx": 0.0}))


@settings(max_examples=300)
@given(st.text(st.sampled_from("fxk012.+-*/()[]{}:,'\"\\ \n\x00=<>&|~^@%!_ébé"), max_size=30))
def test_random_text_is_a_formula_or_one_clear_line(text):
    refusal = ""
    try:
        made = Formula(text, NAMES)
    except InputError as error:
        refusal = str(error)
    assert "\n" not in refusal
    shape = () if refusal or made.count == 1 else (made.count,)
    assert refusal or made({"fx": 1.0, "theta_1": 1.0, "k": 1.0}).shape == shape


def trees():
    leaf = st.one_of(st.sampled_from(NAMES), st.floats(-9.0, 9.0).map(lambda x: f"({x!r})"))
    unary = [name for name, (count, _) in FUNCTIONS.items() if count == 1]
    return st.recursive(
        leaf,
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({''.join(t)})"),
            st.tuples(st.sampled_from(unary), inner).map(lambda t: f"{t[0]}({t[1]})"),
            st.tuples(inner, inner).map(lambda t: f"min({t[0]},{t[1]})"),
        ),
        max_leaves=8,
    )


@settings(max_examples=150)
@given(trees())
def test_allowed_formulas_agree_with_python(text):
    """The oracle is Python's own arithmetic on scalars."""
    variables = {"fx": 1.7, "theta_1": -0.4, "k": 0.25}
    meanings = {name: getattr(math, name, None) for name in FUNCTIONS}
    meanings.update(abs=abs, min=min, max=max, sign=lambda x: float(np.sign(x)))
    if len(text) > LONGEST:
        return
    made = float(Formula(text, NAMES)(variables))
    try:
        expected = eval(text, {"__builtins__": {}}, {**variables, **meanings})
    except (ValueError, ZeroDivisionError, OverflowError):
        return
    assert made == pytest.approx(expected, rel=1e-9, abs=1e-12, nan_ok=True)


def test_a_formula_at_the_load_sensor_is_a_wrench_that_it_does_not_say(model, make):
    """As a sensor's bias of the opposite sign, which has code of its own."""
    block = make.block()
    law = FormulaLaw("pull", "load_sensor", np.array([0, 0, 1.0, 0, 0, 0]), "p_N", (), ("p_N",))
    pull = Effect(law, "load_sensor").with_values({"p_N": 0.3})
    bias = make.effect("load_bias@load_sensor", fz_N=-0.3)
    one, two = model.with_effects().batch_with(block, [(pull,), (bias,)])
    assert np.abs(one.measured).max() > 0.0
    assert np.allclose(one.measured, two.measured, rtol=1e-9, atol=1e-15)


def test_a_formula_at_the_tool_is_a_wrench_that_turns_with_the_platform(model, make):
    block = make.rest((20.0, -15.0), (0.5, -0.7, 1.1), n=2)
    turn = model.table.mechanism.forward(block.theta).rotations["platform"][0]
    along, fy = (
        np.array([0, 0.6, 0.8]),
        " + ".join(
            f"{part!r} * W_f{axis}" for part, axis in zip(turn[:, 1].tolist(), "xyz", strict=True)
        ),
    )
    none, changes = np.zeros(3), []
    for place, way, text in (("tool", along, "fy"), ("load_sensor", turn @ along, f"({fy})")):
        law = FormulaLaw("pull", place, np.append(way, none), f"p_N * {text}", (), ("p_N",))
        changes.append(make.added(model, Effect(law, place).with_values({"p_N": 0.3}), block))
    assert np.abs(turn - np.eye(3)).max() > 0.1
    assert np.abs(changes[0]).max() > 1e-7
    assert np.allclose(*changes, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("place", ["link_2", "tool"])
def test_two_formulas_along_two_directions_are_the_sum_of_both(model, make, place):
    block, along = make.block(), np.array([[0, 0.8, 0.6, 0, 0, 1.0], [1.0, 0, 0, 0.2, 0, 0]])
    key = "p_N" if place == "tool" else "p_um"
    texts = [f"{key} * lag(theta_1, 2)", f"{key} * play(fy, 0.1)"]
    laws = [FormulaLaw(f"n{n}", place, along[n], texts[n], (), (key,)) for n in (0, 1)]
    both = FormulaLaw("both", place, along, ", ".join(texts), (), (key,))
    made = [Effect(law, place).with_values({key: 0.3}) for law in (*laws, both)]
    two, one = model.with_effects().batch_with(block, [tuple(made[:2]), (made[2],)])
    bare = model.with_effects().batch_with(block, [()])[0]
    assert np.abs(one.measured - bare.measured).max() > 1e-9
    assert np.allclose(one.measured, two.measured, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("text", "count"), [("p_um, p_um * fx", 2), ("p_um", 1)])
def test_as_many_formulas_as_directions(text, count):
    for rows in {1, 2, 3} - {count}:
        match = rf"own: .* has commas for {count} formulas, but there are directions for {rows}"
        with pytest.raises(InputError, match=match):
            FormulaLaw("own", "frame", np.eye(6)[:rows], text, (), ("p_um",))
    assert (
        len(FormulaLaw("own", "frame", np.eye(6)[:count], text, (), ("p_um",)).direction) == count
    )


def test_commas_part_whole_formulas_only():
    for text in ("1 + (fx, k)", "((fx, k), k)", "()", "fx,"):
        with pytest.raises(InputError, match="formula .* column .* commas between whole formulas"):
            Formula(text, NAMES)


def test_what_is_remembered_on_several_lines_is_kept_apart():
    """As a YAML block has it: the same column on two lines."""
    names, time = ("a", "b"), np.arange(8.0)
    values = {"a": np.sin(time), "b": np.cos(time)}
    for one, two in (("lag(a, 2)", "lag(b, 3)"), ("lag(a, 2)", "play(b, 0.2)")):
        each = [Formula(text, names)(values, Past(time)) for text in (one, two)]
        both, found = Formula(f"(\n{one},\n{two})", names), []
        past = Past(time[:3])
        for own in (slice(0, 3), slice(3, 8)):
            past = Past(time[own], past.states)
            found.append(both({name: value[own] for name, value in values.items()}, past))
        assert np.concatenate(found) == pytest.approx(np.column_stack(each))


def test_what_is_undefined_by_its_past_is_told():
    formula = Formula("log(lag(a, 2)), 1", ("a",))
    told = formula.undefined({"a": 5.0})
    assert told == "log(lag(a, 2)), 1 has no finite value after what was before"


def test_turns_of_passive_joints_are_those_of_the_bodies_they_join(model):
    theta = np.radians([[20.0, -15.0], [-10.0, 30.0]])
    pose, axes = model.table.mechanism.forward(theta), model.table.geometry.axes
    for joint, (inner, outer) in TURNING.items():
        relative = np.swapaxes(pose.rotations[inner], -1, -2) @ pose.rotations[outer]
        expected = Rotation.from_matrix(relative).as_rotvec()
        assert np.allclose(pose.turn(joint, axes[joint])[:, None] * axes[joint], expected)
