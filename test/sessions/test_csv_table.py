"""Tables of campaigns: in, out, and what is wrong with them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.cli.main import main
from wrist_stiffness.commands.export_csv import export_csv
from wrist_stiffness.commands.import_csv import import_csv
from wrist_stiffness.compensation.intake import Frames, SensorFrame
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.errors import InputError, RecordingError, WristError
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.sessions.reading.csv_columns import (
    column_of,
    covariate_of,
    nanoseconds,
    reader_of,
    seconds,
    writer_of,
)
from wrist_stiffness.sessions.reading.session import read_session
from wrist_stiffness.shipped import shipped_file

MACHINE = "time_s,motor_1_deg,motor_2_deg,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm"
COUNTS = [(0.0, 0.0), (12.345, -7.5), (-20.015, 11.25), (3.3, 3.3), (0.1, 0.2), (9.99, -14.4)]


def table_of(columns="", cells=lambda i: "", machine=MACHINE):
    """A table of six static poses, ten seconds apart, the load growing."""
    lines = [machine + columns]
    for i, (first, second) in enumerate(COUNTS):
        lines.append(f"{10 * i},{first!r},{second!r},0,0,{-1 - i / 8},0,0,0.01{cells(i)}")
    return "\n".join(lines).replace(".0,", ",") + "\n"


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


FULL = ",x_mm,y_mm,z_mm,qx,qy,qz,qw,T_link_1_degC,humidity_percent,spindle_1"
MECHANISM = load_table(shipped_file("precomputed/palmieri2015.npz")).mechanism
PLATFORM = MECHANISM.forward(np.radians(COUNTS)).platform


def quaternion(i):
    values = Rotation.from_matrix(PLATFORM[i]).as_quat()
    return "," + ",".join(f"{value:.12g}" for value in values)


def full_cells(i):
    return f",0.00{i + 1},-0.0025,{-0.01 * (i + 1)!r}{quaternion(i)},2{i}.5,4{i},{i}"


@pytest.fixture
def full(tmp_path):
    return written(tmp_path / "full.csv", table_of(FULL, full_cells))


@given(
    st.floats(-1.0, 1.0),
    st.sampled_from([("x_mm", 1e3), ("motor_1_deg", 6.28), ("fx_N", 1e3), ("qx", 1e3)]),
)
def test_every_number_comes_back_to_the_bit(share, of):
    column, most = of
    value = share * most
    assert reader_of(column)(writer_of(column)(value)) == value


@given(
    st.decimals(-90, 90, allow_nan=False, allow_infinity=False, places=9),
    st.sampled_from(["x_mm", "motor_1_deg", "fx_N", "T_link_1_degC"]),
)
def test_every_text_comes_back_with_its_digits(number, column):
    again = writer_of(column)(reader_of(column)(str(number)))
    assert type(number)(again) == number


@given(st.integers(-(10**18), 2 * 10**18))
def test_every_stamp_comes_back(time_ns):
    assert nanoseconds(seconds(time_ns)) == time_ns


@pytest.mark.parametrize("name", ["humidity", "humidity_percent", "motor_current_1"])
def test_every_covariate_comes_back(name):
    assert covariate_of(column_of(name)) == name


def test_conversions_are_those_of_numpy():
    assert reader_of("motor_1_deg")("12.345") == pytest.approx(np.radians(12.345), rel=3e-16)
    assert reader_of("x_mm")("-18.5") == pytest.approx(-18.5e-3, rel=3e-16)
    assert reader_of("mx_Nm")("0.02") == 0.02


def test_a_table_becomes_the_session_that_it_says(tmp_path, full, table):
    imported = import_csv(full, tmp_path / "bag")
    assert (imported.rows, imported.measured, imported.seconds) == (6, 6, 50.0)
    session = read_session(tmp_path / "bag", table)
    np.testing.assert_allclose(session.block.theta, np.radians(COUNTS), atol=1e-16)
    np.testing.assert_array_equal(np.diff(session.block.time), 10.0)
    np.testing.assert_array_equal(session.block.load[:, 2], -1 - np.arange(6) / 8)
    np.testing.assert_array_equal(session.block.load[:, 5], 0.01)
    np.testing.assert_allclose(session.shift[:, 1], -2.5e-6, rtol=1e-15)
    np.testing.assert_allclose(session.shift[:, 2], -1e-5 * np.arange(1, 7), rtol=1e-15)
    np.testing.assert_allclose(session.rotation, PLATFORM, atol=1e-11)
    np.testing.assert_array_equal(session.block.temperatures["link_1"], 20.5 + np.arange(6))
    np.testing.assert_array_equal(session.block.covariates["humidity_percent"], 40 + np.arange(6))
    np.testing.assert_array_equal(session.block.covariates["spindle"], np.arange(6))


@pytest.mark.parametrize(
    ("columns", "cells"),
    [
        (FULL, full_cells),
        (",x_mm,y_mm,z_mm", lambda i: f",0.{i}1,0.02,-0.0{i + 1}"),
        (",qx,qy,qz,qw", quaternion),
        (",z_mm", lambda i: f",{i + 1}e-05"),
        (",x_mm,z_mm", lambda i: ",0.5," if i % 2 else ",,0.25"),
        (",x_mm,qx,qy,qz,qw", lambda i: ",,,,," if i == 3 else f",0.{i + 1},0,0,0,1"),
        (
            "," + ",".join(f"p{k}{axis}_mm" for k in range(1, 5) for axis in "xyz"),
            lambda i: ",1,2,3,,,," + ",".join(f"{n}.125" for n in range(6)),
        ),
    ],
    ids=["full", "points", "pointing", "dial gauge", "blanks", "nothing in a row", "markers"],
)
def test_the_table_comes_back_byte_for_byte(tmp_path, table, columns, cells):
    path = written(tmp_path / "in.csv", table_of(columns, cells))
    import_csv(path, tmp_path / "bag")
    export_csv(tmp_path / "bag", tmp_path / "out.csv", table)
    assert (tmp_path / "out.csv").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("columns", "cells", "measured"),
    [
        (",x_mm,y_mm,z_mm", lambda i: ",0.1,0.02,-0.03", [1, 1, 1, 0, 0, 0]),
        (",qx,qy,qz,qw", quaternion, [0, 0, 0, 1, 1, 1]),
        (",z_mm", lambda i: f",{i}", [0, 0, 1, 0, 0, 0]),
    ],
    ids=["points", "pointing", "dial gauge"],
)
def test_what_was_not_measured_is_not_measured(tmp_path, table, columns, cells, measured):
    import_csv(written(tmp_path / "in.csv", table_of(columns, cells)), tmp_path / "bag")
    session = read_session(tmp_path / "bag", table)
    np.testing.assert_array_equal(session.measured, np.tile(measured, (6, 1)) > 0)


def test_a_recording_comes_back_to_the_bit(tmp_path, campaign, table):
    """Stamps since 1970, joint states between the poses' stamps, loads in a sensor's frame."""
    sensor = SensorFrame("wrist_platform", np.eye(3), np.array([0.0, 0.0, 0.04]), "environment")
    settings = StreamSettings(frames=Frames({"ft": sensor}))
    campaign.count = 60
    shift = 1e-5 * np.random.default_rng(4).standard_normal((59, 3))
    campaign.with_joints().with_loads("ft").with_poses(shift)
    campaign.with_temperature("link_1", campaign.joint_ns[0], 21.3)
    campaign.with_covariate("humidity", campaign.joint_ns[0], 0.3)
    campaign.written(tmp_path / "bag")
    export_csv(tmp_path / "bag", tmp_path / "one.csv", table, settings=settings)
    import_csv(tmp_path / "one.csv", tmp_path / "again")
    export_csv(tmp_path / "again", tmp_path / "two.csv", table)
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    once = read_session(tmp_path / "bag", table, settings=settings)
    twice = read_session(tmp_path / "again", table)
    np.testing.assert_array_equal(once.block.time, twice.block.time)
    np.testing.assert_array_equal(once.block.theta, twice.block.theta)
    np.testing.assert_array_equal(once.shift, twice.shift)
    np.testing.assert_array_equal(once.rotation, twice.rotation)
    platform = MECHANISM.forward(once.block.theta).platform
    force = np.einsum("nij,nj->ni", platform, once.block.load[:, :3])
    np.testing.assert_allclose(twice.block.load[:, :3], force, atol=1e-14)


def test_unloaded_is_said_and_not_guessed(tmp_path):
    machine = "time_s,motor_1_deg,motor_2_deg"
    text = "\n".join([machine + ",z_mm", *(f"{i},0,{i},0.1" for i in range(6))])
    path = written(tmp_path / "in.csv", text)
    with pytest.raises(InputError, match="fx_N.*missing; say --unloaded"):
        import_csv(path, tmp_path / "bag")
    import_csv(path, tmp_path / "bag", unloaded=True)
    samples = read_samples(open_recording(tmp_path / "bag"))
    np.testing.assert_array_equal(samples.loads.wrench, np.zeros((6, 6)))
    assert '"load_source": "constant"' in samples.notes[0]


def changed(row, column, value):
    lines = table_of(FULL, full_cells).splitlines()
    cells = lines[row - 1].split(",")
    cells[lines[0].split(",").index(column)] = value
    lines[row - 1] = ",".join(cells)
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (changed(4, "fx_N", "o.5"), r"row 4, column fx_N: 'o\.5' is no number"),
        (changed(4, "fx_N", '"-5,9e-05"'), r"'-5,9e-05' is no number: write -5\.9e-05, with a dec"),
        (changed(3, "motor_2_deg", ""), "row 3, column motor_2_deg is blank: .*delete the line"),
        (changed(7, "fx_N", "nan"), "row 7, column fx_N is NaN: .*delete the line"),
        (changed(7, "x_mm", "inf"), "row 7, column x_mm: 'inf' is not finite"),
        (changed(4, "motor_1_deg", "400"), "row 4, column motor_1_deg: 400 is outside -360 to 360"),
        (changed(4, "fx_N", "-1e6"), "row 4, column fx_N: -1e6 is outside -10000 to 10000 N"),
        (changed(4, "mz_Nm", "1e5"), "row 4, column mz_Nm: 1e5 is outside -10000 to 10000 Nm"),
        (
            changed(2, "T_link_1_degC", "-500"),
            "row 2, column T_link_1_degC: -500 is outside -273.15 to 1000 degC",
        ),
        (changed(5, "qy", ""), "row 5, column qy: blank in a quaternion"),
        (changed(5, "qw", "0.5"), "row 5, columns qx qy qz qw: norm 0.5"),
        (changed(4, "time_s", "10"), "row 4, column time_s: 10 is not later than 10 of the row"),
        (changed(4, "time_s", "20.0000000001"), "row 4, column time_s: .*nanoseconds"),
        (changed(4, "time_s", ""), "row 4, column time_s"),
        (table_of(FULL, full_cells).replace(",1\n", ",1,9\n"), "row 3: 20 cells for 19 columns"),
        (changed(1, "motor_2_deg", "motor_2_dge"), "column motor_2_deg is missing"),
        (changed(1, "mz_Nm", "mz_mNm"), "column mz_Nm of the load is missing"),
        (changed(1, "qz", "q_z"), "column qz of the quaternion is missing"),
        (changed(1, "spindle_1", "spindle"), "column 'spindle' is not known and no NAME_UNIT"),
        (changed(1, "spindle_1", "x_mm"), "column x_mm is there twice"),
        (changed(1, "x_mm", "p1x_mm"), "columns p1y_mm, p1z_mm of the markers are missing"),
        (table_of(), "nothing measured"),
        (table_of(FULL, full_cells).splitlines()[0], "no rows below the column names"),
        ("", "no column names in the first line"),
        ("0,1.5,-2\n5,1.6,-2\n", "no column names in the first line"),
        ("0,1.5,-2,1e-5,,\n", "columns time_s, motor_1_deg, motor_2_deg are missing"),
        (changed(3, "z_mm", "0,02"), "row 3: 20 cells for 19 columns; decimal commas need semico"),
        (table_of(",p999999999x_mm", lambda i: ",1"), "p1x_mm, p1y_mm, p1z_mm of the markers"),
        (table_of(",p" + "9" * 5000 + "x_mm", lambda i: ",1"), "p1x_mm, p1y_mm, p1z_mm of the"),
        (table_of(",x_mm", lambda i: ",1e99999"), "column x_mm: '1e99999' is not finite"),
        (table_of(",x_mm", lambda i: ",1e400"), "column x_mm: '1e400' is not finite"),
        (table_of(",x_mm", lambda i: ",1").replace("10,", "1e999999,", 1), "1e999999' is nei"),
        (table_of(",x_mm", lambda i: ',"' + "1" * 200_000 + '"'), "row 2: field larger than"),
        (f"{MACHINE},{'x' * 200_000}", "row 1 has more than 131072 characters"),
        (changed(1, "x_mm", "x_m"), "column x_m is neither of the load nor of the pose.*x_mm"),
        (changed(1, "x_mm", "x_in"), "column x_in is neither of the load nor.*check its unit"),
        (changed(1, "fz_N", "fz_lbf"), "column fz_N of the load is missing"),
        (changed(1, "time_s", "time_ms"), r"column time_s is missing \(found: time_ms"),
        (changed(1, "z_mm", "Z_mm"), "column Z_mm is neither of the load nor of the pose"),
        (changed(1, "spindle_1", "fx_kN"), "column fx_kN is neither of the load nor of the pose"),
        (changed(7, "time_s", "1e9"), r"row 7, column time_s: 1e9 s is a stamp outside 0 to 21474"),
        (changed(2, "time_s", "-2e9"), "row 2, column time_s: -2e9 s is a stamp outside 0"),
        (changed(2, "time_s", "1.7e12"), "row 2, column time_s: 1.7e12 s is a stamp outside 0"),
        (table_of(",z_mm", lambda i: ","), "nothing is measured in any of its 6 rows"),
    ],
)
def test_a_wrong_table_is_one_error_with_its_place(tmp_path, text, reason):
    with pytest.raises(InputError, match=reason) as caught:
        import_csv(written(tmp_path / "in.csv", text), tmp_path / "bag")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize(("factor", "asked"), [(1, False), (1000, True)])
def test_times_in_ms_are_asked_about(tmp_path, capsys, factor, asked):
    rows = [f"{30 * i * factor},0,{i},0.1" for i in range(6)]
    text = "\n".join(["time_s,motor_1_deg,motor_2_deg,z_mm", *rows, ""])
    path = written(tmp_path / "in.csv", text)
    assert main(["import", str(path), "-o", str(tmp_path / "bag"), "--unloaded"]) == 0
    assert ("are the times in ms?" in capsys.readouterr().out) is asked


def test_a_table_that_is_no_text_is_said(tmp_path):
    (tmp_path / "in.csv").write_bytes(b"\xff\xfe\x00t")
    with pytest.raises(InputError, match="no text in UTF-8"):
        import_csv(tmp_path / "in.csv", tmp_path / "bag")
    with pytest.raises(InputError, match="cannot be read"):
        import_csv(tmp_path / "absent.csv", tmp_path / "bag")


def test_spreadsheets_marks_and_blank_lines_do_no_harm(tmp_path):
    text = "\ufeff" + table_of(",z_mm", lambda i: f",{i}").replace("\n", "\r\n") + "\r\n,,,\r\n"
    path = tmp_path / "in.csv"
    path.write_bytes(text.encode())
    assert import_csv(path, tmp_path / "bag").rows == 6


def test_nothing_is_overwritten_unasked(tmp_path, full, capsys):
    import_csv(full, tmp_path / "bag")
    with pytest.raises(RecordingError, match="not overwritten"):
        import_csv(full, tmp_path / "bag")
    export, before = ["export", str(tmp_path / "bag"), "-o", str(full)], full.read_bytes()
    assert main(export) == 2
    assert "not overwritten" in capsys.readouterr().err
    assert main([*export, "--overwrite"]) == 0
    assert full.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("run.mcap", "a table is no recording; choose another name"),
        ("run", "is no earlier table: it is not replaced"),
    ],
)
def test_an_export_never_replaces_its_own_recording(tmp_path, full, table, name, reason):
    import_csv(full, tmp_path / "run.mcap")
    recording = (tmp_path / "run.mcap").rename(tmp_path / name)
    before = recording.read_bytes()
    with pytest.raises(InputError, match=reason):
        export_csv(recording, recording, table)
    assert recording.read_bytes() == before


def test_an_export_that_cannot_be_written_leaves_nothing(tmp_path, full, table):
    import_csv(full, tmp_path / "bag")
    with pytest.raises(WristError, match="cannot be written"):
        export_csv(tmp_path / "bag", tmp_path / "no folder" / "out.csv", table)
    with pytest.raises(WristError, match="cannot be written"):
        export_csv(tmp_path / "bag", tmp_path, table)


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("mark", [",", "."])
def test_a_spreadsheet_s_table_is_the_same_table(tmp_path, full, table, separator, mark):
    text = table_of(FULL, full_cells).replace(",", separator).replace(".", mark)
    import_csv(written(tmp_path / "sheet.csv", text), tmp_path / "bag")
    export_csv(tmp_path / "bag", tmp_path / "out.csv", table)
    assert (tmp_path / "out.csv").read_bytes() == full.read_bytes()


def test_one_table_has_one_decimal_mark(tmp_path):
    text = table_of(FULL, full_cells).replace(",", ";").replace("12.345", "12,345")
    with pytest.raises(InputError, match=r"row 3, column motor_1_deg: 12,345 has a decimal ','"):
        import_csv(written(tmp_path / "mixed.csv", text), tmp_path / "mixed.mcap")


@pytest.mark.parametrize(
    ("date", "ns"),
    [
        ("1970-01-01T00:00:01", 1_000_000_000),
        ("2001-09-09 01:46:40.000000001Z", 1_000_000_000_000_000_001),
        ("2001-09-09T03:46:40,5+02:00", 1_000_000_000_500_000_000),
        ("1969-12-31T23:59:59.25", -750_000_000),
    ],
)
def test_a_date_is_a_time(date, ns):
    assert nanoseconds(date) == ns


@pytest.mark.parametrize("date", ["2026-02-30T10:00:00", "02.03.2026 10:15:00", "2026-03-02"])
def test_a_date_that_is_none_is_refused(date):
    with pytest.raises(
        ValueError, match="neither seconds nor a date like 2026|day is out of range"
    ):
        nanoseconds(date)


@pytest.mark.parametrize("cell", ["", "nan", "NaN"])
def test_nan_is_not_measured(tmp_path, cell):
    text = table_of(",z_mm", lambda i: f",{cell if i == 2 else i}")
    imported = import_csv(written(tmp_path / "gauge.csv", text), tmp_path / "bag")
    assert (imported.rows, imported.measured) == (6, 5)


@pytest.mark.parametrize("lost", [3, 20])
def test_a_cut_last_line_is_left_out_and_told(tmp_path, lost):
    text = table_of(",z_mm", lambda i: ",0.001")
    cut = import_csv(written(tmp_path / "cut.csv", text[: -lost - 4]), tmp_path / "cut.mcap")
    assert (cut.rows, cut.cut_row) == (5, 7)
    whole = import_csv(written(tmp_path / "whole.csv", text.rstrip()), tmp_path / "whole.mcap")
    assert (whole.rows, whole.cut_row) == (6, 0)


def test_a_short_line_that_is_ended_is_refused(tmp_path):
    text = table_of(",z_mm", lambda i: ",0.001")[:-12] + "\n"
    with pytest.raises(InputError, match="row 7: .* cells for 10 columns"):
        import_csv(written(tmp_path / "short.csv", text), tmp_path / "short.mcap")
