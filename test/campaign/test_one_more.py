"""The steps of the search, on fits that are only told what they leave."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_equal

from wrist_stiffness.campaign.searching import place, seeking
from wrist_stiffness.campaign.searching.place import EXACT, ROUGH, WORTH, Reached
from wrist_stiffness.campaign.searching.screening import Fitted
from wrist_stiffness.campaign.searching.seeking import INEXACT, Search
from wrist_stiffness.model.parameters import Parameter

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
            fitted=lambda each, shape, value: Fitted(each, {}, self.kept[each.name], PRICE),
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

    monkeypatch.setattr(seeking, "_with", with_base)
    return SimpleNamespace(costs=costs, done=done)


def test_leaders_whose_laws_keep_nothing_end_the_search(whole):
    reached = promising(play=-3.0, cable=WORTH - 1.0)
    assert seeking._one_more(None, reached, ()) is None
    assert whole.done == []


def test_a_fit_that_does_not_pay_beside_the_whole_base_gives_way_to_the_next(whole):
    whole.costs.update(play=COST, cable=COST - PRICE - WORTH - 1.0)
    more = seeking._one_more(None, promising(play=PROMISED, cable=100.0), ())
    assert whole.done == ["play", "cable"]
    assert more.prices == {"cable": PRICE}


def test_a_step_is_given_up_after_three_fits_that_do_not_pay(whole):
    kept = {"a": 400.0, "b": 150.0, "c": 60.0, "d": 50.0, "e": 40.0}
    whole.costs.update(dict.fromkeys(kept, COST - PRICE - WORTH + 1.0))
    assert seeking._one_more(None, promising(**kept), ()) is None
    assert whole.done == ["a", "b", "c"]


PLAY, CABLE = "joint_clearance@joint_1", "cable_wrench@platform"
BACKLASH, DELAY, CREEP = "backlash@motor_1", "time_delay@pose_sensor", "creep@joint_1"
OTHER_PLAY, FRICTION = "joint_clearance@joint_2", "joint_friction@joint_2"
THIRD_PLAY = "joint_clearance@joint_3"
UNPROMISED = (PLAY, OTHER_PLAY, THIRD_PLAY, FRICTION, CABLE)
PARAMETER = Parameter("shape", 0.0, 9.0, 1.0)
NUMBERS = 100
"""Measured numbers, so what noise alone would leave."""


class Wrist:
    """Stands for a fitter: knows what is left along with any effects.

    `afresh`, `beside` and `rounded` say what else is left of fits from the drawing, beside play,
    and with rounded walls; `done` lists the fits in turn.  What columns promise is what whole fits
    keep, where `promised` does not list it; no tangent shows play and friction.
    """

    model = None

    def __init__(self):
        self.left, self.afresh, self.beside, self.rounded = {}, {}, {}, {}
        self.promised = dict.fromkeys(UNPROMISED, 0.0)
        self.done, self.strained, self.unmeasured = [], set(), []

    def tell(self, text):
        """Nobody listens."""

    def __call__(self, sessions, extras=(), start=None, beside=False, walls="sharp"):
        names = frozenset(each.name for each in extras)
        self.done.append((names, start, walls if walls == "rounded" else beside))
        how = self.beside if beside else self.afresh if start is None else {}
        how = self.rounded if walls == "rounded" else how
        return self.base(how.get(names, self.left[names]), extras)

    def base(self, cost, extras=()):
        table = SimpleNamespace(measured=np.ones(NUMBERS, dtype=bool))
        model = SimpleNamespace(effects=())
        residual = np.full((1, 6), float(cost))
        residual[:, self.unmeasured] = np.nan
        return SimpleNamespace(
            cost=cost,
            extras=tuple(each.name for each in extras),
            beyond=lambda: {each.name: each for each in extras},
            problem=SimpleNamespace(table=table, sessions=(), model=model),
            residual=residual,
            strain=cost,
            strained=cost in self.strained,
            variance=cost / NUMBERS,
        )

    def reached(self, *names, first=0.0):
        extras = [effect(name) for name in names]
        base = self.base(self.left[frozenset(names)], extras)
        return Reached(base, dict.fromkeys(names, PRICE), first)

    def screen(self, base, point, without=None):
        """Stands for a screen: what candidates gain is what fits along with them leave less."""
        names = frozenset(base.extras) - {without}
        energy = self.left[names]

        def gain(each):
            kept = energy - self.left.get(names | {each.name}, energy) - PRICE
            return self.promised.get(each.name, kept)

        return SimpleNamespace(
            energy=energy,
            leaders=lambda known: sorted(
                ((gain(each), each, ()) for each in known), key=lambda found: -found[0]
            ),
            fitted=lambda each, shape, value: Fitted(each, {}, value, PRICE),
        )


def effect(name):
    law, component = name.split("@")
    own = SimpleNamespace(id=law, parameters=lambda place: (PARAMETER,))
    return SimpleNamespace(
        name=name, law=own, component=component, parameters=(PARAMETER,), estimates={}
    )


def candidate(name, **whole):
    return SimpleNamespace(
        name=name,
        law=effect(name).law,
        place=effect(name).component,
        effect_of=lambda values: effect(name),
        changed_by=lambda change, strain: candidate(name, change=change, strain=strain),
        **whole,
    )


@pytest.fixture
def wrist(monkeypatch):
    """A wrist whose catalogue is all that any of its fits knows."""
    wrist = Wrist()

    def catalogue(point, held, near, laws=None):
        names = sorted(frozenset().union(*wrist.left))
        names = [name for name in names if laws is None or name.split("@")[0] in laws]
        return tuple(candidate(name) for name in names if name not in held)

    monkeypatch.setattr(seeking, "wrist_candidates", catalogue)
    for module in (place, seeking):
        monkeypatch.setattr(module, "point_of", lambda base, with_extras=False: None)
    monkeypatch.setattr(seeking, "free_base", lambda model: ((), ()))
    monkeypatch.setattr(place, "Screen", wrist.screen)
    return wrist


LETTERS = {"b": BACKLASH, "c": CREEP, "d": DELAY, "p": PLAY, "w": CABLE} | {
    "f": FRICTION,
    "q": OTHER_PLAY,
    "t": THIRD_PLAY,
}


def leaves(**kept):
    """Return what is left along with sets of effects; letters stand for them."""
    alone = {frozenset(): kept.pop("alone")} if "alone" in kept else {}
    return alone | {frozenset(LETTERS[each] for each in key): left for key, left in kept.items()}


@pytest.mark.parametrize(("inexact", "enters"), [(50.0, True), (2e3, False)])
def test_what_an_inexact_law_leaves_of_a_large_effect_draws_nothing_in(wrist, inexact, enters):
    """Else an effect that is not there would be named beside every large one."""
    wrist.left = leaves(b=20e3, bd=20e3 - 1e3)
    reached = wrist.reached(BACKLASH, first=20e3 + inexact / EXACT**2)
    more = seeking._one_more(wrist, reached, [candidate(DELAY)])
    assert (more is not None) == enters


@pytest.mark.parametrize(("share", "starts"), [(1.1, 2), (0.9, 1)])
def test_a_fit_that_leaves_very_much_is_begun_from_the_drawing_too(wrist, share, starts):
    """A base that gave way to a large effect does not find back."""
    large = share * ROUGH * NUMBERS
    wrist.left, wrist.afresh = leaves(alone=2.0 * large, b=large), leaves(b=NUMBERS)
    added = Fitted(candidate(BACKLASH), {}, large, PRICE)
    found = seeking._with(wrist, wrist.reached(), added)
    assert len(wrist.done) == starts
    assert found.base.cost == (NUMBERS if starts == 2 else large)
    assert found.prices == {BACKLASH: PRICE}


def test_the_better_of_two_starts_is_kept(wrist):
    """From the drawing a fit may as well end further off."""
    large = 2.0 * ROUGH * NUMBERS
    wrist.left, wrist.afresh = leaves(alone=2.0 * large, b=large), leaves(b=1.5 * large)
    added = Fitted(candidate(BACKLASH), {}, large, PRICE)
    assert seeking._with(wrist, wrist.reached(), added).base.cost == large


def test_an_effect_that_entered_first_gives_its_place_to_a_better_one(wrist):
    """What explains most alone is not always what explains most beside the others."""
    wrist.left = leaves(alone=1000, c=500, d=700, b=800, bc=300, cd=460, bd=280, bcd=278)
    known = [candidate(each) for each in (BACKLASH, CREEP, DELAY)]
    found = seeking._extended(wrist, wrist.reached(first=1000.0), known)
    assert found.prices.keys() == {BACKLASH, DELAY}
    assert found.base.cost == 280


def test_a_rival_takes_no_place_by_promises(wrist):
    """Its columns may gain much where the whole fit gains less than with what it would replace."""
    wrist.left, wrist.promised = leaves(b=800, bc=300, bd=310), {DELAY: 600.0}
    begun = wrist.reached(CREEP, BACKLASH, first=1000.0)
    known = [candidate(each) for each in (BACKLASH, CREEP, DELAY)]
    assert seeking._contested(wrist, begun, CREEP, known) is begun
    assert [names for names, _, _ in wrist.done] == [{BACKLASH, DELAY}]


@pytest.mark.parametrize(("again", "cost"), [(900, 900), (990, 1000)])
def test_the_base_alone_is_fitted_again_from_where_the_search_led(wrist, again, cost):
    """A wrong flange may have caught the first, and its strain be taken for an effect's."""
    wrist.left, wrist.afresh = leaves(alone=again, b=300), leaves(alone=1000)
    wrist.strained = {1000}
    search = Search(wrist, ())
    assert search.strained == (cost == 1000)
    assert search.thorough().base.cost == cost


@pytest.mark.parametrize(("again", "begun"), [(640, 640), (660, 1000)])
def test_the_search_begins_again_where_a_wrong_flange_had_caught_the_base(wrist, again, begun):
    """Out of its hold the base alone explains half of what an effect had seemed to explain."""
    wrist.left, wrist.afresh = leaves(alone=again, b=300), leaves(alone=1000)
    assert Search(wrist, ()).first_cost == begun


def test_a_base_that_leaves_very_much_did_not_give_way(wrist):
    """It does not pass for what it leaves: then only the best play is begun from the drawing."""
    wrist.left, wrist.strained = (
        leaves(alone=ROUGH * NUMBERS),
        {ROUGH * NUMBERS, 1 + ROUGH * NUMBERS},
    )
    assert wrist.reached().gave_way
    wrist.left = leaves(alone=1 + ROUGH * NUMBERS)
    assert not wrist.reached().gave_way


@pytest.mark.parametrize(
    ("alone", "strained", "drawing", "cost"),
    [(500, True, 120, 120), (500, True, 600, 498), (500, False, 120, 498), (140, True, 120, 138)],
)
def test_play_is_begun_from_the_drawing_where_the_base_gave_way(
    wrist, alone, strained, drawing, cost
):
    """It had taken up so much of the play that no pin finds back from there."""
    wrist.left, wrist.beside = leaves(alone=alone, p=alone - 2, w=50), leaves(p=drawing)
    wrist.strained = {alone} if strained else set()
    assert Search(wrist, ()).thorough().fits[PLAY].cost == cost


@pytest.mark.parametrize(("cable", "much"), [(-1, True), (1, False)])
def test_whole_fits_that_come_less_far_than_the_base_alone_are_no_answer(wrist, cable, much):
    """Their freedom costs more than they explain."""
    wrist.left = leaves(alone=1000, w=1000 - PRICE - WORTH + cable)
    assert (Search(wrist, ()).thorough() is not None) == much


@pytest.mark.parametrize(("cable", "much"), [(-1, True), (1, False)])
def test_whole_fits_that_come_less_far_than_tangents_led_are_no_answer(wrist, cable, much):
    """Two effects that tangents named explain what one of another kind does not."""
    both = 300 + PRICE + WORTH
    wrist.left = leaves(alone=1000, b=600, d=700, bd=300, w=both + WORTH + cable)
    search = Search(wrist, ())
    assert search.found == {BACKLASH, DELAY}
    assert (search.thorough() is not None) == much


def test_what_tangents_led_to_stands_as_it_is_among_whole_fits(wrist):
    """A fit from the base alone may end elsewhere than the one that was found first."""
    wrist.left = leaves(alone=1000, b=300, c=400, w=500)
    search = Search(wrist, ())
    place = search.thorough()
    assert place.fits.keys() == {BACKLASH, CABLE}
    assert place.fits[BACKLASH] is search.quick().base
    strains = {each.name: each.strain for each in place.candidates if each.name in place.fits}
    assert strains == {BACKLASH: 300 - 1000, CABLE: 500 - 1000}


def test_what_was_not_measured_is_changed_by_nothing(wrist):
    """A tracker's points hold no rotation, and a column of NaN is refused."""
    wrist.left, wrist.unmeasured = leaves(alone=1000, p=900, w=500), [0, 4]
    changes = [each.change for each in Search(wrist, ()).thorough().candidates]
    assert_equal([np.flatnonzero(each == 0) for each in changes], [[0, 4]] * 2)


@pytest.mark.parametrize(
    ("left", "explained"),
    [
        ({"alone": 1000, "b": NUMBERS}, True),
        ({"alone": 1000, "b": NUMBERS + 1}, False),
        ({"alone": NUMBERS, "b": NUMBERS}, False),
        ({"alone": 1000, "b": 500, "d": 600, "bd": NUMBERS}, False),
    ],
)
def test_one_effect_that_leaves_no_more_than_the_noise_explains_it(wrist, left, explained):
    wrist.left = leaves(**left)
    assert Search(wrist, ()).explained == explained


@pytest.mark.parametrize(("laws", "fitted"), [({"cable_wrench"}, {CABLE}), ((), {BACKLASH})])
def test_only_laws_that_are_asked_for_are_fitted_whole(wrist, laws, fitted):
    """Beside what tangents led to, where they led anywhere."""
    tangents = leaves(b=300) if BACKLASH in fitted else leaves(b=990)
    wrist.left = leaves(alone=1000, p=200, w=300) | tangents
    place = Search(wrist, ()).thorough(laws)
    assert place.fits.keys() == fitted


def test_of_two_that_tangents_led_to_each_stands_alone_among_whole_fits(wrist):
    """One of them with the other's help would be better than all others."""
    wrist.left = leaves(alone=1000, b=600, d=700, bd=300, w=200)
    search = Search(wrist, ())
    costs = {name: each.cost for name, each in search.thorough().fits.items()}
    assert costs == {BACKLASH: 600, DELAY: 700, CABLE: 200}


@pytest.mark.parametrize(("beside", "kept"), [(250, 250), (350, 300)])
def test_play_is_fitted_to_its_end_where_it_explains_most(wrist, beside, kept):
    """The base's slopes did not know of it, and what it leaves would be taken for an effect."""
    wrist.left, wrist.beside = leaves(alone=1000, p=300, w=500), leaves(p=beside)
    assert Search(wrist, ()).thorough().fits[PLAY].cost == kept
    assert [names for names, _, finished in wrist.done if finished] == [{PLAY}]


def test_play_is_begun_from_the_drawing_where_very_much_is_left(wrist):
    """25 um of play ended at 8, behind a bracket; beside its slopes from the drawing at 24.6."""
    wrist.left, wrist.beside = leaves(alone=10**6, p=9 * 10**5, w=10**5), leaves(p=500)
    assert Search(wrist, ()).thorough().fits[PLAY].cost == 500
    finished = [(names, start is None) for names, start, beside in wrist.done if beside]
    assert finished == [({PLAY}, False), ({PLAY}, True)]


def test_what_is_no_play_is_fitted_once(wrist):
    """Beside play a fit takes a minute."""
    wrist.left = leaves(alone=1000, p=500, w=300)
    Search(wrist, ()).thorough()
    assert not any(finished for _, _, finished in wrist.done)


@pytest.mark.parametrize(("first", "doubtful"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("strained", [True, False])
def test_a_base_that_is_strained_beside_what_was_found_is_doubted(wrist, first, doubtful, strained):
    """It stands in for another effect; beside a large one nothing else explains as much."""
    wrist.left = leaves(alone=first * ROUGH * NUMBERS, b=200)
    wrist.strained = {200} if strained else set()
    search = Search(wrist, ())
    assert search.found == {BACKLASH}
    assert search.doubtful == (doubtful and strained)


def test_play_is_tried_beside_what_was_named_alone(wrist):
    """What only slopes named would bear what play leaves."""
    wrist.left = leaves(alone=1000, b=600, d=800, bd=300, bp=250, bdp=290)
    wrist.rounded, wrist.beside = leaves(bp=280), leaves(bp=240)
    search = Search(wrist, ())
    assert search.found == {BACKLASH, DELAY}
    place = search.further([BACKLASH], {})
    assert place.known
    assert place.base.extras == (BACKLASH,)
    assert {name: set(fit.extras) for name, fit in place.fits.items()} == {PLAY: {BACKLASH, PLAY}}
    assert place.fits[PLAY].cost == 240


@pytest.mark.parametrize("law", ["bushing_stiffness", "bushing_hardening"])
def test_beside_play_the_bushing_in_its_gap_is_not_asked_for(wrist, law):
    """It would stand for the way the gap closes, which no law knows exactly."""
    own, other = ({f"{law}@joint_{number}"} for number in (1, 2))
    wrist.left = leaves(alone=1000, p=300) | {frozenset(each): 900 for each in (own, other)}
    search = Search(wrist, ())
    fit = wrist.reached(PLAY).base
    assert {each.name for each in search.beside(fit).candidates} == other
    assert {each.name for each in search.quick().candidates} >= own | other


@pytest.mark.parametrize(("share", "tried"), [(0.9, False), (1.1, True)])
def test_play_is_tried_only_where_more_than_noise_is_left(wrist, share, tried):
    """It takes minutes, and what is left there needs no further name."""
    left = share * INEXACT * NUMBERS
    wrist.left = leaves(alone=1000, b=left, bp=left - 60)
    search = Search(wrist, ())
    assert (search.further([BACKLASH], {}) is not None) == tried
    assert any(PLAY in names for names, _, _ in wrist.done) == tried


def test_of_several_plays_the_two_that_lead_with_rounded_walls_are_fitted_as_they_are(wrist):
    """Rounded walls tell which leads, in a third of the time."""
    wrist.left = leaves(alone=1000, b=500, bp=400, bq=400, bt=400)
    wrist.rounded = leaves(bp=300, bq=250, bt=350)
    wrist.beside = leaves(bp=200, bq=260)
    place = Search(wrist, ()).further([BACKLASH], {})
    assert {name: fit.cost for name, fit in place.fits.items()} == {PLAY: 200, OTHER_PLAY: 260}


def test_what_rounded_walls_promise_and_the_law_does_not_keep_is_no_answer(wrist):
    wrist.left = leaves(alone=1000, b=500, bp=600)
    wrist.rounded, wrist.beside = leaves(bp=200), leaves(bp=490)
    assert Search(wrist, ()).further([BACKLASH], {}) is None


@pytest.mark.parametrize(("share", "tried"), [(0.9, False), (1.1, True)])
def test_a_joint_that_rubs_is_tried_beside_play_that_leaves_very_much(wrist, share, tried):
    """What it holds off its wall is no play, and alone it explains little."""
    left = share * ROUGH * NUMBERS
    wrist.left = leaves(alone=5000, b=4000, bp=left, bpf=left / 2, bpq=5000)
    search = Search(wrist, ())
    fit = wrist.reached(BACKLASH, PLAY).base
    place = search.further([BACKLASH, PLAY], {PLAY: fit})
    assert any(FRICTION in names for names, _, _ in wrist.done) == tried
    if tried:
        assert place.base is fit
        assert set(place.fits) == {FRICTION}


def test_play_that_explains_nothing_beside_what_was_named_is_no_answer(wrist):
    wrist.left = leaves(alone=1000, b=500, bp=480)
    search = Search(wrist, ())
    assert search.further([BACKLASH], {}) is None
    # Nor is anything tried beside what only slopes named.
    assert search.further([CREEP], {}) is None
