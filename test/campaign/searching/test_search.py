"""Where a search leads, by fits of which is known what they leave."""

import numpy as np
import pytest
from numpy.testing import assert_equal

from wrist_stiffness.campaign.searching import stepwise
from wrist_stiffness.campaign.searching.place import EXACT, ROUGH, WORTH
from wrist_stiffness.campaign.searching.screening import FittedCandidate
from wrist_stiffness.campaign.searching.seeking import Search

PLAY = "joint_clearance@joint_1"
CABLE = "cable_wrench@platform"
BACKLASH = "backlash@motor_1"
DELAY = "time_delay@pose_sensor"
CREEP = "creep@joint_1"
NUMBERS = 100
PRICE = 5.0


@pytest.mark.parametrize(("inexact", "enters"), [(50.0, True), (2e3, False)])
def test_what_an_inexact_law_leaves_of_a_large_effect_draws_nothing_in(wrist, inexact, enters):
    """Else an effect that is not there would be named beside every large one."""
    wrist.left = wrist.leaves(b=20e3, bd=20e3 - 1e3)
    reached = wrist.reached(BACKLASH, first=20e3 + inexact / EXACT**2)
    more = stepwise._one_more(wrist, reached, [wrist.candidate(DELAY)])
    assert (more is not None) == enters


@pytest.mark.parametrize(("share", "starts"), [(1.1, 2), (0.9, 1)])
def test_a_fit_that_leaves_very_much_is_begun_from_the_drawing_too(wrist, share, starts):
    """A base that gave way to a large effect does not find back."""
    large = share * ROUGH * NUMBERS
    wrist.left, wrist.afresh = wrist.leaves(alone=2.0 * large, b=large), wrist.leaves(b=NUMBERS)
    added = FittedCandidate(wrist.candidate(BACKLASH), {}, large, PRICE)
    found = stepwise.with_one_more(wrist, wrist.reached(), added)
    assert len(wrist.done) == starts
    assert found.base.cost == (NUMBERS if starts == 2 else large)
    assert found.prices == {BACKLASH: PRICE}


def test_the_better_of_two_starts_is_kept(wrist):
    """From the drawing a fit may as well end further off."""
    large = 2.0 * ROUGH * NUMBERS
    wrist.left, wrist.afresh = wrist.leaves(alone=2.0 * large, b=large), wrist.leaves(b=1.5 * large)
    added = FittedCandidate(wrist.candidate(BACKLASH), {}, large, PRICE)
    assert stepwise.with_one_more(wrist, wrist.reached(), added).base.cost == large


def test_an_effect_that_entered_first_gives_its_place_to_a_better_one(wrist):
    """What explains most alone is not always what explains most beside the others."""
    wrist.left = wrist.leaves(alone=1000, c=500, d=700, b=800, bc=300, cd=460, bd=280, bcd=278)
    known = [wrist.candidate(each) for each in (BACKLASH, CREEP, DELAY)]
    found = stepwise.extended(wrist, wrist.reached(first=1000.0), known)
    assert found.prices.keys() == {BACKLASH, DELAY}
    assert found.base.cost == 280


def test_a_rival_takes_no_place_by_promises(wrist):
    """Its columns may gain much where the whole fit gains less than with what it would replace."""
    wrist.left, wrist.promised = wrist.leaves(b=800, bc=300, bd=310), {DELAY: 600.0}
    begun = wrist.reached(CREEP, BACKLASH, first=1000.0)
    known = [wrist.candidate(each) for each in (BACKLASH, CREEP, DELAY)]
    assert stepwise._contested(wrist, begun, CREEP, known) is begun
    assert [names for names, _, _ in wrist.done] == [{BACKLASH, DELAY}]


@pytest.mark.parametrize(("again", "cost"), [(900, 900), (990, 1000)])
def test_the_base_alone_is_fitted_again_from_where_the_search_led(wrist, again, cost):
    """A wrong flange may have caught the first, and its strain be taken for an effect's."""
    wrist.left, wrist.afresh = wrist.leaves(alone=again, b=300), wrist.leaves(alone=1000)
    wrist.strained = {1000}
    search = Search(wrist, ())
    assert search.strained == (cost == 1000)
    assert search.thorough().base.cost == cost


@pytest.mark.parametrize(("again", "begun"), [(640, 640), (660, 1000)])
def test_the_search_begins_again_where_a_wrong_flange_had_caught_the_base(wrist, again, begun):
    """Out of its hold the base alone explains half of what an effect had seemed to explain."""
    wrist.left, wrist.afresh = wrist.leaves(alone=again, b=300), wrist.leaves(alone=1000)
    assert Search(wrist, ()).first_cost == begun


def test_a_base_that_leaves_very_much_did_not_give_way(wrist):
    """It does not pass for what it leaves: then only the best play is begun from the drawing."""
    wrist.left, wrist.strained = (
        wrist.leaves(alone=ROUGH * NUMBERS),
        {ROUGH * NUMBERS, 1 + ROUGH * NUMBERS},
    )
    assert wrist.reached().gave_way
    wrist.left = wrist.leaves(alone=1 + ROUGH * NUMBERS)
    assert not wrist.reached().gave_way


@pytest.mark.parametrize(
    ("alone", "strained", "drawing", "cost"),
    [(500, True, 120, 120), (500, True, 600, 498), (500, False, 120, 498), (140, True, 120, 138)],
)
def test_play_is_begun_from_the_drawing_where_the_base_gave_way(
    wrist, alone, strained, drawing, cost
):
    """It had taken up so much of the play that no pin finds back from there."""
    wrist.left, wrist.beside = wrist.leaves(alone=alone, p=alone - 2, w=50), wrist.leaves(p=drawing)
    wrist.strained = {alone} if strained else set()
    assert Search(wrist, ()).thorough().fits[PLAY].cost == cost


@pytest.mark.parametrize(("cable", "much"), [(-1, True), (1, False)])
def test_whole_fits_that_come_less_far_than_the_base_alone_are_no_answer(wrist, cable, much):
    """Their freedom costs more than they explain."""
    wrist.left = wrist.leaves(alone=1000, w=1000 - PRICE - WORTH + cable)
    assert (Search(wrist, ()).thorough() is not None) == much


@pytest.mark.parametrize(("cable", "much"), [(-1, True), (1, False)])
def test_whole_fits_that_come_less_far_than_tangents_led_are_no_answer(wrist, cable, much):
    """Two effects that tangents named explain what one of another kind does not."""
    both = 300 + PRICE + WORTH
    wrist.left = wrist.leaves(alone=1000, b=600, d=700, bd=300, w=both + WORTH + cable)
    search = Search(wrist, ())
    assert search.found == {BACKLASH, DELAY}
    assert (search.thorough() is not None) == much


def test_what_tangents_led_to_stands_as_it_is_among_whole_fits(wrist):
    """A fit from the base alone may end elsewhere than the one that was found first."""
    wrist.left = wrist.leaves(alone=1000, b=300, c=400, w=500)
    search = Search(wrist, ())
    place = search.thorough()
    assert place.fits.keys() == {BACKLASH, CABLE}
    assert place.fits[BACKLASH] is search.quick().base
    strains = {each.name: each.strain for each in place.candidates if each.name in place.fits}
    assert strains == {BACKLASH: 300 - 1000, CABLE: 500 - 1000}


def test_what_was_not_measured_is_changed_by_nothing(wrist):
    """A tracker's points hold no rotation, and a column of NaN is refused."""
    wrist.left, wrist.unmeasured = wrist.leaves(alone=1000, p=900, w=500), [0, 4]
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
    wrist.left = wrist.leaves(**left)
    assert Search(wrist, ()).explained == explained


@pytest.mark.parametrize(("laws", "fitted"), [({"cable_wrench"}, {CABLE}), ((), {BACKLASH})])
def test_only_laws_that_are_asked_for_are_fitted_whole(wrist, laws, fitted):
    """Beside what tangents led to, where they led anywhere."""
    tangents = wrist.leaves(b=300) if BACKLASH in fitted else wrist.leaves(b=990)
    wrist.left = wrist.leaves(alone=1000, p=200, w=300) | tangents
    place = Search(wrist, ()).thorough(laws)
    assert place.fits.keys() == fitted


def test_of_two_that_tangents_led_to_each_stands_alone_among_whole_fits(wrist):
    """One of them with the other's help would be better than all others."""
    wrist.left = wrist.leaves(alone=1000, b=600, d=700, bd=300, w=200)
    search = Search(wrist, ())
    costs = {name: each.cost for name, each in search.thorough().fits.items()}
    assert costs == {BACKLASH: 600, DELAY: 700, CABLE: 200}


@pytest.mark.parametrize(("beside", "kept"), [(250, 250), (350, 300)])
def test_play_is_fitted_to_its_end_where_it_explains_most(wrist, beside, kept):
    """The base's slopes did not know of it, and what it leaves would be taken for an effect."""
    wrist.left, wrist.beside = wrist.leaves(alone=1000, p=300, w=500), wrist.leaves(p=beside)
    assert Search(wrist, ()).thorough().fits[PLAY].cost == kept
    assert [names for names, _, finished in wrist.done if finished] == [{PLAY}]


def test_play_is_begun_from_the_drawing_where_very_much_is_left(wrist):
    """25 um of play ended at 8, behind a bracket; beside its slopes from the drawing at 24.6."""
    wrist.left, wrist.beside = wrist.leaves(alone=10**6, p=9 * 10**5, w=10**5), wrist.leaves(p=500)
    assert Search(wrist, ()).thorough().fits[PLAY].cost == 500
    finished = [(names, start is None) for names, start, beside in wrist.done if beside]
    assert finished == [({PLAY}, False), ({PLAY}, True)]


def test_what_is_no_play_is_fitted_once(wrist):
    """Beside play a fit takes a minute."""
    wrist.left = wrist.leaves(alone=1000, p=500, w=300)
    Search(wrist, ()).thorough()
    assert not any(finished for _, _, finished in wrist.done)


@pytest.mark.parametrize(("first", "doubtful"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("strained", [True, False])
def test_a_base_that_is_strained_beside_what_was_found_is_doubted(wrist, first, doubtful, strained):
    """It stands in for another effect; beside a large one nothing else explains as much."""
    wrist.left = wrist.leaves(alone=first * ROUGH * NUMBERS, b=200)
    wrist.strained = {200} if strained else set()
    search = Search(wrist, ())
    assert search.found == {BACKLASH}
    assert search.doubtful == (doubtful and strained)
