"""A link from a STEP file: the shipped one drawn, written, read and condensed again."""

import numpy as np
import pytest
import yaml
from netgen.occ import Axis, Box, Dir
from scipy.linalg import eigvalsh
from scipy.spatial.transform import Rotation

from wrist_stiffness.cli.main import main
from wrist_stiffness.errors import GeometryError
from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.parts import wrist_parts
from wrist_stiffness.fem.solids import link_shape
from wrist_stiffness.fem.step_part import step_part
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.geometry_file import geometry_from_values, load_geometry
from wrist_stiffness.shipped import shipped_file

SHIPPED = shipped_file("config/palmieri2015.yaml")
OTHER_MESH = 0.01
"""The same solid turned and meshed again, in its worst direction."""


@pytest.fixture(scope="module")
def geometry():
    return load_geometry(SHIPPED)


def drawn(geometry, link, path, sizes, home=True):
    """Write a link as CAD would: a solid in mm, in F with the wrist at home."""
    part = wrist_parts(geometry)[ELASTIC.index(link)]
    shape = link_shape(part.solid.dimensions, part.solid.angle, sizes).shape
    turn = Rotation.from_matrix(part.home.rotation).as_rotvec(degrees=True)
    size = float(np.linalg.norm(turn))
    shape = shape.Rotate(Axis((0, 0, 0), Dir(*turn)), size) if home else shape
    shape.WriteStep(str(path))


@pytest.mark.slow
def test_a_link_drawn_in_cad_is_the_link_of_its_dimensions(geometry, coarse, tmp_path):
    drawn(geometry, "link_2", tmp_path / "link.step", coarse)
    found = step_part(tmp_path / "link.step", geometry, "link_2", coarse)
    components, _ = elastic_components(geometry, coarse)
    ratio = eigvalsh(
        found.stiffness, np.linalg.inv(components.flexibility[ELASTIC.index("link_2")])
    )
    np.testing.assert_allclose(ratio, 1.0, atol=OTHER_MESH)
    # Coarser elements are stiffer.
    assert 0.0 < found.coarser < 0.2


@pytest.mark.slow
def test_the_command_prints_what_a_geometry_file_takes(geometry, tmp_path, capsys, coarse):
    drawn(geometry, "link_1", tmp_path / "link.step", coarse)
    assert main(["table", "part", str(tmp_path / "link.step"), "--link", "link_1"]) == 0
    values = yaml.safe_load(SHIPPED.read_text())
    values["links"]["link_1"] |= yaml.safe_load(capsys.readouterr().out)
    own = geometry_from_values(values).links["link_1"].stiffness.flexibility
    shipped = load_table(shipped_file("precomputed/palmieri2015.npz")).components
    ratio = eigvalsh(own, shipped.flexibility[ELASTIC.index("link_1")])
    np.testing.assert_allclose(ratio, 1.0, atol=OTHER_MESH)


def test_what_is_no_link_is_refused(geometry, coarse, tmp_path):
    path = tmp_path / "link.step"
    said = {}
    with pytest.raises(GeometryError, match=r"link.step: cannot be read: No such file"):
        step_part(path, geometry, "link_1", coarse)
    path.write_text("ISO-10303-21;")
    with pytest.raises(GeometryError, match=r"link.step: not a STEP file"):
        step_part(path, geometry, "link_1", coarse)
    box = Box((0, 0, 0), (5, 5, 5))
    box.faces.name = "side"
    for name, shape in (("named", box), ("two", box + box.Move((9, 0, 0)))):
        shape.WriteStep(str(path))
        with pytest.raises(GeometryError) as caught:
            step_part(path, geometry, "link_1", coarse)
        said[name] = str(caught.value)
    assert said["named"].endswith("no face is called motor_bore; named are side")
    assert said["two"].endswith("2 solids, must be one")
    drawn(geometry, "link_2", path, coarse, home=False)
    with pytest.raises(GeometryError, match=r"face motor_bore is .* from its joint's axis"):
        step_part(path, geometry, "link_2", coarse)
