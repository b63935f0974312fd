"""The steps of the search, on fits that are only told what they leave."""

from types import SimpleNamespace

import pytest

from wrist_stiffness.campaign.searching import stepwise
from wrist_stiffness.campaign.searching.place import WORTH, Reached
from wrist_stiffness.campaign.searching.screening import FittedCandidate

COST = 1000.0
PRICE = 5.0
PROMISED = 400.0


class Promising(Reached):
    """A base beside which every candidate gains much by its columns, and `kept` by its law."""

    kept: dict[str, float]

    def screen(self, without=None):
        candidates = [SimpleNamespace(name=name) for name in self.kept]
        return SimpleNamespace(
            leaders=lambda _: [(PROMISED, each, ()) for each in candidates],
            fitted=lambda each, shape, value: FittedCandidate(
                each, {}, self.kept[each.name], PRICE
            ),
        )


def promising(**kept):
    reached = Promising(SimpleNamespace(cost=COST), {}, COST)
    object.__setattr__(reached, "kept", kept)
    return reached


@pytest.fixture
def whole(monkeypatch):
    """Fits with the whole base: each leaves the cost that is listed for it; those done, in turn."""
    costs, done = {}, []

    def with_base(model, reached, added):
        name = added.candidate.name
        done.append(name)
        return Reached(SimpleNamespace(cost=costs[name]), {name: added.price}, COST)

    monkeypatch.setattr(stepwise, "with_one_more", with_base)
    return SimpleNamespace(costs=costs, done=done)


def test_a_law_of_very_many_constants_follows_nothing():
    """It takes up a part of all that is missing."""
    few, many = (SimpleNamespace(name=name, usual=[1.0] * n) for name, n in (("a", 21), ("b", 35)))
    assert stepwise._may_follow(many, {})
    assert stepwise._may_follow(few, {"c": PRICE})
    assert not stepwise._may_follow(many, {"c": PRICE})
    assert not stepwise._may_follow(few, {"a": PRICE})


def test_leaders_whose_laws_keep_nothing_end_the_search(whole):
    reached = promising(play=-3.0, cable=WORTH - 1.0)
    assert stepwise._one_more(None, reached, ()) is None
    assert whole.done == []


def test_a_fit_that_does_not_pay_beside_the_whole_base_gives_way_to_the_next(whole):
    whole.costs.update(play=COST, cable=COST - PRICE - WORTH - 1.0)
    more = stepwise._one_more(None, promising(play=PROMISED, cable=100.0), ())
    assert whole.done == ["play", "cable"]
    assert more.prices == {"cable": PRICE}


def test_a_step_is_given_up_after_three_fits_that_do_not_pay(whole):
    kept = {"a": 400.0, "b": 150.0, "c": 60.0, "d": 50.0, "e": 40.0}
    whole.costs.update(dict.fromkeys(kept, COST - PRICE - WORTH + 1.0))
    assert stepwise._one_more(None, promising(**kept), ()) is None
    assert whole.done == ["a", "b", "c"]
