"""What is sought beside what was named: play, and beside it a joint that rubs."""

import pytest

from wrist_stiffness.campaign.searching.from_afar import SMALL
from wrist_stiffness.campaign.searching.place import ASTRAY, INEXACT
from wrist_stiffness.campaign.searching.seeking import Search

PLAY = "joint_clearance@joint_1"
BACKLASH = "backlash@motor_1"
DELAY = "time_delay@pose_sensor"
CREEP = "creep@joint_1"
OTHER_PLAY = "joint_clearance@joint_2"
FRICTION = "joint_friction@joint_2"
NUMBERS = 100


def test_play_is_tried_beside_what_was_named_alone(wrist):
    """What only slopes named would bear what play leaves."""
    wrist.left = wrist.leaves(alone=1000, b=600, d=800, bd=300, bp=250, bdp=290)
    wrist.beside = wrist.leaves(bp=240)
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
    wrist.left = wrist.leaves(alone=1000, p=300) | {frozenset(each): 900 for each in (own, other)}
    search = Search(wrist, ())
    fit = wrist.reached(PLAY).base
    assert {each.name for each in search.beside(fit).candidates} == other
    assert {each.name for each in search.quick().candidates} >= own | other


@pytest.mark.parametrize(("share", "tried"), [(0.9, False), (1.1, True)])
def test_play_is_tried_only_where_more_than_noise_is_left(wrist, share, tried):
    """It takes minutes, and what is left there needs no further name."""
    left = share * INEXACT * NUMBERS
    wrist.left = wrist.leaves(alone=1000, b=left, bp=left - 60)
    search = Search(wrist, ())
    assert (search.further([BACKLASH], {}) is not None) == tried
    assert any(PLAY in names for names, _, _ in wrist.done) == tried


def test_of_several_plays_the_two_that_lead_with_rounded_walls_are_fitted_as_they_are(wrist):
    """Rounded walls tell which leads; the walls as they are, how far."""
    wrist.left = wrist.leaves(alone=9000, b=5000, bp=4000, bq=4000, bt=4000)
    wrist.rounded = wrist.leaves(bp=300, bq=250, bt=350)
    wrist.beside = wrist.leaves(bp=200, bq=260)
    place = Search(wrist, ()).further([BACKLASH], {})
    assert {name: fit.cost for name, fit in place.fits.items()} == {PLAY: 200, OTHER_PLAY: 260}


def test_play_begins_with_its_usual_size_beside_what_was_found(wrist):
    wrist.left = wrist.leaves(alone=9000, bf=5000, b=7000, f=6000, bfp=4000)
    fit = wrist.reached(BACKLASH, FRICTION).base
    search = Search(wrist, ())
    wrist.done.clear(), wrist.sizes.clear()
    assert search.further([BACKLASH, FRICTION], {FRICTION: fit})
    easy = [n for n, (_, _, walls) in enumerate(wrist.done) if walls == "rounded"]
    assert [wrist.sizes[n] for n in easy] == [{BACKLASH: None, FRICTION: None, PLAY: 1.0}]
    assert [wrist.done[n][1] for n in easy] == [fit]


@pytest.mark.parametrize(("from_usual", "sizes"), [(7000, [1.0, SMALL]), (4500, [1.0])])
def test_play_that_ended_higher_than_without_it_begins_once_more_from_little(
    wrist, from_usual, sizes
):
    wrist.left = wrist.leaves(alone=9000, b=5000, bp=4000)
    wrist.rounded = wrist.leaves(bp=from_usual)
    search = Search(wrist, ())
    wrist.done.clear(), wrist.sizes.clear()
    assert search.further([BACKLASH], {})
    easy = [n for n, (_, _, walls) in enumerate(wrist.done) if walls == "rounded"]
    assert [wrist.sizes[n][PLAY] for n in easy] == sizes


def test_what_was_named_stands_where_the_search_was_lowest_with_it(wrist):
    """Without what came after it, and was not named, a fit ended in a higher minimum."""
    wrist.left = wrist.leaves(alone=9000, b=2000, d=8000, bd=300, bp=250)
    lowest = wrist.left[frozenset({BACKLASH})]
    after = []
    wrist.led = lambda names, start: (
        4 * lowest if after and names == {BACKLASH} and start is not None else None
    )
    search = Search(wrist, ())
    assert search.found == {BACKLASH, DELAY}
    after.append(True)
    assert search._named([BACKLASH], {}).base.cost == lowest


def test_what_rounded_walls_promise_and_the_law_does_not_keep_is_no_answer(wrist):
    wrist.left = wrist.leaves(alone=9000, b=5000, bp=6000)
    wrist.rounded, wrist.beside = wrist.leaves(bp=200), wrist.leaves(bp=4990)
    assert Search(wrist, ()).further([BACKLASH], {}) is None


@pytest.mark.parametrize(("share", "tried"), [(0.9, False), (1.1, True)])
def test_a_joint_that_rubs_is_tried_beside_play_that_leaves_very_much(wrist, share, tried):
    """What it holds off its wall is no play, and alone it explains little."""
    left = share * ASTRAY * NUMBERS
    wrist.left = wrist.leaves(alone=5000, b=4000, bp=left, bpf=left / 2, bpq=5000)
    search = Search(wrist, ())
    fit = wrist.reached(BACKLASH, PLAY).base
    wrist.done.clear()
    place = search.further([BACKLASH, PLAY], {PLAY: fit})
    assert any(FRICTION in names for names, _, _ in wrist.done) == tried
    # Once was enough where little is left: with play in the base a fit takes long.
    assert bool(wrist.done) == (place is not None) == tried
    if place:
        assert place.base is fit
        assert set(place.fits) == {FRICTION}


@pytest.mark.parametrize(("share", "tried"), [(0.9, False), (1.1, True)])
def test_where_nothing_was_named_play_is_tried_beside_what_rubs_most(wrist, share, tried):
    """Either alone explains little of what both do, and only if very much is left is it asked."""
    left = share * ASTRAY * NUMBERS
    wrist.left = wrist.leaves(alone=left, f=0.8 * left, g=0.9 * left, fp=0.5 * left, gp=left)
    wrist.left |= wrist.leaves(p=0.5 * left, b=0.9 * left, bf=left, bfp=left)
    wrist.beside = wrist.leaves(fp=0.1 * left)
    place = Search(wrist, ()).further([], {})
    assert (place is not None) == tried
    if place:
        assert place.base.extras == ()
        assert {name: set(fit.extras) for name, fit in place.fits.items()} == {
            PLAY: {FRICTION, PLAY}
        }
        assert place.fits[PLAY].cost == pytest.approx(0.1 * left)


def test_where_nothing_rubs_play_is_tried_alone(wrist):
    wrist.left = wrist.leaves(alone=9000, f=8990, p=5000)
    place = Search(wrist, ()).further([], {})
    assert {name: fit.extras for name, fit in place.fits.items()} == {PLAY: (PLAY,)}


def test_what_was_fitted_along_and_not_named_is_asked_for_again(wrist):
    """Play may stand for a fit along with a joint that rubs: this one has to show as well."""
    wrist.left = wrist.leaves(alone=9000, p=8000, fp=1500)
    search = Search(wrist, ())
    fit = wrist.reached(PLAY, FRICTION).base
    place = search.further([PLAY], {PLAY: fit})
    assert place.base.extras == (PLAY,)
    assert set(place.fits) == {FRICTION}


@pytest.mark.parametrize("fitted", [False, True])
def test_play_is_fitted_from_wall_to_wall_before_anything_is_sought_beside_it(wrist, fitted):
    """Alone in the next minimum it would leave what friction then seems to explain."""
    wrist.left = wrist.leaves(alone=9000, p=5000, fp=1500)
    wrist.promised[PLAY] = 4000
    wrist.beside = wrist.leaves(p=0.9 * INEXACT * NUMBERS)
    search = Search(wrist, ())
    assert search.found == {PLAY}
    # Along with what rubs, or by its slopes: in neither fit the base was alone beside the play.
    fits = {PLAY: wrist.reached(PLAY, FRICTION).base} if fitted else {}
    wrist.done.clear()
    assert search.further([PLAY], fits) is None
    assert not any(FRICTION in names for names, _, _ in wrist.done)
    assert search.ended([PLAY]).cost == 0.9 * INEXACT * NUMBERS
    assert search.ended([PLAY, FRICTION]) is None


def test_play_that_was_fitted_so_is_not_fitted_again(wrist):
    wrist.left = wrist.leaves(alone=9000, p=5000, fp=1500)
    search = Search(wrist, ())
    fit = wrist.reached(PLAY).base
    wrist.done.clear()
    assert search.further([PLAY], {PLAY: fit}).base is fit
    assert not any(names == {PLAY} and start is fit for names, start, _ in wrist.done)


def test_play_alone_is_fitted_from_where_more_beside_it_led(wrist):
    """What led out of the next minimum may be no more: from there play alone leaves as little."""
    wrist.left = wrist.leaves(alone=9000, p=1000, fp=500, gp=490)
    search = Search(wrist, ())
    fit = wrist.reached(PLAY).base

    def leaving(names, start):
        return 510 if names == {PLAY} and start is not None and FRICTION in start.extras else None

    wrist.led = leaving
    assert search.further([PLAY], {PLAY: fit}) is None
    assert search.ended([PLAY]).cost == 510


def test_beside_play_and_what_rubs_nothing_is_sought_from_afar(wrist):
    """With both in the base each fit takes ten seconds or more."""
    wrist.left = wrist.leaves(alone=9000, p=8000, fp=5000, fpq=1000)
    search = Search(wrist, ())
    fit = wrist.reached(PLAY, FRICTION).base
    wrist.done.clear()
    assert search.further([PLAY, FRICTION], {FRICTION: fit}) is None
    assert not wrist.done


@pytest.mark.parametrize(("left", "found"), [(710, False), (700, True)])
def test_what_the_law_of_what_was_found_may_leave_is_no_further_play(wrist, left, found):
    """An encoder that explained 19,100 may leave a hundredth, were its law wrong by a tenth."""
    wrist.left = wrist.leaves(alone=20000, b=900, bp=850)
    wrist.beside = wrist.leaves(bp=left)
    place = Search(wrist, ()).further([BACKLASH], {})
    assert (place is not None) == found


def test_play_that_explains_nothing_beside_what_was_named_is_no_answer(wrist):
    wrist.left = wrist.leaves(alone=1000, b=500, bp=480)
    search = Search(wrist, ())
    assert search.further([BACKLASH], {}) is None
    # Nor is anything tried beside what only slopes named.
    assert search.further([CREEP], {}) is None


def test_members_of_a_class_are_fitted_one_by_one_beside_what_was_named_before(wrist):
    """What slopes do not tell apart, laws may."""
    wrist.left = wrist.leaves(alone=1000, b=600, c=990, d=980, bc=300, bd=250, bdc=249)
    search = Search(wrist, ())
    wrist.done.clear()
    place = search.by_law([BACKLASH], (CREEP, DELAY))
    assert place.known
    assert place.base.extras == (BACKLASH,)
    assert {name: fit.cost for name, fit in place.fits.items()} == {CREEP: 300, DELAY: 250}
    assert search.by_law([PLAY], (CREEP, DELAY)) is None


def test_members_that_explain_nothing_are_no_answer(wrist):
    wrist.left = wrist.leaves(alone=1000, c=990, d=300)
    search = Search(wrist, ())
    assert set(search.by_law([], (CREEP, DELAY)).fits) == {DELAY}
    assert search.by_law([], (CREEP,)) is None
