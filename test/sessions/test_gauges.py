"""Dial gauges and inclinometers: rows of the error twist, imported, held to the wrist, compared."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wrist_stiffness.analysis import Analysis
from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.comparing.compare import compare_models
from wrist_stiffness.comparing.comparison import lengths
from wrist_stiffness.comparing.sentences import sentences
from wrist_stiffness.errors import InputError
from wrist_stiffness.identification.calibration import calibrate
from wrist_stiffness.identification.wrist_diagnosis import diagnose_sessions
from wrist_stiffness.mechanism.rigid_motion import exp_twist
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions.gauges import Gauge, Gauges
from wrist_stiffness.sessions.observing import tabulate, without_mounting
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.sessions.unit_session import all_units
from wrist_stiffness.simulation.catalogue import HiddenEffect
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.web.bench import Bench
from wrist_stiffness.web.figures import Shown, quantity_label, strongest, time_line

UP = np.array([0.0, 0.0, 1.0])
NONE = np.zeros(3)
GAUGES_YAML = """\
schema: 1
gauges:
  - {column: a_um, point_mm: [25, 0, -12], direction: [0, 0, 1]}
  - {column: b_um, point_mm: [-12, 22, -12], direction: [0, 0, 1]}
  - {column: c_um, point_mm: [-12, -22, -12], direction: [0, 0, 1]}
  - {column: d_um, point_mm: [0, 0, -30], direction: [1, 0, 0]}
  - {column: e_um, point_mm: [0, 0, -30], direction: [0, 2, 0]}
  - {column: level_mdeg, direction: [1, 0, 0]}
"""
GAUGES = (
    Gauge("a", UP, np.array([0.025, 0.0, -0.012])),
    Gauge("b", UP, np.array([-0.012, 0.022, -0.012])),
    Gauge("c", UP, np.array([-0.012, -0.022, -0.012])),
    Gauge("d", np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -0.03])),
    Gauge("e", np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -0.03])),
    Gauge("level", np.array([1.0, 0.0, 0.0])),
)
PER_SI = np.array([1e6] * 5 + [np.degrees(1e3)])
NOISE = np.array([0.5e-6] * 5 + [np.radians(1e-3)])
SETTINGS = "time_s,motor_1_deg,motor_2_deg,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm"
ZEROS = np.array([1e-3, -2e-3, 0.0, 5e-4, 3e-3, 2e-3])


def conditions(count=90, seed=2):
    """Poses measured one by one, 5 s apart, each under a load of its own."""
    rng = np.random.default_rng(seed)
    theta = np.radians(np.round(rng.uniform(-25.0, 25.0, (count, 2)), 2))
    load = np.round(rng.normal(size=(count, 6)) * np.repeat([0.5, 0.01], 3), 4)
    return Block(5.0 * np.arange(count), theta, load)


def readings_of(model, block, gauges=GAUGES, zeros=ZEROS, seed=3, noise=1.0):
    """What gauges read of a wrist that is the model, (n, K) [m, rad]."""
    rotation, shift = exp_twist(model.batch(block).measured)
    rotation = rotation @ model.table.mechanism.platform_rotation(block.theta)
    read = np.stack([each.reading(shift, rotation, UP) for each in gauges], axis=1)
    return read + zeros + noise * NOISE * np.random.default_rng(seed).normal(size=read.shape)


def imported(folder, block, readings, header="a_um,b_um,c_um,d_um,e_um,level_mdeg"):
    """Return the recording of the table that a technician would have written."""
    cells = np.column_stack(
        [
            block.time,
            np.degrees(block.theta),
            block.load,
            np.round(readings * PER_SI[: readings.shape[1]], 2),
        ]
    )
    table, gauges = folder / "gauges.csv", folder / "gauges.yaml"
    lines = (",".join(f"{cell:.10g}" for cell in row) for row in cells)
    table.write_text("\n".join([f"{SETTINGS},{header}", *lines, ""]))
    described = GAUGES_YAML.splitlines(keepends=True)
    gauges.write_text("".join(described[: 2 + readings.shape[1]]))
    return import_csv(table, folder / "bag.mcap", gauges_file=gauges).recording


def test_twists_and_mountings_change_readings_as_levers_and_arrows_say(table):
    """A dial shows the way of its ball, a level the turn about the axis across arrow and plumb."""
    theta, gauges = conditions(7).theta, Gauges(GAUGES, table.mechanism, UP)
    turned = table.mechanism.platform_rotation(theta)
    rows, mountings = gauges.rows(theta), gauges.common(theta)
    for number, each in enumerate(GAUGES[:-1]):
        lever = np.cross(turned @ each.point, each.direction)
        way = np.broadcast_to(each.direction, lever.shape)
        assert rows[:, number] == pytest.approx(np.hstack([way, lever]), abs=1e-7)
        own = mountings[:, number, 6 * number : 6 * number + 4]
        assert own[:, 0] == pytest.approx(0.02)
        ball = 1e-3 * np.einsum("nij,i->nj", turned, each.direction)
        assert own[:, 1:] == pytest.approx(ball, abs=1e-9)
    arrow = turned @ GAUGES[-1].direction
    across = np.cross(arrow, UP) / np.linalg.norm(np.cross(arrow, UP), axis=1, keepdims=True)
    assert rows[:, -1] == pytest.approx(np.hstack([0.0 * across, across]), abs=1e-7)
    assert mountings[:, -1, 30] == pytest.approx(0.1)


def test_a_gauge_is_the_projected_pose_of_a_tracker(tmp_path, model, table):
    """What is left of readings is what is left of poses along each gauge, but for its mounting."""
    block = conditions()
    session = read_session(imported(tmp_path, block, readings_of(model, block)), table)
    seen = tabulate(model, all_units(model, [session]))
    left = without_mounting(seen.observations, seen.observations.values)
    assert left.shape == (len(block), len(GAUGES))
    # Digits of the table beside the noise; mountings take up six numbers of each gauge.
    assert np.all(left.std(axis=0) < 1.3 * np.hypot(NOISE, 0.01 / np.sqrt(12.0) / PER_SI))
    assert [q.key for q in seen.observations.reported] == ["gauges_um", "tilts_mdeg"]


def test_in_motion_readings_are_means_of_what_is_read_along_the_way(tmp_path, model, table):
    """Half a second of a fast motion, bows and all, leaves nothing but the digits of the table."""
    turned = Effect(find_law("backlash"), "motor_2").with_values({"width_mdeg": 60.0})
    time = 0.1 * np.arange(300)
    theta = 0.45 * np.sin(np.outer(time, [1.3, 1.0]))
    block = Block(time, theta, np.zeros((300, 6)))
    off = tuple(
        Gauge(each.name, each.direction, None if each.point is None else each.point + 3e-4)
        for each in GAUGES
    )
    true = model.with_effects(turned)
    session = read_session(
        imported(tmp_path, block, readings_of(true, block, off, noise=0.0)), table
    )
    seen = tabulate(true, all_units(true, [session])).observations
    left = without_mounting(seen, seen.values)
    digits = 0.01 / np.sqrt(12.0) / PER_SI
    assert np.all(left.std(axis=0) < 3.0 * digits)


def test_a_mounting_off_by_millimetres_and_degrees_is_found_and_said(tmp_path, model, table):
    """To first order alone it would leave tens of micrometres."""
    block, rng = conditions(), np.random.default_rng(8)
    true = tuple(
        Gauge(
            each.name,
            Rotation.from_rotvec(np.radians(2.0) * rng.normal(size=3)).apply(each.direction),
            None if each.point is None else each.point + 1e-3 * rng.normal(size=3),
        )
        for each in GAUGES
    )
    path = imported(tmp_path, block, readings_of(model, block, true))
    session = read_session(path, table)
    assert any("mm from its point" in remark for remark in session.remarks)
    seen = tabulate(model, all_units(model, [session]))
    left = without_mounting(seen.observations, seen.observations.values)
    assert np.all(left.std(axis=0) < 1.3 * np.hypot(NOISE, 0.01 / np.sqrt(12.0) / PER_SI))


@pytest.mark.parametrize(
    ("column", "factor", "told"),
    [
        (0, -1.0, "gauge a.*times -1 .*count up when the ball moves"),
        (3, 1e-3, "gauge d.*times 1000 .*in mm where um belong, or in m where mm belong"),
        (3, 1.0 / 25.4, "gauge d.*times 25.4 .*in inches where mm belong"),
        (4, 1e3, "gauge e.*times 0.001 .*in um where mm belong"),
        (5, -1.0, "gauge level.*times -1 .*count up when the arrow moves"),
        (5, np.pi / 180.0, "gauge level.*in rad where deg belong"),
        (5, 1e-3, "gauge level.*times 1000 .*in deg where mdeg belong"),
        (0, 0.0, "gauge a.*check .*that its tip touches the ball at every pose"),
    ],
)
def test_a_wrong_sign_or_unit_is_told(tmp_path, model, table, column, factor, told):
    block = conditions(30)
    readings = readings_of(model, block)
    readings[:, column] *= factor
    with pytest.raises(InputError, match=told):
        read_session(imported(tmp_path, block, readings), table)


def test_a_wrong_sign_at_a_single_pose_is_told_by_the_loads(tmp_path, model, table):
    block = conditions(60)
    block = replace(block, theta=np.tile(np.radians([12.0, -7.0]), (60, 1)))
    readings = readings_of(model, block)
    readings[:, 1] *= -1.0
    session = read_session(imported(tmp_path, block, readings), table)
    found = compare_models([("nominal", model)], [session])
    assert "with the sign of gauge b turned the error falls" in found.mistake


@pytest.mark.parametrize(("percent", "told"), [(0.0, "nothing"), (200.0, "the load")])
def test_what_is_told_of_a_sound_and_of_a_soft_link(tmp_path, model, table, percent, told):
    """No dwell tells the noise: the level scatters four times what is usual, gauges half."""
    soft = Effect(find_law("link_stiffness"), "link_1").with_values(
        {"flexibility_percent": percent}
    )
    block = conditions(200)
    path = imported(tmp_path, block, readings_of(model.with_effects(soft), block))
    (found,) = compare_models([("nominal", model)], [read_session(path, table)]).models
    said = sentences(found.explained)
    assert f"depends on {told}" in said[0]
    if percent:
        assert re.search(r"moves by \S+ \+- \S+ um most at gauge [abc]\.", said[0])
    assert not any("with time" in each for each in said)


def test_two_columns_that_changed_places_are_told(tmp_path, model, table):
    block = conditions(30)
    readings = readings_of(model, block)[:, [1, 0, 2, 3, 4, 5]]
    with pytest.raises(InputError, match="gauge a reads as if .* from its point"):
        read_session(imported(tmp_path, block, readings), table)


def test_readings_one_after_the_other_tell_the_same(tmp_path, model, table):
    """One gauge a row, blanks for the others: as in a workshop with a single one."""
    block = conditions(180)
    readings = readings_of(model, block)
    rows, columns = np.indices(readings.shape)
    readings[rows % len(GAUGES) != columns] = np.nan
    session = read_session(imported(tmp_path, block, readings), table)
    assert np.all(session.measured.sum(axis=1) <= 1)
    assert session.measured.sum() == len(block)
    seen = tabulate(model, all_units(model, [session])).observations
    left = without_mounting(seen, seen.values)
    assert np.nanstd(left[:, 0]) < 2.0 * NOISE[0]


@pytest.mark.slow
def test_a_soft_link_is_calibrated_with_gauges(tmp_path, model, table):
    soft = Effect(find_law("link_stiffness"), "link_1").with_values({"flexibility_percent": 60.0})
    block = conditions(200)
    path = imported(tmp_path, block, readings_of(model.with_effects(soft), block))
    found = calibrate(model, [read_session(path, table)])
    (own,) = (p for p in found.parameters if p.effect == soft.name)
    assert abs(own.value - 60.0) < 4.0 * own.sigma
    assert own.sigma < 15.0
    assert found.after["gauges_um"] < 0.5 * found.before["gauges_um"]


def test_what_is_shown_of_gauges_lacks_their_zeros(tmp_path, model, table):
    block = conditions(200)
    session = read_session(imported(tmp_path, block, readings_of(model, block)), table)
    analysis = Analysis(model, [session])
    view, (told,) = analysis.view(), analysis.contents()
    assert view.measured.shape == view.left.values.shape
    shown = view.left.rms(np.nan_to_num(view.left.values) ** 2)
    for key, noise in view.noise.items():
        assert shown[key] < 1.2 * noise
        assert told.registered[key] < 1.2 * noise


@pytest.mark.slow
def test_five_gauges_name_the_backlash_of_a_virtual_wrist_and_its_size(tmp_path, model, table):
    """The cell knows nothing of the model's laws, its wrist deviates within its tolerances."""
    hidden = HiddenEffect("backlash", "motor_2", "single", 1e-3, 5)
    settings = CellSettings(
        rate_hz=10.0, program_seconds=60.0, program_seed=41, hidden=(hidden,), base="wrong"
    )
    cell = VirtualCell(table, settings, np.random.default_rng(3))
    time = 0.1 * np.arange(600)
    sample = cell.run(time, cell.desired(time))
    five = GAUGES[:5]
    own = [each.reading(sample.pose_shift, sample.pose_rotation, UP) for each in five]
    noise = NOISE[:5] * np.random.default_rng(1).normal(size=(600, 5))
    readings = np.stack(own, axis=1) + ZEROS[:5] + noise
    block = Block(time, sample.encoder, sample.wrench)
    path = imported(tmp_path, block, readings, "a_um,b_um,c_um,d_um,e_um")
    found = diagnose_sessions(model, [read_session(path, table)]).diagnosis
    assert [each.name for each in found.findings] == ["backlash@motor_2"]
    # What gauges cannot tell from their own mountings is not fitted beside them.
    assert not [each for each in found.absorbed if "pose_sensor" in each]
    value, sigma = found.findings[0].parameters["width_mdeg"]
    assert abs(value - np.degrees(1e-3) * 1e3) < 3.0 * sigma
    assert sigma < 6.0
    assert found.after["gauges_um"] < 1.3 * found.noise["gauges_um"]
    assert found.before["gauges_um"] > 3.0 * found.after["gauges_um"]


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        ("a_um, point_mm: [25, 0, -12]", "a_um", "a dial gauge needs a point_mm"),
        ("level_mdeg", "level_mdeg, point_mm: [0, 0, 1]", "an inclinometer has no point_mm"),
        ("[0, 2, 0]", "[0, 0, 0]", "is no direction"),
        ("a_um", "a_furlong", "no name with its unit"),
        ("b_um", "a_mm", "'a' is there twice"),
        ("a_um", "f_um", "column f_um of the gauges is missing"),
    ],
)
def test_a_wrong_description_is_refused(tmp_path, was, now, told):
    gauges = tmp_path / "gauges.yaml"
    gauges.write_text(GAUGES_YAML.replace(was, now))
    table = tmp_path / "t.csv"
    table.write_text(f"{SETTINGS},a_um,b_um,c_um,d_um,e_um,level_mdeg\n")
    with pytest.raises(InputError, match=told):
        import_csv(table, tmp_path / "bag.mcap", gauges_file=gauges)


@pytest.mark.parametrize(
    "ask", [calibrate, diagnose_sessions, lambda model, both: compare_models([("m", model)], both)]
)
def test_gauges_and_poses_are_asked_one_after_the_other(tmp_path, model, table, ask, in_the_cell):
    session = in_the_cell(table, CellSettings(rate_hz=10.0, program_seconds=20.0), 3)
    block = conditions(30)
    read = read_session(imported(tmp_path, block, readings_of(model, block)), table)
    told = r"bag.mcap was measured by gauges \(a, b, c, d, e, level\), .* by poses: ask of them"
    with pytest.raises(InputError, match=told):
        ask(model, [read, session])


def test_where_gauges_stand_no_registration_says(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["import", "a.csv", "-o", "bag", "--gauges", "gauges.yaml", "--register"])
    assert "--register: not allowed with argument --gauges" in capsys.readouterr().err


def test_the_page_shows_what_gauges_read(tmp_path, model):
    block = conditions(60)
    bag = imported(tmp_path, block, readings_of(model, block))
    bench = Bench(tmp_path, lambda text: None, lambda done, total: None)
    _, view = bench.open_named([bag.name], "")["view"]
    assert [quantity_label(q) for q in view.left.reported] == ["gauges [µm]", "tilts [mdeg]"]
    # A gauge that has no reading somewhere hides the others nowhere.
    values = view.left.values.copy()
    values[::2, 1] = np.nan
    for quantity in view.left.reported:
        shown = Shown(view, None, "", quantity, strongest(values, quantity), 1.0, None, 0)
        assert shown.part_label.startswith("gauge ")
        assert len(time_line(shown)["data"][0]["y"]) == len(values)
        assert np.isfinite(lengths(view.left.with_values(values), quantity)).all()
