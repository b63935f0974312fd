"""Columns from the kept moments agree with those of every sample."""

import numpy as np
import pytest

from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.model.block import Block
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.error_model import ErrorModel
from wrist_stiffness.model.parameters import Estimate
from wrist_stiffness.model.registry import find_law
from wrist_stiffness.sessions import units as units_module
from wrist_stiffness.sessions.columns import SessionModel
from wrist_stiffness.sessions.measured_session import MeasuredSession
from wrist_stiffness.sessions.unit_session import as_units
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.simulation.cell import CellSettings, VirtualCell
from wrist_stiffness.simulation.instrument import LoadSensor, Noise

SECONDS, RATE_HZ = 30.0, 100.0

QUIET = LoadSensor(Noise(0.0, 0.0), Noise(0.0, 0.0))


@pytest.fixture(scope="module")
def model():
    table = load_table(shipped_file("precomputed/palmieri2015.npz"))
    return ErrorModel("shipped", table, "closed_form")


@pytest.fixture(scope="module")
def session(model):
    settings = CellSettings(
        rate_hz=RATE_HZ,
        program_seconds=SECONDS,
        program_seed=8,
        instrument="ideal",
        load_sensor=QUIET,
    )
    cell = VirtualCell(model.table, settings, np.random.default_rng(3))
    time = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    sample = cell.run(time, cell.desired(time))
    block = Block(time, sample.encoder, sample.wrench)
    return MeasuredSession("thirty seconds", block, sample.measured_shift, sample.measured_rotation)


def effect(name, **values):
    law, place = name.split("@")
    return Effect(find_law(law), place, {k: Estimate(v) for k, v in values.items()})


@pytest.mark.parametrize(
    ("added", "share"),
    [
        # Of the largest change.  A dwell is told by a handful of moments: what has no memory is
        # exact, what creeps or slips is as good as the trapezoid rule.
        (effect("platform_compliance@platform", z_um_per_N=1.0), 1e-8),
        (effect("backlash@motor_1", width_mdeg=50.0), 1e-8),
        (effect("joint_clearance@joint_3", clearance_um=5.0), 1e-8),
        (effect("creep@joint_3", delayed_percent=20.0, time_constant_s=5.0), 3e-3),
        # Steps of 10 ms themselves leave 9e-3 of friction: its path is followed to first order.
        (effect("joint_friction@joint_3", coefficient=0.1), 2e-3),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_kept_moments_tell_what_all_samples_tell(model, session, added, share):
    units = as_units(model, session)
    assert len(units.block) < len(session) / 5
    (column,) = SessionModel(model, units, ()).changes([(added,)])
    without, with_effect = model.batch_with(session.block, [(), (added,)])
    change, label = with_effect.twist - without.twist, units.cut.label
    # An effect that only turns, or only shifts, has nothing but rounding in the other half.
    scale = np.maximum([np.abs(change[:, :3]).max(), np.abs(change[:, 3:]).max()], [1e-9, 1e-7])
    full = np.array([change[label == u].mean(axis=0) for u in range(len(column))])
    off = np.abs(column - full) / np.repeat(scale, 3)
    dwell = units.cut.dwell
    assert off[dwell].max() < share
    # In motion only while the load changes: there it is a mean over some 50 ms.  Play jumps where
    # the load passes zero: one moment of five on the other side is two fifths of its size.
    assert np.median(off[~dwell]) < 1e-3
    most = 0.42 if added.law.id == "joint_clearance" else 0.05
    assert np.quantile(off[~dwell], 0.99) < most


def test_what_has_no_past_needs_no_path(model, session, monkeypatch):
    """Play seeks near the moment before; that is a guess, and no past."""
    monkeypatch.setattr(units_module, "MOST_MOVING", 5)
    units = as_units(model, session)
    inside = np.count_nonzero(units.cut.unit >= 0)
    assert inside < 0.5 * len(units.block)
    asked, own = [], ErrorModel.batch_with
    monkeypatch.setattr(
        ErrorModel,
        "batch_with",
        lambda self, block, *more: asked.append(len(block)) or own(self, block, *more),
    )
    for added, moments in (
        (effect("joint_clearance@joint_3", clearance_um=5.0), inside),
        (effect("creep@joint_3", delayed_percent=20.0, time_constant_s=5.0), len(units.block)),
    ):
        (whole,) = own(model, units.block, [(added,)])
        asked.clear()
        (found,) = SessionModel(model, units, ()).along([(*model.effects, added)])
        assert asked == [moments]
        assert found == pytest.approx(units.mean(whole.measured), rel=1e-9, abs=1e-18)


@pytest.mark.parametrize(
    ("name", "on_the_path"),
    [
        ("platform_compliance@platform", False),
        ("creep@joint_3", True),
        ("transmission_error@motor_1", True),
    ],
)
def test_what_has_a_past_or_many_waves_is_not_told_by_mean_moments(
    model, session, name, on_the_path
):
    at = SessionModel(model, as_units(model, session), ())
    assert at.remembers((effect(name),)) == on_the_path
