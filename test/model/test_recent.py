"""What the first of the last models did at a block, taken over by the next ones at it."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.model import batch
from wrist_stiffness.model.batch import MOST_KEPT, Recent
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law

CHUNK = 8


@pytest.fixture
def evaluated(monkeypatch):
    """Number of the chunks that a first model was evaluated at, each time."""
    monkeypatch.setattr(batch, "CHUNK", CHUNK)
    found, own = [], batch.evaluate
    monkeypatch.setattr(batch, "evaluate", lambda *a, **k: found.append(1) or own(*a, **k))
    return found


def alike(one, other):
    scale = np.abs(other.measured).max(axis=0)
    return bool(np.all(np.abs(one.measured - other.measured) <= 1e-12 * scale))


def test_a_model_is_evaluated_once_at_a_block_and_others_beside_it(model, make, evaluated):
    rubbing = make.effect("joint_friction@joint_3", coefficient=0.2, bristle_um_per_N=0.5)
    bent = make.effect("link_stiffness@link_1", flexibility_percent=5.0)
    block, recent = make.block(3 * CHUNK), Recent()
    model.batch_with(block, [(rubbing,)], recent=recent)
    assert len(evaluated) == 3
    again, beside = model.batch_with(block, [(rubbing,), (rubbing, bent)], recent=recent)
    assert len(evaluated) == 3
    apart = [model.batch_with(block, [each])[0] for each in ((rubbing,), (rubbing, bent))]
    assert alike(again, apart[0])
    assert alike(beside, apart[1])
    assert not alike(apart[1], apart[0])


def test_a_model_with_another_effect_or_one_more_is_another_one(model, make, evaluated):
    block, recent = make.block(CHUNK), Recent()
    soft, softer = (
        make.effect("link_stiffness@link_1", flexibility_percent=size) for size in (5.0, 50.0)
    )
    delayed = make.effect("creep@joint_3", delayed_percent=20.0, time_constant_s=5.0)
    models = [(soft,), (softer,), (softer, delayed)]
    found = [model.batch_with(block, [each], recent=recent)[0] for each in models]
    assert len(evaluated) == 3
    assert not alike(found[1], found[0])
    assert not alike(found[2], found[1])


class Own(Law):
    """A user's own law without parameters."""

    places = ("platform",)
    sentence = check = excited_by = ""

    def parameters(self, place):
        return ()


class Heavier(Own):
    """A platform of twice the weight."""

    id = "heavier"
    stage = "parts"

    def changed(self, parts, place, values):
        return replace(parts, platform_weight=2.0 * parts.platform_weight)


def test_another_model_takes_over_what_neither_springs_nor_weights_change(model, make, evaluated):
    """To the bit, and beyond the chunks that are kept."""
    block, recent = make.block((MOST_KEPT + 2) * CHUNK), Recent()
    soft = make.effect("link_stiffness@link_1", flexibility_percent=50.0)
    rubbing = make.effect("joint_friction@joint_3", coefficient=0.2, bristle_um_per_N=0.5)
    found = []
    for effects in ((), (soft, rubbing), (Effect(Heavier(), "platform"),), (soft,)):
        found += model.batch_with(block, [effects], recent=recent)
        (alone,) = model.batch_with(block, [effects])
        np.testing.assert_array_equal(found[-1].measured, alone.measured)
    assert not any(alike(one, other) for one, other in zip(found, found[1:], strict=False))


@pytest.mark.parametrize("changed", ["evaluation", "table"])
def test_the_same_effects_on_another_table_are_another_model(model, make, evaluated, changed):
    block, recent = make.block(CHUNK), Recent()
    other = {"evaluation": {"evaluation": "spline"}, "table": {"table": replace(model.table)}}
    for each in (model, replace(model, **other[changed])):
        each.batch_with(block, [()], recent=recent)
    assert len(evaluated) == 2


def test_of_a_long_block_only_its_first_chunks_are_kept(model, make, evaluated):
    block, recent = make.block((MOST_KEPT + 2) * CHUNK), Recent()
    creeping = make.effect("creep@joint_3", delayed_percent=20.0, time_constant_s=5.0)
    (at_first,) = model.batch_with(block, [(creeping,)], recent=recent)
    evaluated.clear()
    (again,) = model.batch_with(block, [(creeping,)], recent=recent)
    assert len(evaluated) == 2
    assert alike(again, at_first)


class Counting(Own):
    """Writes into its state: the platform turns on with every sample."""

    id = "counting"
    stage = "geometry"

    def advance(self, at, place, values, state):
        state = np.zeros(1) if state is None else state
        turned = state + 1e-6 * np.arange(1, len(at.block) + 1)
        state[:] = turned[-1]
        return at.screw(place, np.outer(turned, [0, 0, 0, 0, 0, 1])), state


def test_what_a_users_own_law_did_is_not_kept_for_it_may_write_into_its_state(
    model, make, evaluated
):
    """Behind the chunks that are kept its state was that of the last time's end."""
    block, recent = make.block((MOST_KEPT + 2) * CHUNK), Recent()
    counting = Effect(Counting(), "platform")
    first, again = (model.batch_with(block, [(counting,)], recent=recent)[0] for _ in range(2))
    assert alike(first, again)
