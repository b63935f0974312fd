"""Model files: round trip exact, a person can read them, and every mistake is one clear line."""

from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from wrist_stiffness.cli.main import main
from wrist_stiffness.errors import InputError, TableError
from wrist_stiffness.model import registry
from wrist_stiffness.model.block import Load, Sample
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.joint_uncertainty import JointUncertainty
from wrist_stiffness.model.lineage import Step
from wrist_stiffness.model.model_file import file_sha256, load_model, save_model
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.python_laws import ALLOWED, python_laws
from wrist_stiffness.model.registry import catalogue, find_law
from wrist_stiffness.shipped import shipped_file

TABLE = str(shipped_file("precomputed/palmieri2015.npz"))

GOOD = """schema: 1
name: x
table: {path: TABLE}
effects:
- effect: joint_clearance
  component: joint_3
  parameters: {clearance_um: [12.1, 0.4]}
- effect: formula
  id: sag
  component: link_2
  direction: [0, 0, 0, 1, 0, 0]
  expression: "sag_mdeg * tanh(fz / f0_N) + 1e-9 * humidity * T_link_2"
  covariates: [humidity]
  parameters: {sag_mdeg: [2.0, 0.1], f0_N: 0.5}
- effect: python
  class: own.py:Twist
  component: platform
  parameters: {turn_mdeg: [3, 0.5]}
"""

OWN = '''
import numpy as np
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Parameter


class Twist(Law):
    """Turns the platform about z."""

    id = "twist"
    stage = "geometry"
    places = ("platform",)
    sentence = "{place} is turned"
    check = "look"
    excited_by = "anything"

    def parameters(self, place):
        return (Parameter("turn_mdeg", -10.0, 10.0, 1.0),)

    def advance(self, at, place, values, state):
        return at.screw(place, np.array([0, 0, 0, 0, 0, values["turn_mdeg"]])), None
'''


@pytest.fixture(autouse=True)
def _trusted():
    with python_laws(True):
        yield


def write(folder, text=GOOD, own=OWN):
    (folder / "own.py").write_text(own)
    path = folder / "m.yaml"
    path.write_text(text.replace("TABLE", TABLE))
    return path


def test_a_users_own_laws_work(tmp_path):
    model = load_model(write(tmp_path))
    sample = Sample(
        0.0, np.radians([20.0, -10.0]), Load(np.array([0.2, 0.3, -1.0, 0.0, 0.0, 0.0])),
        temperatures={"link_2": 25.0}, covariates={"humidity": 40.0},
    )  # fmt: skip
    by_own = (
        model.session().advance(sample).twist
        - model.with_effects(*model.effects[:2]).session().advance(sample).twist
    )
    axis = model.table.mechanism.forward(sample.theta).platform[:, 2]
    assert np.allclose(by_own, [0, 0, 0, *(np.radians(3e-3) * axis)], atol=1e-12)
    by_formula = model.with_effects(model.effects[1]).session().advance(sample)
    base = model.with_effects().session().advance(sample)
    assert np.linalg.norm(by_formula.twist - base.twist) > 1e-7
    assert model.effects[0].si == {"clearance_um": 12.1e-6}


def test_round_trip_is_exact_and_stable(tmp_path):
    model = load_model(write(tmp_path))
    hashes = {"run_1": "cd" * 32}, {"run_1": "ef" * 32}
    step = Step("extend", "2026-01-02T03:04:05Z", "ab" * 32, *hashes, "creep@joint_1")
    saved = tmp_path / "saved.yaml"
    save_model(replace(model, lineage=(step,)), saved)
    again = load_model(saved)
    assert [e.name for e in again.effects] == [e.name for e in model.effects]
    assert [e.estimates for e in again.effects] == [e.estimates for e in model.effects]
    assert again.lineage == (step,)
    assert again.table.checksum == model.table.checksum
    twice = tmp_path / "twice.yaml"
    save_model(again, twice)
    assert twice.read_bytes() == saved.read_bytes()
    assert file_sha256(twice) == file_sha256(saved)
    assert "clearance_um: [12.1, 0.4]" in saved.read_text()
    assert not list(tmp_path.glob(".*.part"))


STEP = """lineage:
- {command: extend, date: '2026-01-02', parent_sha256: ab, recordings: {}, added: NAME}
"""


@pytest.mark.parametrize("name", ["joint_clearance@joint_3", "sag@link_2", "creep@joint_1"])
def test_a_step_has_added_an_effect_of_the_file_or_one_that_was_taken_out_since(tmp_path, name):
    (step,) = load_model(write(tmp_path, GOOD + STEP.replace("NAME", name))).lineage
    assert step.added == name


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("crep@joint_1", r"unknown effect 'crep'; did you mean creep\? known are axis"),
        ("creep@joint_9", "creep: component 'joint_9' is not one of joint_1"),
        ("creep", "creep: component '' is not one of joint_1"),
        ("sagging@link_2", "unknown effect 'sagging'"),
    ],
)
def test_a_step_that_has_added_no_effect_is_one_line(tmp_path, name, why):
    """The next fit would take what was found for a tolerance, and leave it out."""
    path = write(tmp_path, GOOD + STEP.replace("NAME", name))
    place = rf"m.yaml, line 20: lineage\[0\].added: {name}"
    there = f"{place} is neither .* nor one of the catalogue: {why}"
    with pytest.raises(InputError, match=there):
        load_model(path)


@pytest.mark.parametrize("name", ["twist", "platform_compliance"])
def test_a_law_that_no_file_holds_is_refused_also_by_a_name_of_the_catalogue(model, tmp_path, name):
    script = {"__name__": "script"}
    exec(OWN.replace('"twist"', f'"{name}"'), script)
    path = tmp_path / "m.yaml"
    effect = Effect(script["Twist"](), "platform", {"turn_mdeg": Estimate(3.0, 0.5)})
    own = model.with_effects(*model.effects, effect)
    with pytest.raises(InputError) as caught:
        save_model(own, path)
    assert str(caught.value) == (
        f"{path}: {name}@platform cannot be saved: its class Twist has to come from a file, see "
        "docs/python.md"
    )
    assert not path.exists()


def test_saved_elsewhere_the_paths_still_lead_to_table_and_law(tmp_path):
    model = load_model(write(tmp_path))
    folder = tmp_path / "deep" / "er"
    folder.mkdir(parents=True)
    save_model(model, folder / "m.yaml")
    assert [e.name for e in load_model(folder / "m.yaml").effects] == [
        e.name for e in model.effects
    ]


@settings(max_examples=25)
@given(data=st.data())
def test_every_law_and_value_survives_the_file(model, tmp_path_factory, data):
    laws = list(catalogue().values())
    effects = {}
    for law in data.draw(st.lists(st.sampled_from(laws), max_size=4)):
        place = data.draw(st.sampled_from(law.places))
        estimates = {
            p.key: Estimate(data.draw(st.floats(p.lower, p.upper)), data.draw(st.floats(0.0, 1e6)))
            for p in law.parameters(place)
        }
        effects[law.id, place] = Effect(law, place, estimates)
    path = tmp_path_factory.mktemp("m") / "m.yaml"
    save_model(model.with_effects(*effects.values()), path)
    again = load_model(path)
    assert [(e.name, e.estimates) for e in again.effects] == [
        (e.name, e.estimates) for e in effects.values()
    ]


def test_a_python_file_is_not_run_unasked(tmp_path, monkeypatch):
    monkeypatch.setenv(ALLOWED, "")
    path = write(tmp_path, own=f"__import__('os').mkdir({str(tmp_path / 'run')!r})\n{OWN}")
    with python_laws(False), pytest.raises(InputError, match="own.py:Twist is a program"):
        load_model(path)
    command = ["predict", str(path), "--angles", "0", "0", "--load", "0", "0", "0", "0", "0", "0"]
    assert main(command) == 2
    assert not (tmp_path / "run").exists()
    main([*command, "--allow-python-laws"])
    assert (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("schema: 1", "schema: 7", "7 is not 1"),
        ("name: x\n", "", "name is missing"),
        ("effect: joint_clearance", "effect: magic", "unknown effect 'magic'; known are axis_mis"),
        ("component: joint_3", "component: joint_9", "component 'joint_9' is not one of joint_1"),
        ("component: joint_3", "component: motor_1", "component 'motor_1' is not one of joint_1"),
        ("clearance_um", "clearance_mm", "unknown parameter clearance_mm; it has clearance_um"),
        ("[12.1, 0.4]", "[12000, 0.4]", "clearance_um = 12000 is outside 0 to 2000"),
        ("[12.1, 0.4]", "[12.1, -1]", "uncertainty -1 of clearance_um"),
        ("[12.1, 0.4]", "[12.1]", "is not a list of 2 finite numbers"),
        ("[12.1, 0.4]", "[.nan, 0.1]", "is not a list of 2 finite numbers"),
        ("[12.1, 0.4]", "much", "clearance_um: 'much' is not a finite number"),
        (
            "[12.1, 0.4]",
            "1e1",
            "clearance_um: '1e1' is not a finite number: YAML takes it for a text, write 10.0",
        ),
        (
            "{clearance_um: [12.1, 0.4]}",
            "\n      clearance_um: 0,33",
            "clearance_um: '0,33' is not a finite number: write 0.33, with a decimal point",
        ),
        ("component: joint_3\n", "component: joint_3\n  33:\n", "key 33: numbers have a decimal"),
        ("effects:\n", "effects: 3\nx:\n", "3 is not a list"),
        ("component: joint_3\n", "component: joint_3\n  color: red\n", "unknown key color"),
        ("- effect: joint_clearance", "- 7\n- effect: joint_clearance", r"effects\[0\]: 7 is not"),
        ("component: link_2", "component: pose_sensor", "component 'pose_sensor' is not one of"),
        ("id: sag", "id: sag@link_2", "effect 'sag@link_2': a name has letters"),
        ("id: sag", "id: ''", "effect '': a name has letters"),
        ("[0, 0, 0, 1, 0, 0]", "[0, 0, 1]", "is not a list of 6 finite numbers"),
        ("[0, 0, 0, 1, 0, 0]", "[[0, 0, 0, 1, 0, 0], [1]]", r"\[1\] is not a list of 6 finite"),
        ("[0, 0, 0, 1, 0, 0]", "[[0, 0, 0, 1, 0, 0], 7]", "7 is not a list of 6 finite numbers"),
        ("[0, 0, 0, 1, 0, 0]", "[[0, 0, 0, 1, 0, 0], [1, 0, 0, 0, 0, 0]]", "directions for 2"),
        ("[0, 0, 0, 1, 0, 0]", "[0, 0, 0, 0, 0, 0]", "is not six finite numbers, one not zero"),
        ("tanh(fz", "tang(fz", "column 12: unknown function tang"),
        ("[humidity]", "humidity", "covariates: .humidity. is not a list"),
        ("[humidity]", "[humidity, fz]", "the name fz is in use"),
        ("[humidity]", "['a b', humidity]", "'a b' is not a name"),
        ("[humidity]", "[]", "column 37: unknown name humidity"),
        ("own.py:Twist", "own.py:Turn", "own.py has no class Turn"),
        ("own.py:Twist", "none.py:Twist", "none.py"),
        ("own.py:Twist", "own.py:np", "is not a class derived from Law"),
        ("own.py:Twist", "own.py:Law", "Law does not define parameters"),
        ("own.py:Twist", "Twist", "write FILE.py:CLASS"),
        ("[3, 0.5]", "[30, 0.5]", "turn_mdeg = 30 is outside -10 to 10"),
    ],
)
def test_bad_model_files_give_one_line(tmp_path, old, new, text):
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new))
    with pytest.raises(InputError, match=text) as caught:
        load_model(path)
    assert "m.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


LINEARISED = """def linearised(self, place, signals):
        from wrist_stiffness.model.columns import at_usual_size
        return at_usual_size(Parameter("turn", -10.0, 10.0, 1.0), 1.0)

    """


@pytest.mark.parametrize(
    ("own", "text"),
    [
        ("raise RuntimeError('no')", "cannot be run: no"),
        ("import does_not_exist", "cannot be run: No module"),
        ("def (", "cannot be run"),
        (OWN.replace('    check = "look"\n', ""), "Twist does not define check"),
        (OWN.replace('id = "twist"', 'id = "twist@z"'), "effect 'twist@z': a name has letters"),
        ("raise SystemExit(3)", "cannot be run: it ends the program"),
        (
            OWN.replace('stage = "geometry"', 'stage = "geometri"'),
            "stage 'geometri' of Twist is not",
        ),
        (OWN.replace("return (Parameter(", "return (Parametre("), "NameError: name 'Parametre'"),
        (
            OWN.replace("return (Parameter(", "return ()\n        return (Parameter("),
            "own.py:Twist: Twist has no parameter to fit at platform; multiply what it does by one",
        ),
        (OWN.replace("10.0, 1.0)", "10.0, 0.0)"), "turn_mdeg: scale = 0.0 is not above 0"),
        (
            OWN.replace("10.0, 1.0)", "10.0, 1.0, grid=(2, 1))"),
            "turn_mdeg: grid .* not two or more",
        ),
        (
            OWN.replace("def adv", LINEARISED + "def adv"),
            r"linearised\('platform'\): KeyError: 'turn'",
        ),
        (
            OWN.replace("    stage =", "    inexactness = 3\n    stage ="),
            "inexactness = 3 is not from 0",
        ),
        (
            OWN.replace('stage = "geometry"', 'stage = "friction"\n    state_is_a_guess = True'),
            "the state of Twist, a friction, cannot be a guess",
        ),
        (OWN.replace("def advance", "def advanse"), "Twist does not define advance or added"),
        (OWN.replace("def advance", "def together"), "Twist does not define advance or added"),
        (OWN.replace('"geometry"', '"parts"'), "Twist does not define changed"),
        (
            OWN.replace("    stage =", "    def __init__(self, size): ...\n    stage ="),
            r"own.py:Twist: Twist\(\): TypeError: .* missing 1 required",
        ),
        (
            OWN.replace('"{place} is turned"', '"{plate} is turned"'),
            r"own.py:Twist: sentence\('platform'\): KeyError: 'plate'",
        ),
    ],
)
def test_bad_law_files_give_one_line(tmp_path, own, text):
    with pytest.raises(InputError, match=text):
        load_model(write(tmp_path, own=own))


@pytest.mark.parametrize(
    ("body", "text"),
    [
        (
            "return 1 / 0, None",
            "twist@platform: ZeroDivisionError: division by zero \\(own.py, line",
        ),
        ("return Contribution(wrench=np.zeros((2, 6))), None", r"wrench has shape \(2, 6\)"),
        ("return Contribution(both=np.full((1, 6), np.nan)), None", "both is not finite"),
        ("return at.screw(place, 1j * np.ones((1, 6))), None", "both holds complex128, not real"),
        ("return None, None", "twist@platform: AttributeError"),
        ("return 3", "twist@platform: TypeError"),
        ("raise SystemExit(0)", "twist@platform: SystemExit: 0"),
        ("return at.screw(place, np.zeros(6) + at.covariate('wind')[:, None]), None", None),
    ],
)
def test_a_broken_law_of_ones_own_is_one_clear_error(tmp_path, body, text):
    """And one that lacks its signal is left out like any other."""
    start = OWN.index("        return at.screw")
    own = OWN[:start] + f"        {body}\n"
    own = own.replace("import Law\n", "import Contribution, Law\n")
    model = load_model(write(tmp_path, own=own))
    model = model.with_effects(model.effects[-1])
    if text is None:
        said = model.predict(np.zeros(2), Load(np.zeros(6))).warnings
        assert said == ("twist@platform: covariate wind is missing, left out",)
        return
    with pytest.raises(InputError, match=text) as caught:
        model.predict(np.zeros(2), Load(np.zeros(6)))
    assert "twist@platform" in str(caught.value)


def test_the_line_of_a_broken_law_is_told_of_a_model_in_this_folder(tmp_path, monkeypatch):
    write(tmp_path, own=OWN.replace("return at", "1 / 0; return at"))
    monkeypatch.chdir(tmp_path)
    model = load_model("m.yaml")
    with pytest.raises(InputError, match=r"ZeroDivisionError: .* \(own.py, line \d+\)"):
        model.with_effects(model.effects[-1]).predict(np.zeros(2), Load(np.zeros(6)))


def test_twice_the_same_effect_is_refused(tmp_path):
    first = GOOD[GOOD.index("- effect: joint") : GOOD.index("- effect: formula")]
    with pytest.raises(InputError, match="joint_clearance@joint_3 is there twice"):
        load_model(write(tmp_path, GOOD.replace(first, first + first)))


def test_changed_parts_need_the_closed_form(tmp_path):
    text = GOOD.replace("effects:\n", "evaluation: spline\neffects:\n").replace(
        "joint_clearance\n  component: joint_3\n  parameters: {clearance_um: [12.1, 0.4]}",
        "link_stiffness\n  component: link_1\n  parameters: {flexibility_percent: 5}",
    )
    with pytest.raises(InputError, match="needs evaluation: closed_form"):
        load_model(write(tmp_path, text))


def test_a_model_without_a_file_of_its_table_cannot_be_saved(model, tmp_path):
    with pytest.raises(InputError, match="not read from a file"):
        save_model(replace(model, table_file=None), tmp_path / "m.yaml")
    with pytest.raises(InputError, match="cannot be written"):
        save_model(model, tmp_path / "none" / "m.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        file_sha256(tmp_path / "none.yaml")


def test_a_model_file_with_a_name_that_is_too_long_is_none(tmp_path):
    with pytest.raises(InputError, match="File name too long"):
        load_model(tmp_path / f"{300 * 'm'}.yaml")


@pytest.mark.parametrize("name", ["no", 300 * "n"])
def test_model_without_its_table(tmp_path, name):
    text = f"schema: 1\nname: x\ntable: {{path: {name}.npz}}\neffects: []\n"
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(TableError, match=r"m.yaml, line 3: table.path: .*relative to the model"):
        load_model(tmp_path / "m.yaml")


def test_other_packages_offer_laws_by_entry_point(monkeypatch, tmp_path):
    module = tmp_path / "foreign_laws.py"
    module.write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)

    def offered(value):
        point = metadata.EntryPoint("twist", value, registry.ENTRY_POINTS)
        monkeypatch.setattr(registry.metadata, "entry_points", lambda group: [point])
        registry.catalogue.cache_clear()

    try:
        offered("foreign_laws:Twist")
        assert registry.find_law("twist").places == ("platform",)
        offered("foreign_laws:np")
        with pytest.raises(InputError, match="entry point twist: .* is not a class"):
            registry.catalogue()
        offered("no_such_package:Twist")
        with pytest.raises(InputError, match="entry point twist: no_such_package"):
            registry.catalogue()
        taken = tmp_path / "taken_name.py"
        taken.write_text(OWN.replace('id = "twist"', 'id = "creep"'))
        offered("taken_name:Twist")
        with pytest.raises(InputError, match="entry point twist: the name creep is in use"):
            registry.catalogue()
    finally:
        monkeypatch.undo()
        registry.catalogue.cache_clear()


def test_joint_uncertainty_counts_once_and_survives_writing(tmp_path):
    """Two twins that a fit told only together: their own uncertainties would say 40 mdeg."""
    sigma = np.array([1e-7, 2e-7, 3e-7, 1e-5, 2e-5, 3e-5])
    measured = 0.1 * sigma
    twins = (
        Effect(find_law("encoder_offset"), "motor_1", {"offset_mdeg": Estimate(3.0, 40.0)}),
        Effect(find_law("backlash"), "motor_2", {"width_mdeg": Estimate(10.0, 1.0)}),
    )
    plain = load_model(shipped_file("config/palmieri2015_model.yaml")).with_effects(*twins)
    fitted = replace(plain, joint=JointUncertainty((twins[0].name,), measured, sigma))
    save_model(fitted, tmp_path / "m.yaml")
    again = load_model(tmp_path / "m.yaml")
    assert again.joint.effects == (twins[0].name,)
    assert np.allclose(again.joint.measured, measured, rtol=1e-12)
    assert np.allclose(again.joint.platform, sigma, rtol=1e-12)
    older = yaml.safe_load((tmp_path / "m.yaml").read_text())
    joint = older["joint_uncertainty"]
    older["joint_uncertainty"] = {k: v for k, v in joint.items() if not k.startswith("platform")}
    (tmp_path / "older.yaml").write_text(yaml.safe_dump(older))
    before = load_model(tmp_path / "older.yaml").joint
    assert np.allclose(before.platform, measured, rtol=1e-12)
    assert [len(each.variations) for each in (plain, again)] == [4, 2]
    sample = Sample(0.0, np.radians([10.0, 5.0]), Load(np.zeros(6)))
    covariance = again.session().advance(sample).covariance
    certain = Effect(find_law("encoder_offset"), "motor_1", {"offset_mdeg": Estimate(3.0)})
    other = again.with_effects(certain, twins[1])
    without = replace(other, joint=None).session().advance(sample).covariance
    assert np.allclose(covariance - without, np.diag(sigma**2), rtol=1e-9, atol=1e-22)
    assert plain.session().advance(sample).covariance[3, 3] > np.radians(0.03) ** 2
