"""Meshes of a whole wrist: finer ones are softer, and by how much was stated before."""

import numpy as np
import pytest

from wrist_stiffness.fem.components import elastic_components
from wrist_stiffness.fem.condensed_store import CondensedStore
from wrist_stiffness.fem.error_budget import ORDERS, error_budget
from wrist_stiffness.lookup.response import rated_map
from wrist_stiffness.mechanism.components import ELASTIC
from wrist_stiffness.mechanism.geometry_file import mechanism_of
from wrist_stiffness.mechanism.statics import contact_operators


@pytest.mark.slow
def test_finer_meshes_are_softer_and_the_stated_error_holds(make_wrist, coarse, tmp_path):
    wrist, store = make_wrist(), CondensedStore(tmp_path)
    poses = mechanism_of(wrist).forward(np.array([[0.0, 0.0], [0.4, -0.3]]))
    parts = {
        factor: elastic_components(wrist, coarse.times(factor), condenser=store)[0]
        for factor in (1.69, 1.0, 0.64)
    }
    # Displacement elements are too stiff: compliance grows from below, that of every part and
    # s and phi of the rated load.
    traces = np.array([np.trace(p.flexibility, axis1=1, axis2=2) for p in parts.values()])
    sizes = np.array(
        [
            rated_map(poses, contact_operators(poses, p, np.zeros(3)), wrist)[:, 3:].mean(axis=0)
            for p in parts.values()
        ]
    )
    assert np.all(np.diff(traces, axis=0) > 0.0)
    assert np.all(np.diff(sizes, axis=0) > 0.0)
    stated = error_budget(wrist, parts[1.0], coarse, "rigid", 2, store)["mesh"]
    missed = sizes[-1] / sizes[-2] - 1.0
    assert np.all(missed < [stated["s"], stated["phi"]])
    assert np.all(np.array([stated["s"], stated["phi"]]) < 0.1)


def test_every_part_has_an_order():
    names = [name for names, _ in ORDERS for name in names]
    assert sorted(names) == sorted(ELASTIC)
