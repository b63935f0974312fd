"""What a load says of a payload: compiled and not, and what may be read at all."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wrist_stiffness.compensation.scales import Scales
from wrist_stiffness.errors import LoadRangeError, UnreachablePoseError
from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.error_model import Load
from wrist_stiffness.shipped import shipped_file

TABLE = load_table(shipped_file("precomputed/palmieri2015.npz"))
small = st.floats(-1.0, 1.0)


@given(
    theta=st.tuples(small, small),
    wrench=st.tuples(*[small] * 6),
    gravity=st.sampled_from([(0, 0, -9.81), (0.0, 0.0, 0.0), (3.0, -9.0, 1.0), (9.81, 0, 0)]),
    on_platform=st.booleans(),
)
def test_a_reading_is_the_same_compiled_and_not(theta, wrench, gravity, on_platform):
    scales = Scales(replace(TABLE.geometry, gravity=np.array(gravity, dtype=float)))
    angles = 0.5 * np.array(theta)
    load = Load(np.array(wrench) * np.repeat([1.0, 0.05], 3), on_platform)
    side, weight, moments, rows = scales.read(TABLE, angles, load)
    at = TABLE.workspace.configuration(angles)
    # By the definitions: along gravity, across it, and the moment of a weight about O.
    wanted = load.in_base(at)
    size = np.linalg.norm(gravity)
    down = np.array(gravity) / size if size else np.zeros(3)
    across = wanted[:3] - down * (down @ wanted[:3])
    assert side == pytest.approx(np.linalg.norm(across), abs=1e-12)
    assert weight == pytest.approx(down @ wanted[:3], abs=1e-12)
    assert np.linalg.norm(moments) == pytest.approx(np.linalg.norm(wanted[3:]), abs=1e-12)
    own = scales.reading(wanted.tolist(), at.platform.tolist())
    np.testing.assert_allclose((side, weight, *moments), (*own[:2], *own.moments), atol=1e-12)
    np.testing.assert_allclose(rows, own.rows, atol=1e-12)


def test_what_is_out_of_range_is_told():
    scales = Scales(TABLE.geometry)
    with pytest.raises(LoadRangeError, match="100"):
        scales.read(TABLE, np.zeros(2), Load(np.array([100.0, 0, 0, 0, 0, 0])))
    with pytest.raises(UnreachablePoseError):
        scales.read(TABLE, np.array([1.5, 1.5]), Load(np.zeros(6)))
