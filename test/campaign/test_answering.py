"""From the places of a search to an answer: which of them are asked, and which is believed."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from wrist_stiffness.campaign.searching.diagnose import (
    MUCH,
    _answered,
    _confirmed,
    _judged,
    _says_more,
    _settled,
)
from wrist_stiffness.campaign.searching.place import INEXACT, Place
from wrist_stiffness.campaign.searching.seeking import PRESSING
from wrist_stiffness.diagnosis import Diagnosis
from wrist_stiffness.diagnosis.result import Finding, Unexplained

AXIS, DELAY, PLAY = "axis_misalignment@joint_4", "time_delay@pose_sensor", "joint_clearance@joint_1"
LITTLE, MORE = 0.5 * MUCH, 2.0 * MUCH


def finding(*names):
    members = tuple(tuple(name.split("@")) for name in names)
    return Finding(members, {}, 0.1, 50.0, 0.001, 1.0, {"s_um": (1.0, 0.1)}, "yes", "", "")


def answer(verdict, *names, share=0.0, after=3.0):
    left = Unexplained((), share, "of " + verdict)
    found, error = tuple(finding(name) for name in names), {"s_um": after}
    return Diagnosis(verdict, "dwell", {}, {"s_um": 9.0}, error, (), found, left, (), 0, "")


def names(result):
    return [each.name for each in result.findings]


def place(*extras, fits=()):
    """Return a place whose base was fitted along with some effects, and what was fitted whole."""
    whole = {name: SimpleNamespace(extras=(*extras, name)) for name in fits}
    return Place(SimpleNamespace(extras=extras), (), whole)


class Asked:
    """Stands for a search and for the statistics, which answer each of its places as is listed."""

    def __init__(self, quick, thorough=None, further=None, beside=None, found=(), **strains):
        self.found = set(found)
        self.strained = strains.get("strained", False)
        self.doubtful = strains.get("doubtful", False)
        self.explained = strains.get("explained", False)
        self.rough = strains.get("rough", False)
        self.first_cost, self.end = 1000.0, strains.get("end")
        self.places = {
            "quick": place(*found),
            "thorough": place(fits=[AXIS]) if thorough else None,
            "further": place(*found, fits=[PLAY]) if further else None,
            "beside": place(AXIS),
        }
        self.answers = {"quick": quick, "thorough": thorough, "further": further, "beside": beside}
        self.asked, self.begun, self.fits = [], [], []

    def quick(self):
        return self.places["quick"]

    def thorough(self, laws=None):
        self.begun.append("thorough" if laws is None else laws)
        return self.places["thorough"]

    def further(self, names, fits):
        self.begun.append("further")
        self.fits.append(fits)
        return None if fits else self.places["further"]

    def ended(self, names):
        return self.end if names == [PLAY] else None

    def beside(self, base):
        place = self.places["further" if self.begun[-1] == "further" else "thorough"]
        assert any(base is each for each in place.fits.values())
        return self.places["beside"]

    def ask(self, place):
        (name,) = (name for name, each in self.places.items() if each is place)
        self.asked.append(name)
        return self.answers[name]

    def answered(self):
        place, result = _answered(self, self.ask)
        (name,) = (name for name, each in self.places.items() if each is place)
        return name, result


@pytest.mark.parametrize(
    ("quick", "search", "begun"),
    [
        # What presses, the base takes up whole.
        (answer("none"), {}, PRESSING),
        (answer("effect", DELAY), {"found": [DELAY]}, None),
        # Much is left, and nothing that is named explains most of it.
        (answer("unknown", share=LITTLE), {}, "thorough"),
        (answer("unknown", DELAY, share=MORE), {"found": [DELAY]}, "thorough"),
        (answer("unknown", DELAY, share=LITTLE), {"found": [DELAY]}, None),
        # The law itself leaves nothing of what is not named.
        (answer("unknown", DELAY, share=MORE), {"found": [PLAY], "explained": True}, "thorough"),
        (
            answer("unknown", DELAY, share=MORE),
            {"found": [DELAY], "explained": True, "doubtful": True},
            "thorough",
        ),
        # The base had to go far: alone where nothing is named, and beside what is.
        (answer("none"), {"strained": True}, "thorough"),
        (answer("none"), {"doubtful": True}, PRESSING),
        (answer("effect", DELAY), {"found": [DELAY], "doubtful": True}, "thorough"),
        (answer("effect", DELAY), {"found": [DELAY], "strained": True}, None),
        # Fits found something else than slopes name; what explains everything stands.
        (answer("unknown", DELAY, share=LITTLE), {"found": [PLAY]}, "thorough"),
        (answer("unknown", DELAY, share=LITTLE), {"found": [DELAY, PLAY]}, "thorough"),
        (answer("none"), {"found": [DELAY]}, "thorough"),
        (answer("effect", DELAY), {"found": [PLAY]}, None),
    ],
)
def test_whole_fits_are_made_where_the_quick_answer_may_be_wrong(quick, search, begun):
    """They take minutes; but a base that stands in for an effect looks like a sound wrist."""
    search = Asked(quick, **search)
    where, result = search.answered()
    assert [each for each in search.begun if each != "further"] == ([begun] if begun else [])
    assert where == "quick"
    assert result is quick


@pytest.mark.parametrize("much", [True, False])
def test_slopes_that_leave_much_of_what_a_fit_explains_ask_for_no_other_fit(much):
    """Twenty were made beside backlash; nothing could explain more than noise.

    Its fit then stands for what is named; where slopes hold, they do.
    """
    quick = answer("unknown", DELAY, share=MORE if much else LITTLE)
    search = Asked(quick, answer("effect", AXIS), found=[DELAY], explained=True)
    place, result = _answered(search, search.ask)
    assert result is quick
    assert place.fits == ({DELAY: place.base} if much else {})
    assert "thorough" not in search.begun


def test_what_presses_is_found_where_nothing_seemed_missing():
    """An axis off by 8 um, of 18 standard deviations, had drawn the base within its tolerances."""
    whole = answer("effect", AXIS)
    search = Asked(answer("none"), whole, beside=answer("none"))
    assert search.answered() == ("thorough", whole)


def test_an_answer_of_whole_fits_that_says_more_is_taken():
    whole = answer("effect", AXIS)
    search = Asked(answer("unknown", share=0.5), whole, beside=answer("none"))
    where, result = search.answered()
    assert where == "thorough"
    assert result is whole
    assert "further" not in search.begun


def test_an_answer_of_whole_fits_that_says_no_more_is_not_taken():
    """Slopes about the first base name the effect; among whole fits it got lost."""
    quick = answer("effect", DELAY)
    search = Asked(quick, answer("none"), found=[DELAY], doubtful=True)
    assert search.answered() == ("quick", quick)
    assert search.asked == ["quick", "thorough"]


@pytest.mark.parametrize(
    ("one", "other", "more"),
    [
        (answer("none"), answer("unknown", share=0.5), False),
        (answer("unknown", share=0.2), answer("unknown", share=0.5), False),
        (answer("effect", AXIS), answer("effect", DELAY), True),
        (answer("unknown", AXIS, share=0.4), answer("unknown", DELAY, share=0.5), True),
        (answer("unknown", AXIS, share=0.5), answer("unknown", DELAY, share=0.4), False),
        (answer("unknown", AXIS, share=0.5), answer("unknown", share=0.4), True),
    ],
)
def test_an_answer_says_more_that_names_something_and_leaves_less(one, other, more):
    assert _says_more(one, other) == more


def test_beside_a_whole_fit_everything_is_asked_again():
    """Flanges stand otherwise beside it: what slopes about the base alone named is forgotten."""
    whole, beside = answer("effect", AXIS, DELAY), answer("effect", PLAY, after=1.0)
    search = Asked(answer("unknown", share=0.5), whole, beside=beside)
    where, result = search.answered()
    assert where == "thorough"
    assert search.asked == ["quick", "thorough", "beside"]
    assert names(result) == [AXIS, PLAY]


def test_what_is_left_is_what_is_left_beside_everything_named():
    """Else the technician is told an error from which the second effect was not taken yet."""
    beside = answer("unknown", PLAY, share=0.3, after=1.0)
    result = _confirmed(answer("effect", AXIS, after=3.0), AXIS, beside)
    assert result.verdict == "unknown"
    assert result.before == {"s_um": 9.0}
    assert result.after == {"s_um": 1.0}
    assert result.unexplained == beside.unexplained


def test_play_that_is_found_beside_what_was_named_joins_it():
    """What only slopes named was not in that fit: it stood in for the play."""
    quick = answer("effect", DELAY, AXIS, share=0.1)
    more = answer("effect", PLAY, after=1.0)
    search = Asked(quick, further=more, beside=answer("none"), found=[DELAY])
    where, result = search.answered()
    assert where == "further"
    assert names(result) == [DELAY, PLAY]
    assert result.after == {"s_um": 1.0}


def test_beside_play_too_everything_is_asked_again():
    """Slopes without the play in them are no evidence of a third effect."""
    quick, more = answer("effect", DELAY), answer("effect", PLAY, AXIS)
    search = Asked(quick, further=more, beside=answer("none", after=1.0), found=[DELAY])
    _, result = search.answered()
    assert search.asked == ["quick", "further", "beside"]
    assert names(result) == [DELAY, PLAY]


def test_beside_what_was_found_so_the_search_goes_on_from_its_fit():
    quick, more = answer("effect", DELAY), answer("effect", PLAY)
    search = Asked(quick, further=more, beside=answer("none"), found=[DELAY])
    search.answered()
    assert search.fits == [{}, {PLAY: search.places["further"].fits[PLAY]}]


@pytest.mark.parametrize(("play", "asked"), [(True, []), (False, ["thorough"])])
def test_where_very_much_is_left_play_is_sought_beside_what_was_named_first(play, asked):
    """One by one, in its place, no other law leads anywhere."""
    quick = answer("unknown", DELAY, share=MORE)
    more = answer("effect", PLAY if play else AXIS)
    search = Asked(quick, further=more, beside=answer("none"), found=[DELAY], rough=True)
    where, result = search.answered()
    assert [each for each in search.begun if each != "further"] == asked
    # What led nowhere is not sought again.
    assert search.begun.count("further") == (2 if play else 1)
    assert names(result) == ([DELAY, PLAY] if play else [DELAY])
    assert where == ("further" if play else "quick")


@pytest.mark.parametrize(
    ("named", "cost", "stands"),
    [(PLAY, 900.0 * MUCH, True), (PLAY, 1100.0 * MUCH, False), (DELAY, 0.0, False)],
)
def test_play_fitted_to_its_end_stands_for_what_slopes_left(named, cost, stands):
    """Of 590,000 slopes left a quarter, in the next minimum play left half, and here 3,600."""
    fit = SimpleNamespace(cost=cost, extras=(PLAY,))
    quick = answer("unknown", named, share=MORE)
    search = Asked(quick, rough=True, found=[named], end=fit)
    where, result = _answered(search, search.ask)
    assert result is quick
    assert ("thorough" in search.begun) != stands
    assert where.fits == ({PLAY: fit} if named == PLAY else {})


def test_play_that_stands_for_itself_begins_where_it_was_fitted_to_its_end():
    """The fit that found it had a joint in it that rubs, and was not named."""
    fit = SimpleNamespace(cost=9.0, extras=(PLAY,))
    quick, more = answer("unknown", share=1.0), answer("effect", PLAY)
    search = Asked(quick, further=more, beside=answer("none"), rough=True, end=fit)
    where, result = _answered(search, search.ask)
    assert names(result) == [PLAY]
    assert where.fits == {PLAY: fit}


@pytest.mark.parametrize("rough", [True, False])
def test_where_nothing_is_named_play_is_sought_before_all_else_if_very_much_is_left(rough):
    """Of 326,539 a joint that rubs and play left 23,182; each alone hid the other from slopes."""
    quick, more = answer("unknown", share=1.0), answer("effect", PLAY)
    search = Asked(quick, further=more, beside=answer("none"), rough=rough)
    where, result = search.answered()
    assert search.begun[0] == ("further" if rough else "thorough")
    assert (where, names(result)) == ("further", [PLAY])


def test_where_play_is_not_named_the_quick_answer_stands():
    quick = answer("effect", DELAY)
    search = Asked(quick, further=answer("effect", AXIS), found=[DELAY])
    assert search.answered() == ("quick", quick)
    assert search.asked == ["quick", "further"]


@pytest.mark.parametrize(
    ("cost", "share", "verdict"),
    [(250.0, 0.1, "effect"), (1e3, 0.4, "unknown"), (2e3, 0.4, "unknown")],
)
def test_what_laws_leave_is_a_share_of_what_the_base_alone_left(cost, share, verdict):
    """Statistics know only what they are asked: a large share of nearly nothing is little."""
    left = answer("unknown", share=0.4)
    search = SimpleNamespace(after=lambda base: base, first_cost=1e3)
    result = _settled(
        answer("unknown", DELAY, share=0.9),
        search,
        SimpleNamespace(cost=cost),
        lambda _: left,
        0.2,
        lambda told: replace(told, after={"s_um": 0.5}),
    )
    assert result.after == {"s_um": 0.5}
    assert result.verdict == verdict
    assert result.unexplained.energy_share == pytest.approx(share)
    assert result.unexplained.evidence == left.unexplained.evidence
    assert names(result) == [DELAY]


def test_where_more_is_named_beside_whole_laws_nothing_is_settled():
    """An answer that knows of one more effect has not explained what is left."""
    result = answer("unknown", DELAY, share=0.9)
    search = SimpleNamespace(after=lambda base: base, first_cost=1e3)
    more = answer("effect", PLAY)
    final = SimpleNamespace(cost=1.0)
    assert _settled(result, search, final, lambda _: more, 0.2, lambda told: None) is result


class TestWhatDoesNotHold:
    """Slopes between four poses named a bracket and a gear: with their laws worse than nothing."""

    def judged(self, search, *held, variance=1.0):
        """Return the answer where only effects that are listed hold with their own laws."""

        def judge(place, result):
            kept = [name for name in names(result) if name in held]
            return SimpleNamespace(base=SimpleNamespace(extras=tuple(kept), variance=variance))

        return _judged(search, search.ask, judge)

    def test_whole_fits_are_asked_where_findings_do_not_hold(self):
        search = Asked(answer("effect", DELAY), answer("effect", AXIS), beside=answer("none"))
        where, result, judged = self.judged(search, AXIS)
        assert where is search.places["thorough"]
        assert names(result) == list(judged.base.extras) == [AXIS]

    def test_they_are_not_asked_where_all_findings_hold(self):
        search = Asked(answer("effect", DELAY), answer("effect", AXIS))
        where, result, judged = self.judged(search, DELAY, AXIS)
        assert where is search.places["quick"]
        assert names(result) == list(judged.base.extras) == [DELAY]

    @pytest.mark.parametrize(("variance", "begun"), [(1.0, False), (2.0 * INEXACT, True)])
    def test_they_are_not_asked_where_what_holds_leaves_no_more_than_noise(self, variance, begun):
        """Friction held and explained; axes of a sensor that mopped up behind it did not hold."""
        search = Asked(answer("effect", AXIS, DELAY), answer("none"), found=[AXIS])
        search.by_law = None
        self.judged(search, AXIS, variance=variance)
        assert ("thorough" in search.begun) == begun

    def test_they_are_not_asked_again_where_a_whole_fit_does_not_hold(self):
        quick = answer("unknown", AXIS, share=MORE)
        search = Asked(quick, answer("effect", DELAY), found=[AXIS], explained=True)
        where, _, judged = self.judged(search)
        assert list(where.fits) == [AXIS]
        assert judged.base.extras == ()
        assert search.begun == []

    def test_where_whole_fits_say_no_more_the_first_answer_stands(self):
        search = Asked(answer("effect", DELAY), answer("none"))
        where, result, judged = self.judged(search)
        assert where is search.places["quick"]
        assert judged.base.extras == ()


class TestClassesWhoseLawsDiffer:
    """An eccentric encoder whose slopes were a gear's left 299,000 as a gear, 4,215 as it is."""

    def judged(self, *named, variance=2.0 * INEXACT, laws=AXIS, left=500.0, fit=AXIS, fits=()):
        """Return the answer where slopes name a class at last and `laws` its first member."""
        unsure = finding(PLAY, AXIS)
        quick = answer("unknown", *named, share=LITTLE)
        quick = replace(quick, findings=(*quick.findings, unsure))
        search = Asked(quick, beside=answer("none"), found=[*named, fit])
        search.places["quick"] = place(*named, fits=fits)
        search.classes = []

        def by_law(names, members):
            search.classes.append((names, members))
            return search.places["by law"]

        def judge(place, result):
            cost = left if place is search.places["by law"] else 1000.0
            base = SimpleNamespace(extras=names(result), variance=variance, cost=cost)
            return SimpleNamespace(base=base)

        search.by_law = by_law
        search.places["by law"] = place(*named)
        search.answers["by law"] = answer("effect", *([laws] if laws else []))
        return search, *_judged(search, search.ask, judge)

    @pytest.mark.parametrize("named", [(), (DELAY,)])
    def test_whole_fits_tell_which_is_first(self, named):
        search, where, result, _ = self.judged(*named)
        assert search.classes == [(list(named), (PLAY, AXIS))]
        assert where is search.places["by law"]
        assert [each.names for each in result.findings] == [(each,) for each in named] + [
            (AXIS, PLAY)
        ]
        assert result.verdict == "effect"

    def test_they_are_not_asked_where_little_is_left(self):
        search, where, _, _ = self.judged(variance=0.9 * INEXACT)
        assert where is search.places["quick"]
        assert search.classes == []

    def test_they_are_not_asked_where_whole_fits_gave_the_answer(self):
        search, _, _, _ = self.judged(fits=[AXIS])
        assert search.classes == []

    def test_they_are_not_asked_where_a_fit_led_to_the_first_of_the_class(self):
        search, where, _, _ = self.judged(fit=PLAY)
        assert where is search.places["quick"]
        assert search.classes == []

    @pytest.mark.parametrize("other", [{"left": 1000.0}, {"laws": ""}, {"laws": DELAY}])
    def test_the_first_answer_stands_where_they_name_nothing_of_it_or_leave_as_much(self, other):
        search, where, result, judged = self.judged(**other)
        assert search.classes
        assert where is search.places["quick"]
        assert judged.base.cost == 1000.0
        assert [each.names for each in result.findings] == [(PLAY, AXIS)]
