"""`table check | show | build`: answers, exit codes, pictures, and what is refused."""

import copy
import json
import signal
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import yaml
from waiting import wait_until

from wrist_stiffness.cli.main import main
from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.lookup.table_file import load_table, save_table
from wrist_stiffness.mechanism.statics import contact_operators
from wrist_stiffness.shipped import shipped_file

DEADLINE_S = 120.0
PICTURES = "wrist_stiffness.report.pictures.table"

CHECKS = {
    "file",
    "compliance",
    "spline s operative",
    "spline phi operative",
    "spline s domain",
    "spline phi domain",
}


def check(path, tmp_path, *options):
    """Return the exit code and the findings of `table check`."""
    report = tmp_path / "check.json"
    code = main(["table", "check", str(path), "--json", str(report), *map(str, options)])
    result = json.loads(report.read_text())
    assert result["passed"] == (code == 0)
    return code, {finding["name"]: finding["passed"] for finding in result["findings"]}


def test_good_table_is_good(small_table, tmp_path, capsys):
    _, path = small_table
    assert check(path, tmp_path) == (0, dict.fromkeys(CHECKS, True))
    assert f"\n{path}: good\n" in capsys.readouterr().out


@pytest.mark.slow
def test_shipped_table_is_good_and_of_the_shipped_geometry(tmp_path):
    pytest.importorskip("netgen", reason="table check needs the mesher")
    path = shipped_file("precomputed/palmieri2015.npz")
    code, findings = check(path, tmp_path, "--geometry", shipped_file("config/palmieri2015.yaml"))
    assert (code, findings) == (0, dict.fromkeys(CHECKS | {"geometry"}, True))


@pytest.mark.parametrize("quantity", ["s", "phi"])
def test_table_that_states_too_small_an_error_is_not_good(small_table, tmp_path, capsys, quantity):
    table, _ = small_table
    errors = copy.deepcopy(table.header.errors)
    errors["predicted"]["operative"][quantity] *= 0.2
    path = tmp_path / "boastful.npz"
    save_table(replace(table, header=replace(table.header, errors=errors)), path)
    code, findings = check(path, tmp_path)
    assert code == 1
    assert [name for name, passed in findings.items() if not passed] == [
        f"spline {quantity} operative"
    ]
    assert f"BAD  spline {quantity} operative" in capsys.readouterr().out


def test_table_with_a_spoilt_node_is_not_good(small_table, tmp_path):
    """One value of one node, as a foreign sweep might get it wrong."""
    table, _ = small_table
    operators = table.operators.copy()
    operators[12] *= 1.2
    path = tmp_path / "spoilt.npz"
    save_table(replace(table, operators=operators), path)
    assert check(path, tmp_path)[0] == 1


def test_geometry_is_compared_by_its_values(small_table, tmp_path):
    table, path = small_table
    geometry = tmp_path / "geometry.yaml"
    geometry.write_text(yaml.safe_dump(table.header.geometry))
    assert check(path, tmp_path, "--geometry", geometry)[0] == 0
    changed = copy.deepcopy(table.header.geometry)
    changed["links"]["link_3"]["section_axial_mm"] += 0.1
    geometry.write_text(yaml.safe_dump(changed))
    code, findings = check(path, tmp_path, "--geometry", geometry)
    assert (code, findings["geometry"]) == (1, False)
    assert all(passed for name, passed in findings.items() if name != "geometry")


def damaged(content, how):
    if how == "cut":
        return content[: len(content) // 2]
    if how == "empty":
        return b""
    if how == "text":
        return b"schema: 1\n"
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0xFF]) + content[middle + 1 :]


@pytest.mark.parametrize("how", ["cut", "empty", "text", "flipped"])
@pytest.mark.parametrize("action", ["check", "show"])
def test_damaged_table_is_refused(small_table, tmp_path, refused, action, how):
    path = tmp_path / "damaged.npz"
    path.write_bytes(damaged(small_table[1].read_bytes(), how))
    assert f"{path}: " in refused("table", action, path)


def test_foreign_npz_is_refused(tmp_path, refused):
    np.savez(tmp_path / "foreign.npz", nodes=np.zeros((3, 2)))
    assert "not a table of this program" in refused("table", "check", tmp_path / "foreign.npz")


@pytest.mark.slow
def test_a_stopped_build_says_what_it_keeps(tmp_path):
    """Stopped by a real signal as soon as one part is condensed."""
    pytest.importorskip("netgen")
    command = [sys.executable, "-m", "wrist_stiffness", "table", "build", "-o", tmp_path / "t.npz"]
    with subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        # Tests that run in the background are started deaf to SIGINT, and hand that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        try:
            kept = wait_until(lambda: list(tmp_path.glob(".t.parts/*.npz")), process, DEADLINE_S)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
    assert process.returncode == 130
    parts = len(list(tmp_path.glob(".t.parts/*.npz")))
    assert parts >= len(kept)
    kept = f"stopped; condensed parts kept: {parts}; the same command goes on from there"
    assert said.splitlines()[-1] == f"wrist-stiffness: {kept}"
    assert "Traceback" not in said


def coloured(pixels):
    """Return which part of a picture is neither white nor grey nor black."""
    return np.mean(np.ptp(pixels, axis=-1) > 0.02)


def test_pictures_show_something(small_table, tmp_path, capsys):
    image = pytest.importorskip("matplotlib.image", reason="pictures need matplotlib")
    folder = tmp_path / "new" / "maps"
    assert main(["table", "show", str(small_table[1]), "-o", str(folder)]) == 0
    written = capsys.readouterr().out.split("written: ")[1:]
    assert {path.name for path in folder.iterdir()} == {
        "map_s.png",
        "map_phi.png",
        "budget.png",
        "bent.png",
        "uncertainty.png",
    }
    assert {line.strip() for line in written} == {str(path) for path in folder.iterdir()}
    seen = {path.name: image.imread(path)[..., :3] for path in folder.iterdir()}
    for pixels in seen.values():
        height, width, _ = pixels.shape
        assert 400 < height < 2000
        assert 600 < width < 2500
        assert 0.03 < coloured(pixels) < 0.9
    for name in ("map_s.png", "map_phi.png"):
        assert coloured(seen[name]) > 0.3
    assert not np.array_equal(seen["map_s.png"], seen["map_phi.png"])


def test_the_map_is_of_the_poses_that_are_summarised(small_table, tmp_path, monkeypatch):
    drawn = []
    for name in ("budget", "bent_wrist", "uncertainty"):
        monkeypatch.setattr(f"{PICTURES}.draw_{name}", lambda *given: None)
    monkeypatch.setattr(f"{PICTURES}.draw_map", lambda *given: drawn.append(given[1:3]))
    table, path = small_table
    summary = tmp_path / "maps.json"
    assert main(["table", "show", str(path), "-o", str(tmp_path), "--json", str(summary)]) == 0
    told = json.loads(summary.read_text())["operative"]
    for name, (poses, values) in zip(("s_um", "phi_mdeg"), drawn, strict=True):
        inside = values[table.workspace.operative(poses)]
        assert told[name]["min"] == pytest.approx(inside.min(), rel=1e-9)
        assert told[name]["mean"] == pytest.approx(inside.mean(), rel=1e-9)


@pytest.mark.slow
def test_modes_of_the_shipped_table(tmp_path, capsys):
    image = pytest.importorskip("matplotlib.image", reason="pictures need matplotlib")
    found = {}
    for name, payload in (("alone", []), ("loaded", ["--payload", "0.2", "0", "0", "-30"])):
        report = tmp_path / f"{name}.json"
        options = ["--modes", "-o", str(tmp_path / name), "--json", str(report), *payload]
        assert main(["table", "show", *options]) == 0
        found[name] = json.loads(report.read_text())
    slowest = found["alone"]["at rest"]["min"][0]
    assert f"below {slowest / 10:.0f} Hz" in capsys.readouterr().out
    for state in ("open", "at rest", "closed"):
        alone, loaded = (np.array(found[name][state]["mean"]) for name in ("alone", "loaded"))
        # At rest a payload also presses more flanges together, which quickens the higher modes.
        assert np.all(loaded < alone) or (state == "at rest" and loaded[0] < alone[0])
        assert np.all(np.diff(alone) > 0.0)
    for picture in ("map_mode_1.png", "mode_shapes.png"):
        assert 0.03 < coloured(image.imread(tmp_path / "alone" / picture)[..., :3]) < 0.9


@pytest.mark.slow
def test_statistics_are_those_of_the_closed_form(tmp_path, monkeypatch, capsys):
    """Independent of the spline: the rated load at every pose of the same fine grid."""
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    assert main(["table", "show", "--json", "maps.json"]) == 0
    told = json.loads((tmp_path / "maps.json").read_text())
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    poses = table.workspace.grid(41)
    poses = poses[table.workspace.operative(poses)]
    configuration = table.mechanism.forward(poses)
    operators = contact_operators(configuration, table.components, np.zeros(3))
    exact = rated_map(configuration, operators, table.geometry)
    for name, values in (("s_um", 1e6 * exact[:, 3]), ("s_z_um", 1e6 * exact[:, 2])):
        assert told["operative"][name]["mean"] == pytest.approx(values.mean(), rel=0.01)
    phi = 1e3 * np.degrees(exact[:, 4])
    assert told["operative"]["phi_mdeg"]["max"] == pytest.approx(phi.max(), rel=0.05)
    assert told["domain_max"]["s_um"] >= told["operative"]["s_um"]["max"]
    shown = capsys.readouterr().out
    assert f"mean {told['operative']['s_um']['mean']:7.2f}" in shown


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--load", "1", "2"], "3 or 6 numbers, not 2"),
        (["--load", "0", "0", "-50"], "50 N"),
        (["--load", "0", "0", "0"], "load: all numbers are 0"),
        (["--load", "0", "0", "nan"], "nan"),
        (["-o", "a_file"], "a_file: cannot be made"),
        (["--modes", "--payload", "0", "0", "0", "0"], "payload of 0 kg is not above 0"),
        (["--modes", "--payload-inertia", "1", "1", "1"], "needs its mass and place"),
        (["--payload", "1", "0", "0", "-30"], "--payload and --payload-inertia belong to --modes"),
        (["--payload-inertia", "1", "1", "1"], "--payload and --payload-inertia belong to --modes"),
        (["--modes", "--load", "0", "0", "-1"], "--load and --at do not go with --modes"),
        (["--modes", "--at", "0", "0", "0"], "--load and --at do not go with --modes"),
        (["--at", "20", "0", "-18"], "--at says where --load acts, which is missing"),
    ],
)
def test_show_refuses(small_table, tmp_path, monkeypatch, refused, options, named):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a_file").touch()
    assert named in refused("table", "show", small_table[1], *options)


def test_picture_that_cannot_be_written_is_one_line_and_leaves_nothing(
    small_table, tmp_path, refused
):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    (tmp_path / "map_s.png").mkdir()
    line = refused("table", "show", small_table[1], "-o", tmp_path)
    assert "map_s.png: cannot be written: Is a directory" in line
    assert [path.name for path in tmp_path.iterdir()] == ["map_s.png"]


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["-o", "table.txt"], "table.txt: a table's name ends in .npz"),
        (["-o", "nowhere/table.npz"], "nowhere: no such folder"),
        (["-o", "table.npz", "--grid", "2"], "2 x 2 is outside 3 x 3 to 61 x 61"),
        (["-o", "table.npz", "--grid", "100000"], "100000 x 100000 is outside"),
        (["-o", "table.npz", "--tolerance", "0"], "tolerance 0 is not above 0"),
        (["-o", "table.npz", "--tolerance", "nan"], "tolerance nan is not above 0"),
        (["-o", "table.npz", "--interface", "soft"], "'soft'"),
        (["missing.yaml", "-o", "table.npz"], "missing.yaml: cannot be read"),
        (["flat.yaml", "-o", "table.npz"], "wall_mm: -0.75 is not above 0"),
        (["thick.yaml", "-o", "table.npz"], "4.5 does not fit links.link_1.platform_bore_mm"),
        ([], "-o/--output"),
    ],
)
def test_build_refuses_before_it_computes(tmp_path, monkeypatch, refused, options, named):
    monkeypatch.chdir(tmp_path)
    shipped = shipped_file("config/palmieri2015.yaml").read_text()
    values = yaml.safe_load(shipped)
    values["bushings"]["joint_4"]["wall_mm"] = -0.75
    (tmp_path / "flat.yaml").write_text(yaml.safe_dump(values))
    values = yaml.safe_load(shipped)
    values["bushings"]["joint_2"]["pin_diameter_mm"] = 4.5
    (tmp_path / "thick.yaml").write_text(yaml.safe_dump(values))
    assert named in refused("table", "build", *options)
    assert not (tmp_path / "table.npz").exists()


@pytest.mark.slow
def test_build_writes_a_table_that_is_good(tmp_path, monkeypatch, capsys):
    """The whole sweep on a mesh that is coarse, but of solids."""
    sweep = pytest.importorskip("wrist_stiffness.fem.sweep", reason="a build needs the mesher")
    solids = pytest.importorskip("wrist_stiffness.fem.solids")
    sizes = solids.MeshSettings(
        link=4e-3, bore=2.4e-3, bushing=1.0e-3, bushing_corner=0.4e-3, bushing_arc=2.8e-3
    )
    monkeypatch.setattr(sweep, "BuildSettings", partial(sweep.BuildSettings, sizes=sizes))
    monkeypatch.chdir(tmp_path)
    options = ["--grid", "5", "--tolerance", "0.2", "--json", "built.json"]
    assert main(["table", "build", "-o", "built.npz", *options]) == 0
    shown = capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["built.json", "built.npz"]
    header, table = json.loads((tmp_path / "built.json").read_text()), load_table("built.npz")
    assert header["checksum"] == table.checksum
    assert table.checksum[:12] in shown
    assert len(table.nodes) == len(table.workspace.grid(5))
    assert header["mesh"]["sizes_mm"]["link"] == pytest.approx(4.0)
    errors = header["errors"]
    second = errors["second_order_relative"]
    assert errors["stated_relative"] > errors["mesh_relative"] + second > second > 0.0
    assert f"stated error:              {100 * errors['stated_relative']:.2f} %" in shown
    geometry = shipped_file("config/palmieri2015.yaml")
    assert check("built.npz", tmp_path, "--geometry", geometry)[0] == 0
    # A coarse mesh is a little too stiff, not another wrist.
    fine = load_table(shipped_file("precomputed/palmieri2015.npz"))
    stiffer = np.linalg.norm(table.components.flexibility, axis=(1, 2))
    ratio = stiffer / np.linalg.norm(fine.components.flexibility, axis=(1, 2))
    assert np.all((ratio > 0.7) & (ratio < 1.02))
