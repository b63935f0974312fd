"""The demo's folder belongs to its user."""

import re
from pathlib import Path

import pytest
from run_demo import DAYS, LIVE, REPLAYED, run_demo

from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file

MODEL = shipped_file("config/palmieri2015_model.yaml")


@pytest.mark.parametrize("name", ["live", "replayed"])
def test_a_folder_of_somebody_else_is_not_removed(tmp_path, name):
    other = "replayed" if name == "live" else "live"
    for folder, file in ((name, "thesis.txt"), (other, "metadata.yaml")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_text("years of work")
    with pytest.raises(InputError, match=f"{name} is not only a recording"):
        run_demo(tmp_path, MODEL, 2.0, lambda label: lambda done, of: None, print)
    assert (tmp_path / name / "thesis.txt").read_text() == "years of work"
    assert (tmp_path / other / "metadata.yaml").exists()


def test_a_file_in_the_recordings_place_is_not_removed(tmp_path):
    (tmp_path / "live").write_text("notes")
    with pytest.raises(InputError, match="live is not only a recording"):
        run_demo(tmp_path, MODEL, 2.0, lambda label: lambda done, of: None, print)
    assert (tmp_path / "live").read_text() == "notes"


@pytest.mark.parametrize("seconds", [float("nan"), 0.0, 1e9])
def test_a_demo_that_cannot_be_leaves_the_last_one(tmp_path, seconds):
    (tmp_path / "map_s.png").write_text("of the last demo")
    with pytest.raises(InputError, match="is not 2 to 172800"):
        run_demo(tmp_path, MODEL, seconds, lambda label: lambda done, of: None, print)
    assert [path.name for path in tmp_path.iterdir()] == ["map_s.png"]


def test_readme_writes_nothing_where_the_demo_before_it_has_written():
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    written = re.findall(r"^wrist-stiffness .*(?:-o|--record) demo/(\S+)$", readme, re.MULTILINE)
    assert len(written) == 4
    assert not {LIVE, REPLAYED, *DAYS}.intersection(written)
