"""The demo's folder belongs to its user."""

import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.workflows.demo import run_demo

MODEL = shipped_file("config/palmieri2015_model.yaml")


@pytest.mark.parametrize("name", ["live", "replayed"])
def test_a_folder_of_somebody_else_is_not_removed(tmp_path, name):
    other = "replayed" if name == "live" else "live"
    for folder, file in ((name, "thesis.txt"), (other, "metadata.yaml")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_text("years of work")
    with pytest.raises(InputError, match=f"{name} is not only a recording"):
        run_demo(tmp_path, MODEL, 1.0, lambda label: lambda done, of: None)
    assert (tmp_path / name / "thesis.txt").read_text() == "years of work"
    assert (tmp_path / other / "metadata.yaml").exists()


def test_a_file_in_the_recordings_place_is_not_removed(tmp_path):
    (tmp_path / "live").write_text("notes")
    with pytest.raises(InputError, match="live is not only a recording"):
        run_demo(tmp_path, MODEL, 1.0, lambda label: lambda done, of: None)
    assert (tmp_path / "live").read_text() == "notes"
