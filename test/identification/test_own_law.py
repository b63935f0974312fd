"""A user's own law is searched as well as one of the catalogue."""

from importlib import metadata
from inspect import getsource

import numpy as np
import pytest

from wrist_stiffness.identification.base_fit import fit_base
from wrist_stiffness.identification.candidates import Point, searched, wrist_candidates
from wrist_stiffness.identification.wrist_problem import WristProblem
from wrist_stiffness.model import registry
from wrist_stiffness.model.effect import effect_at
from wrist_stiffness.model.effects import joint_friction
from wrist_stiffness.model.effects.joint_play import JointClearance
from wrist_stiffness.model.parameters import Parameter
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.simulation.cell import CellSettings

LAW = "joint_friction"


@pytest.fixture(scope="module")
def point(model, in_the_cell):
    settings = CellSettings(rate_hz=10.0, program_seconds=30.0, program_seed=41, base="exact")
    base = fit_base(model, (as_units(model, in_the_cell(model.table, settings, 3)),))
    return Point((base.model(0),))


@pytest.fixture
def as_a_users_own(monkeypatch, tmp_path):
    """Take friction out of the catalogue and let another package offer the same class."""
    (tmp_path / "own_laws.py").write_text(getsource(joint_friction))
    monkeypatch.syspath_prepend(tmp_path)
    modules = list(registry.iter_modules(registry.effects.__path__))
    others = [each for each in modules if each.name != LAW]
    assert len(others) == len(modules) - 1
    own = metadata.EntryPoint("own", "own_laws:JointFriction", registry.ENTRY_POINTS)

    def swap():
        monkeypatch.setattr(registry, "iter_modules", lambda path: others)
        monkeypatch.setattr(registry.metadata, "entry_points", lambda group: [own])
        registry.catalogue.cache_clear()

    yield swap
    monkeypatch.undo()
    registry.catalogue.cache_clear()


def test_a_sticky_law_of_ones_own_has_the_columns_and_starts_of_ours(point, as_a_users_own):
    def candidates():
        return [each for each in wrist_candidates(point, searched(())) if each.law.id == LAW]

    ours = candidates()
    as_a_users_own()
    own = candidates()
    assert [each.name for each in own] == [each.name for each in ours] != []
    for one, other in zip(ours, own, strict=True):
        assert other.law.foreign
        assert (other.law.smooth, other.law.inexactness) == (one.law.smooth, one.law.inexactness)
        assert not one.law.smooth
        assert one.shapes == other.shapes
        assert np.array_equal(one.usual, other.usual)
        for shape in one.shapes:
            columns = one.at(shape)
            assert np.allclose(other.at(shape), columns, rtol=0.0, atol=1e-9 * abs(columns).max())
            starts = [e.effect(0.2 / e.usual, shape).estimates for e in (one, other)]
            assert starts[0] == starts[1]


def test_values_of_ones_own_law_are_tried_within_its_bounds(model, in_the_cell):
    """Of a law without a usual size, multiples of what was typed: no play can be below none."""

    class Narrow(JointClearance):
        id = "narrow_play"
        own = (Parameter("clearance_um", 0.0, 25.0, np.inf),)

    settings = CellSettings(rate_hz=10.0, program_seconds=30.0, program_seed=41, base="exact")
    problem = WristProblem(model, (as_units(model, in_the_cell(model.table, settings, 3)),))
    play = effect_at(Narrow(), "joint_3", {"clearance_um": 20.0})
    found = problem.extended(problem.begin(), play).base.beyond()[play.name]
    assert 0.0 <= found.estimates["clearance_um"].value < 1.0
