"""One more effect from the catalogue, a file or a formula: found, judged, written, used."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from measured_wrist import measured_in, random_poses

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands import extend as workflow
from wrist_stiffness.commands.extend import FormulaEffect, direction_of, extend_model, own_effect
from wrist_stiffness.commands.provenance import Run
from wrist_stiffness.commands.read_sessions import Recordings
from wrist_stiffness.commands.replay import replay
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.model.model_file import file_sha256, load_model
from wrist_stiffness.model.python_laws import python_laws
from wrist_stiffness.model.registry import effect_named
from wrist_stiffness.report.fit_lines import extension_lines
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.instrument import instrument

RECORDING = Path(__file__).parents[1] / "data" / "wrist_b.mcap"
"""Hides backlash at motor 2."""

SET_UP = ["measurement_frame", "target_mounting", "load_bias"]
BUILT = [
    *("axis_misalignment", "flange_contact", "link_stiffness", "bushing_stiffness"),
    "load_scale",
]

OWN = '''
import numpy as np
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Parameter


class Bow(Law):
    """Bows under the load's vertical force."""

    id = "bow"
    stage = "reaction"
    places = ("platform",)
    sentence = "{place} bows"
    check = "look"
    excited_by = "loads"

    def parameters(self, place):
        return (Parameter("bow_um_per_N", -100.0, 100.0, 3.0),)

    def advance(self, at, place, values, state):
        home = np.zeros((len(at.block), 6))
        home[:, 0] = values["bow_um_per_N"] * at.wrench[:, 2]
        return at.screw(place, home), None
'''


def session_of(model, effect, seed=1, n=60):
    """Return poses of a wrist with one effect, measured one by one; all but the zeros are known."""
    rng = np.random.default_rng(seed)
    block = random_poses(rng, n, 0.7)
    block = replace(block, covariates={"humidity": rng.uniform(30, 60, n)})
    notes = {"calibrated": [*SET_UP, *BUILT]}
    return measured_in(model.with_effects(effect), block, rng, hidden_counts=True, notes=notes)


@pytest.fixture
def extend_by(model, tmp_path, monkeypatch):
    """Extend the shipped model by an addition from a session that is not read from a file."""

    def run(addition, session):
        source = tmp_path / "s.mcap"
        source.write_bytes(b"measured")
        monkeypatch.setattr(workflow, "read_sessions", lambda *_: {source: session})
        monkeypatch.chdir(tmp_path)
        output = tmp_path / "model2.yaml"
        parent = shipped_file("config/palmieri2015_model.yaml")
        run = Run("extend ...", "2026-01-01T00:00:00+00:00")
        return extend_model(parent, addition, Recordings([source], {}), output, run), output

    return run


def test_a_formula_is_fitted_written_and_read_again(model, extend_by):
    addition = FormulaEffect(
        "sag", "link_2", [0, 0, 0, 1, 0, 0], "sag_mdeg * tanh(W_fz / soft_N)", {"soft_N": 0.5}
    )
    true = addition.effect([]).with_values({"sag_mdeg": 150.0, "soft_N": 0.2})
    found, output = extend_by(addition, session_of(model, true))
    size, soft = (
        next(p for p in found.extension.own if p.key == key) for key in ("sag_mdeg", "soft_N")
    )
    # The sign of both together is that of neither.
    assert abs(abs(size.value) - 150.0) < 3.5 * size.sigma
    assert abs(abs(soft.value) - 0.2) < 3.5 * soft.sigma
    assert size.value * soft.value > 0.0
    (line,) = (line for line in extension_lines(found) if "sag_mdeg  " in line)
    assert "typical magnitude" not in line
    before, after = found.before, found.after
    assert after["phi_mdeg"] < 1.3 * found.extension.fit.noise["phi_mdeg"]
    assert before["phi_mdeg"] > 1.5 * after["phi_mdeg"]
    again = {effect.name: effect for effect in load_model(output).effects}["sag@link_2"]
    assert again.law.formula.text == "sag_mdeg * tanh(W_fz / soft_N)"
    assert again.estimates["sag_mdeg"].value == pytest.approx(size.value)
    assert again.estimates["sag_mdeg"].sigma == pytest.approx(size.sigma)


@pytest.mark.parametrize(("text", "told"), [("a_um * (time + 1e4)", True), ("a_um * W_fz", False)])
def test_what_the_set_up_may_hide_is_told(model, extend_by, text, told):
    """A lift that never changes much: where the instrument stands takes all of it up."""
    addition = FormulaEffect("lift", "frame", [0, 0, 1, 0, 0, 0], text, {"a_um": 1.0})
    true = addition.effect([]).with_values({"a_um": 1e-4})
    found, _ = extend_by(addition, replace(session_of(model, true), notes={}))
    said = [line for line in extension_lines(found) if "do not tell it from the set-up" in line]
    assert bool(said) == told


def test_a_formula_may_divide_by_its_parameter(model, extend_by):
    addition = FormulaEffect(
        "lean", "link_2", [0, 0, 0, 1, 0, 0], "lean_mdeg * theta_1 / far_deg", {"far_deg": 20.0}
    )
    true = addition.effect([]).with_values({"lean_mdeg": 150.0})
    found, _ = extend_by(addition, session_of(model, true))
    assert {each.key for each in found.extension.own} == {"lean_mdeg", "far_deg"}


@pytest.mark.parametrize(
    ("expression", "key", "typed", "true"),
    [
        ("lift_um * max(fz, 0) ** power", "power", 1.0, 2.0),
        ("lift_um * lag(fz, tau_s)", "tau_s", 2.0, 5.0),
        ("lift_um * play(fz, slack_N)", "slack_N", 0.5, 0.4),
        # Most multiples of what was typed are above the driest day, and steps lead there.
        ("lift_um * sqrt(humidity - dry)", "dry", 25.0, 30.0),
        # Its first value, 1, is one for which it is undefined.
        ("lift_um * log(wet - humidity)", "wet", 70.0, 65.0),
    ],
)
def test_values_for_which_a_formula_is_undefined_are_not_tried(
    model, extend_by, expression, key, typed, true
):
    up = [0, 0, 1, 0, 0, 0]
    addition = FormulaEffect("plate", "frame", up, expression, {key: typed})
    planted = addition.effect(["humidity"]).with_values({"lift_um": 20.0, key: true})
    found, _ = extend_by(addition, session_of(model, planted))
    for own in found.extension.own:
        assert own.value == pytest.approx({"lift_um": 20.0, key: true}[own.key], abs=3 * own.sigma)
        assert own.sigma < 0.4 * own.value


def test_a_python_class_is_fitted_written_and_read_again(model, extend_by, tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    addition = own_effect(f"{tmp_path}/own.py:Bow@platform")
    (tmp_path / "true").mkdir()
    (tmp_path / "true" / "own.py").write_text(OWN)
    planted = own_effect(f"{tmp_path}/true/own.py:Bow@platform")
    found, output = extend_by(
        addition, session_of(model, planted.with_values({"bow_um_per_N": 20.0}))
    )
    (bow,) = found.extension.own
    # Of any law a share is in doubt, 5 % where it does not say how much.
    assert abs(bow.value - 20.0) < 3.0 * bow.sigma < 0.2 * bow.value
    assert [text for text in found.extension.warnings if "typical magnitude" not in text] == []
    with python_laws(True):
        again = load_model(output)
    assert again.effects[-1].name == "bow@platform"
    assert again.lineage[-1].recordings == {"day": file_sha256(tmp_path / "s.mcap")}
    assert again.lineage[-1].parent_sha256 == file_sha256(
        shipped_file("config/palmieri2015_model.yaml")
    )


def test_an_effect_that_is_not_there_is_added_with_a_word(model, extend_by):
    nothing = effect_named("load_scale@load_sensor")
    found, output = extend_by(
        effect_named("frame_compliance@frame"), session_of(model, nothing, seed=4)
    )
    words = " ".join(found.extension.warnings)
    # Some of its compliances lie on their lower bound, nothing: that is what they are.
    assert any(each.at_bound for each in found.extension.own)
    assert "on its bound" not in words
    assert words.count("not identifiable from these recordings") < 2
    assert "does not fall beyond chance" in words or "GROWS" in words
    assert any(line.startswith("WARNING") for line in extension_lines(found))
    assert "frame_compliance@frame" in {effect.name for effect in load_model(output).effects}


def test_what_moved_in_the_base_is_told(model, extend_by):
    """A wave over the angle that an offset alone had to stand for."""
    wave = effect_named("encoder_eccentricity@motor_1")
    session = session_of(model, wave.with_values({"cos_1_mdeg": 300.0}))
    found, _ = extend_by(effect_named("encoder_eccentricity@motor_1"), session)
    moved = {before.effect for before, _ in found.extension.base_moved}
    assert moved == {"encoder_offset@motor_1"}
    assert "other parameters that changed:" in extension_lines(found)


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        (partial(effect_named, "backlash"), "write NAME@COMPONENT, such as backlash@motor_2$"),
        (partial(effect_named, "backlash@joint_1"), "component 'joint_1' is not one of"),
        (partial(effect_named, "rust@joint_1"), "unknown effect 'rust'"),
        (partial(effect_named, "encoder_offset@motor_1"), "'calibrate' fits it"),
        (partial(effect_named, "thermal_expansion@link_1"), "temperature of ambient is missing"),
        (partial(own_effect, "nothing.py:Bow@platform"), "no file"),
        (partial(own_effect, "nothing.py:Bow"), "such as laws.py:Twist@platform"),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "sin(theta_1)", {}),
            "has no parameter to fit",
        ),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg * lag(fz, b_s)", {"b_s": -1}),
            r"lag\(fz, b_s\) has no finite value for b_s = -1, fz = \S+ 0.000 s after the start",
        ),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg", {"b_mdeg": 1.0}),
            "start value of b_mdeg",
        ),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg * fzz", {}),
            r"fzz is neither .* nor a .*\(fzz_um\), or in a terminal give --start fzz=VALUE",
        ),
        (FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg * (", {}), "formula"),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg * mean(fz)", {}),
            "unknown function mean; known are sin, cos",
        ),
        (
            FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "a_mdeg * __import__('os').x()", {}),
            "only numbers, names, .* the functions sin, cos, .* are allowed",
        ),
    ],
)
def test_what_cannot_be_added_is_one_clear_line(model, extend_by, addition, message, tmp_path):
    session = session_of(model, effect_named("load_scale@load_sensor"))
    with pytest.raises(InputError, match=message):
        extend_by(addition() if callable(addition) else addition, session)
    assert not (tmp_path / "model2.yaml").exists()


def test_a_file_given_as_an_effect_is_led_to_its_option(tmp_path, capsys):
    given = ["--effect", "laws.py:Twist@platform", "--fit", str(RECORDING)]
    assert main(["extend", *given, "-o", str(tmp_path / "m.yaml")]) == 2
    assert "goes after --effect-file" in capsys.readouterr().err


def test_covariates_of_the_recordings_are_no_parameters():
    addition = FormulaEffect("f", "link_2", [0, 0, 0, 1, 0, 0], "swell_um * humidity * fx", {})
    effect = addition.effect(["humidity", "air"])
    assert list(effect.estimates) == ["swell_um"]
    assert effect.law.covariates == ("humidity",)


@pytest.mark.slow
def test_hidden_backlash_is_extended_and_the_nodes_code_uses_it(tmp_path, capsys):
    output, report = tmp_path / "b.yaml", tmp_path / "b.json"
    arguments = ["--effect", "backlash@motor_2", "--fit", str(RECORDING), "-o", str(output)]
    assert main(["extend", *arguments, "--json", str(report)]) == 0
    told = json.loads(report.read_text())
    assert told["before"]["rmse_phi_mdeg"] > 4.0 * told["noise"]["phi_mdeg"]
    # Half a second at 10 Hz: of the true noise the wander stays whole.
    shift = instrument("interferometer").shift
    true_um = 1e6 * np.sqrt(3.0 * (shift.white**2 / 5.0 + shift.wander**2))
    assert told["after"]["rmse_s_um"] < 1.1 * true_um
    assert told["after"]["rmse_phi_mdeg"] < 1.2 * told["noise"]["phi_mdeg"]
    assert (
        "in the fit to the whole session no more than the noise remains" in capsys.readouterr().out
    )
    summary = replay(RECORDING, output, tmp_path / "out.mcap")
    assert summary.predictions == summary.joint_states > 0


@pytest.mark.slow
def test_a_pin_that_rests_elsewhere_does_not_speak_against_its_play(tmp_path, capsys):
    """From the nominal model the part that was seen led to other flanges; `diagnose` named it."""
    day, output, report = (tmp_path / name for name in ("day.mcap", "worn.yaml", "worn.json"))
    play = ["--effect", "joint_clearance@joint_3"]
    assert main(["simulate", "-o", str(day), "--seed", "7", "--base", "wrong", *play]) == 0
    fit = ["--fit", str(day), "-o", str(output), "--json", str(report)]
    assert main(["extend", *play, *fit]) == 0
    told = json.loads(report.read_text())
    for key in ("s_um", "phi_mdeg"):
        assert told["after"][f"rmse_{key}"] < 1.2 * told["noise"][key]
    assert "WARNING" not in capsys.readouterr().out


def test_where_all_else_is_calibrated_the_effect_is_fitted_alone(model, extend_by):
    backlash = effect_named("backlash@motor_1")
    session = session_of(model, backlash.with_values({"width_mdeg": 60.0}))
    notes = {"calibrated": [*SET_UP, *BUILT, "encoder_offset"]}
    found, output = extend_by(backlash, replace(session, notes=notes))
    (width,) = found.extension.parameters
    assert abs(width.value - 60.0) < 3.0 * width.sigma < 0.25 * width.value
    before, after = found.before, found.after
    assert after["phi_mdeg"] < 1.3 * found.extension.fit.noise["phi_mdeg"]
    assert before["phi_mdeg"] > 2.0 * after["phi_mdeg"]
    assert [effect.name for effect in load_model(output).effects] == ["backlash@motor_1"]
    with pytest.raises(InputError, match="nothing is left to calibrate: .*'calibrated'"):
        calibrate(model, [replace(session, notes=notes)])


@pytest.mark.parametrize(
    ("words", "direction"),
    [
        (["along +z"], [0, 0, 1, 0, 0, 0]),
        (["along", "y"], [0, 1, 0, 0, 0, 0]),
        (["about -x"], [0, 0, 0, -1, 0, 0]),
        (["about (-0.38, -0.88, 0.29)"], [0, 0, 0, -0.3795, -0.8787, 0.2896]),
        (["along (1, -2, 2)"], [1 / 3, -2 / 3, 2 / 3, 0, 0, 0]),
        (["along", "0.6", "0", "-0.8"], [0.6, 0, -0.8, 0, 0, 0]),
        (["0", "0", "1e-6", "-1", "0", "0"], [0, 0, 1e-6, -1, 0, 0]),
        (["along +z;", "about -x"], [[0, 0, 1, 0, 0, 0], [0, 0, 0, -1, 0, 0]]),
    ],
)
def test_a_direction_is_taken_in_the_words_of_compare(words, direction):
    assert direction_of(words) == pytest.approx(np.array(direction), abs=1e-4)


@pytest.mark.parametrize("words", ["along (0, 0, 0)", "about (1, inf, 0)", "along nan nan nan"])
def test_an_axis_without_a_direction_is_refused(words):
    with pytest.raises(InputError, match="an axis of length .* has no direction"):
        direction_of([words])


@pytest.mark.parametrize(
    "words",
    [
        "",
        "along +x;",
        "along +x, along +y",
        "up",
        "along",
        "along +w",
        "along 1 2",
        "about 1 2 3 4",
        "1 2 3",
        "0 0 1 0 0 z",
    ],
)
def test_a_direction_that_is_none_is_one_line(words):
    with pytest.raises(
        InputError, match="^direction .*: write six numbers .* 'along .*; several between ';'"
    ):
        direction_of(words.split())


@pytest.mark.parametrize(
    ("screw", "kind"),
    [([0, 0, -1, 0, 0, 0], "along"), ([0, 0, 0, 0.6, 0, -0.8], "about")],
    ids=["shift", "turn"],
)
def test_what_compare_prints_is_what_extend_takes(model, extend_by, screw, kind):
    """A plate moves with the humidity; the sentence's own words name its direction."""
    true = FormulaEffect("plate", "frame", screw, f"plate_{UNIT[kind]} * humidity", {}).effect(
        ["humidity"]
    )
    session = session_of(model, true.with_values({f"plate_{UNIT[kind]}": 2.0}))
    found = compare_models([("m", model)], [session])
    (told,) = (t for t in sentences(found.models[0].explained) if "depends on humidity" in t)
    words = re.search(rf"{kind} (\(.*?\)|[+-][xyz])", told)[0]
    assert direction_of([words]) == pytest.approx(screw, abs=0.07)
    addition = FormulaEffect(
        "plate", "frame", direction_of([words]), f"plate_{UNIT[kind]} * humidity", {}
    )
    extended, _ = extend_by(addition, session)
    (size,) = extended.extension.own
    assert size.value == pytest.approx(2.0, rel=0.05)


UNIT = {"along": "um", "about": "mdeg"}
