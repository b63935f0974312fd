"""No name from the page leads out of the workspace."""

import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.web.bench import Bench
from wrist_stiffness.web.workspace import Workspace


@pytest.fixture
def workspace(tmp_path):
    return Workspace(tmp_path / "bench")


@pytest.mark.parametrize(
    "name",
    ["../model.yaml", "/etc/passwd", "..", ".", ".hidden.yaml", "a/b.mcap", "a\\..\\b", "", "a\0b"],
)
def test_a_name_that_leads_out_is_refused(workspace, name):
    with pytest.raises(InputError, match="no plain file name"):
        workspace.path(name)
    with pytest.raises(InputError, match="no plain file name"):
        workspace.save(name, b"")


def test_names_that_browsers_make_are_taken_and_others_told_what_is(workspace):
    workspace.save("bäd näme (1).mcap", b"")
    assert workspace.recordings() == ["bäd näme (1).mcap"]
    with pytest.raises(InputError, match=r"letters, digits, spaces and \. _ \+ - \( \), the first"):
        workspace.save("monday[1].mcap", b"")
    with pytest.raises(InputError, match="up to 100"):
        workspace.save(f"{'m' * 96}.mcap", b"")


def test_a_link_that_leads_out_is_refused(workspace, tmp_path):
    (tmp_path / "secret.yaml").write_text("key: 1\n")
    (workspace.folder / "model.yaml").symlink_to(tmp_path / "secret.yaml")
    with pytest.raises(InputError, match="no plain file name"):
        workspace.path("model.yaml")
    assert workspace.models() == []


def model_file(workspace, table="mine.npz", effects="[]"):
    text = f"schema: 1\nname: mine\ntable: {{path: {table}}}\neffects: {effects}\n"
    workspace.save("wrist.yaml", text.encode())
    return workspace.model("wrist.yaml")


@pytest.mark.parametrize("table", ["../mine.npz", "/etc/passwd", "deeper/mine.npz"])
def test_a_model_whose_table_lies_elsewhere_is_refused(workspace, table):
    with pytest.raises(InputError, match="lies outside the workspace"):
        model_file(workspace, table)
    with pytest.raises(InputError, match=r"law.py lies outside the workspace"):
        model_file(workspace, effects="[{effect: python, class: '../law.py:Law'}]")


def test_a_table_of_the_workspace_or_of_the_package_is_taken(workspace):
    shipped = shipped_file("precomputed/palmieri2015.npz")
    assert model_file(workspace) == model_file(workspace, shipped)
    (workspace.folder / "linked.npz").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match="lies outside the workspace"):
        model_file(workspace, "linked.npz")


def test_uploads_are_recordings_tables_and_models_only(workspace):
    with pytest.raises(InputError, match=r"recordings \(.mcap\)"):
        workspace.save("law.py", b"import os")
    workspace.save("monday.mcap", b"1")
    workspace.save("monday.mcap", b"2")
    workspace.save("wrist.yaml", b"")
    assert workspace.path("monday.mcap").read_bytes() == b"2"
    assert workspace.recordings() == ["monday.mcap"]
    assert workspace.models() == ["wrist.yaml"]
    (workspace.folder / "bag.mcap").mkdir()
    with pytest.raises(InputError, match="a folder of that name"):
        workspace.save("bag.mcap", b"")


def test_what_was_uploaded_is_offered_however_large_its_letters(workspace):
    for name in ("DAY.MCAP", "M.YAML", "T.CSV", "Y.Yml", "P.NPZ"):
        workspace.save(name, b"")
    assert workspace.recordings() == ["DAY.MCAP", "T.CSV"]
    assert workspace.models() == ["M.YAML", "Y.Yml"]


def test_a_table_in_capitals_is_imported(tmp_path):
    bench = Bench(tmp_path, lambda words: None, lambda done, total: None)
    (tmp_path / "T.CSV").write_text("no,column\n1,2\n")
    with pytest.raises(InputError, match=r"T\.CSV: .*column"):
        bench.open_named(["T.CSV"], "")
