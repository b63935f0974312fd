"""The search where slopes promise more than any fit keeps."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from wrist_stiffness.inference.amplitudes import evidence
from wrist_stiffness.inference.point import Background, Group, Point
from wrist_stiffness.inference.possible import Possible
from wrist_stiffness.inference.reading import NAMING, probabilities, read, settled, standings
from wrist_stiffness.inference.search import LEADERS, MANY_FITS, TIME_OVER, Search, Trial

ROWS, CANDIDATES = 60, LEADERS + 4


@dataclass(frozen=True)
class Fit:
    """Columns by the names of the effects."""

    names: tuple[str, ...]
    point: Point


ANYTHING = Possible(np.array([-np.inf]), np.array([np.inf]))


class Disappointing:
    """Every candidate's slopes look like what is left; what it does whole is something else."""

    def __init__(self, rng, kept):
        self.background = Background((Group("none", "s", np.zeros((ROWS, 1)), 1.0),), 0.2)
        cause = rng.normal(size=ROWS)
        self.left = cause + rng.normal(size=ROWS)
        names = [f"law_{number}@place" for number in range(CANDIDATES)]
        self.slopes = {
            name: (cause + 0.02 * number * rng.normal(size=ROWS))[:, None]
            for number, name in enumerate(names)
        }
        self.whole = {
            name: kept * each + np.sqrt(1.0 - kept**2) * rng.normal(size=(ROWS, 1))
            for name, each in self.slopes.items()
        }

    def nearly(self, fit, ranked):
        return None

    def giving(self, fit):
        return ()

    def strained(self, fit):
        return False

    def fitted(self, names):
        empty = np.zeros((ROWS, 0))
        columns = np.concatenate([empty, *(self.whole[name] for name in names)], axis=1)
        z = np.linalg.lstsq(columns, self.left, rcond=None)[0]
        effects = {name: np.array([number]) for number, name in enumerate(names)}
        varied = {name: columns[:, [number]] for number, name in enumerate(names)}
        left = self.left - columns @ z
        return Fit(tuple(names), Point(left, -columns, z, np.ones(len(z)), effects, empty, varied))

    def begin(self):
        return self.fitted(())

    def trials(self, fit):
        return [
            Trial(name, True, (((), -each),), ANYTHING)
            for name, each in self.slopes.items()
            if name not in fit.names
        ]

    def added(self, fit, ranked):
        return self.fitted((*fit.names, ranked.trial.name))

    def without(self, fit, name):
        return self.fitted(tuple(each for each in fit.names if each != name))


@pytest.mark.parametrize("kept", [0.5, 0.8])
def test_a_class_is_named_by_a_set_that_was_fitted(rng, kept):
    search = Search(Disappointing(rng, kept), most_effects=1)
    search.run()
    best = search.best
    assert best.names
    unfitted = {frozenset((name,)) for name in search.promised} - set(search.states)
    promises = [search.promised[name] for names in unfitted for name in names]
    assert search.base.evidence.log + max(promises) > best.evidence.log
    chances = probabilities(search)
    assert max(chances[names] for names in unfitted) <= chances[best.names]
    reading = read(search)
    assert [each.name for each in reading.classes] == sorted(best.names)
    assert {each.name for each in standings(search, reading)} == set(search.promised)


def test_what_is_handed_over_is_what_is_named(rng):
    """Also where no fit came by it alone: beside others that nobody named, values are others."""
    problem = Disappointing(rng, 1.0)
    name, one, two, three = list(problem.slopes)[:4]
    search = Search(problem)
    for names in ((name, one, two), (name, three)):
        state = search._known(problem.fitted(names), None)
        search.states[state.names] = replace(state, log=search.base.log + 50.0)
    reading = read(search)
    assert [each.name for each in reading.named] == [name]
    assert reading.state.names == {name}
    assert reading.state.fit.point.z == pytest.approx(problem.fitted((name,)).point.z)


def test_each_suspect_is_held_against_the_others_alone(rng):
    """Where no fit had come by these, each was said to explain what all explain together."""
    problem = Disappointing(rng, 1.0)
    search = Search(problem)
    trio = search._known(problem.fitted(tuple(problem.slopes)[:3]), None)
    search.states[trio.names] = replace(trio, log=search.base.log + 50.0)
    classes = read(search).classes
    assert {each.name for each in classes} == trio.names
    for each in classes:
        others = search.states[trio.names - {each.name}]
        assert each.without is others
        assert each.log_gain == pytest.approx(trio.evidence.log - others.evidence.log)


def test_what_the_last_fit_takes_up_is_no_error_that_is_real(rng):
    """The search ended short of it; then the sets alone say whether an effect is missing."""
    search = Search(Disappointing(rng, 0.0))
    search.run()
    told = read(search)
    assert told.verdict == "undecided"
    rough = replace(
        told, verdict="unknown", probability=1.0, depends_on={"the pose": 1.0}, unexplained=1.0
    )
    after = settled(rough, search.base, search, NAMING)
    assert (after.verdict, after.probability) == (told.verdict, told.probability)
    assert (after.depends_on, after.unexplained) == ({}, 0.0)
    left = replace(search.base, evidence=SimpleNamespace(unexplained=1.0))
    same = settled(rough, left, search, NAMING)
    assert (same.verdict, same.depends_on) == ("unknown", {"the pose": 1.0})


def test_a_better_nominal_fit_is_asked_anew(rng):
    """What slopes promise counts from the nominal fit that they were taken about."""

    class Beginner(Disappointing):
        def begin(self):
            # A fit that did not find the maximum: it leaves one of its own unknowns' work undone.
            fit = self.fitted(())
            return Fit((), Point(1.3 * fit.point.left, *_rest(fit.point)))

    problem = Beginner(rng, 0.8)
    search = Search(problem, most_effects=2)
    search.run()
    exact = evidence(problem.fitted(()).point, problem.background)
    assert search.base.evidence.log == pytest.approx(exact.log)
    gains = [
        max(g for g, _ in exact.gains([-each]))
        for name, each in problem.slopes.items()
        if name not in search.best.names
    ]
    promised = [value for name, value in search.promised.items() if name not in search.best.names]
    assert max(promised) == pytest.approx(max(gains), abs=1.0)


def test_nothing_is_named_that_the_nominal_fit_does_without(rng):
    """Fits get on with every effect less; a search that ends early names who came along."""

    class Slow(Disappointing):
        def __init__(self, rng):
            super().__init__(rng, 1.0)
            self.noise, self.astray = rng.normal(size=ROWS), self.whole["law_0@place"][:, 0]
            self.left = self.noise + 3.0 * self.astray

        def without(self, fit, name):
            self.left = self.noise + 0.5 * (self.left - self.noise)
            return super().without(fit, name)

    problem = Slow(rng)
    search = Search(problem, most_effects=1)
    search.run()
    assert not search.best.names
    assert np.std(search.base.fit.point.left) < 1.1 * np.std(problem.noise)


def _rest(point):
    return point.columns, point.z, point.weight, point.effects, point.inexact, point.varied


@pytest.mark.parametrize("only_whole", [False, True])
def test_a_whole_fit_is_for_what_comes_near_the_best(rng, only_whole):
    """All slopes promise something; beside the cause the others promise little."""

    class Told(Disappointing):
        def __init__(self, rng):
            super().__init__(rng, 1.0)
            cause = rng.normal(size=ROWS)
            self.left = 3.0 * cause + rng.normal(size=ROWS)
            for number, name in enumerate(self.slopes):
                noise = rng.normal(size=ROWS)
                own = cause if number == 3 else 0.6 * cause + 0.8 * noise
                self.slopes[name] = self.whole[name] = own[:, None]
            self.fitted_whole = []

        def nearly(self, fit, ranked):
            return None if only_whole else self.fitted((*fit.names, ranked.trial.name))

        def added(self, fit, ranked):
            self.fitted_whole.append(ranked.trial.name)
            return super().added(fit, ranked)

    problem = Told(rng)
    search = Search(problem, most_effects=1)
    search.run()
    assert search.best.names == {"law_3@place"}
    if only_whole:
        assert len(problem.fitted_whole) >= LEADERS
    else:
        assert problem.fitted_whole == ["law_3@place"]


def test_of_walls_slopes_tell_nothing_so_the_law_that_leads_is_asked_everywhere(rng):
    cause = rng.normal(size=ROWS)

    class Walled(Disappointing):
        def __init__(self, rng):
            super().__init__(rng, 1.0)
            self.left = 6.0 * cause + rng.normal(size=ROWS)
            shares = {"play@first": (0.7, 0.8), "play@true": (0.0, 1.0)}
            shares |= {f"else_{number}@place": (0.5, 0.5) for number in range(2 * LEADERS)}
            for name, of in shares.items():
                noise = rng.normal(size=ROWS)
                slope, whole = (s * cause + np.sqrt(1.0 - s**2) * noise for s in of)
                self.slopes[name], self.whole[name] = slope[:, None], whole[:, None]
            self.slopes = {name: self.slopes[name] for name in shares}

    search = Search(Walled(rng), most_effects=1)
    search.run()
    assert search.best.names == {"play@true"}


def test_walls_are_fitted_whole_where_a_quick_fit_finds_any_play(rng):
    """What play explains, the quick fit does not tell; but where it finds none, there is none."""
    cause = rng.normal(size=ROWS)

    class Quick(Disappointing):
        def __init__(self, rng):
            super().__init__(rng, 1.0)
            self.left = 6.0 * cause + rng.normal(size=ROWS)
            self.quick = {}
            for name, shares in {
                "rival@place": (0.7, 0.7, 0.7),
                "play@true": (0.6, 0.4, 1.0),
                "play@sound": (0.6, 0.0, 0.0),
            }.items():
                found = [s * cause + np.sqrt(1.0 - s**2) * rng.normal(size=ROWS) for s in shares]
                self.slopes[name], self.quick[name], self.whole[name] = (e[:, None] for e in found)
            self.slopes = {name: self.slopes[name] for name in self.quick}
            sound, towards = self.quick["play@sound"], self.left / np.linalg.norm(self.left)
            sound -= np.outer(towards, towards @ sound)
            self.fitted_whole = []

        def trials(self, fit):
            return [replace(t, walls=t.law == "play") for t in super().trials(fit)]

        def nearly(self, fit, ranked):
            whole, self.whole = self.whole, self.quick
            found = self.fitted((*fit.names, ranked.trial.name))
            self.whole = whole
            return found

        def added(self, fit, ranked):
            self.fitted_whole.append(ranked.trial.name)
            return super().added(fit, ranked)

    problem = Quick(rng)
    search = Search(problem, most_effects=1)
    search.run()
    assert search.best.names == {"play@true"}
    assert "play@sound" not in problem.fitted_whole


def test_in_place_of_an_effect_only_what_may_regain_half_of_it_is_asked(rng):
    """All slopes promise something; of the rest only one shows as much as what was dropped."""
    first, second = rng.normal(size=(2, ROWS))

    class Two(Disappointing):
        def __init__(self, rng):
            super().__init__(rng, 1.0)
            self.left = 6.0 * first + 5.0 * second + rng.normal(size=ROWS)
            shares = {"cause@first": (1.0, 0.0), "cause@second": (0.0, 1.0)}
            shares |= {"rival@place": (0.99, 0.0)}
            shares |= {f"weak_{number}@place": (0.4, 0.0) for number in range(3)}
            for name, (one, two) in shares.items():
                noise = np.sqrt(1.0 - one**2 - two**2) * rng.normal(size=ROWS)
                self.slopes[name] = (one * first + two * second + noise)[:, None]
            self.whole = self.slopes = {name: self.slopes[name] for name in shares}
            self.asked = set()

        def nearly(self, fit, ranked):
            self.asked.add((frozenset(fit.names), ranked.trial.name))
            return self.fitted((*fit.names, ranked.trial.name))

    problem = Two(rng)
    search = Search(problem, most_effects=2)
    search.run()
    assert search.best.names == {"cause@first", "cause@second"}
    assert "weak_0@place" in {name for names, name in problem.asked if not names}
    beside_second = {n for names, n in problem.asked if names == {"cause@second"}}
    assert beside_second == {"rival@place"}


def test_a_first_answer_is_told_while_the_search_goes_on(rng):
    problem, heard = Disappointing(rng, 1.0), []
    search = Search(problem, tell=heard.append, most_effects=1)
    search.run()
    (name,) = search.best.names
    assert heard[1].startswith("missing so far: nothing; asking")
    assert heard[-1].startswith(f"missing so far: {name}; ")
    # Something outside the catalogue.
    pose = 5.0 * problem.whole[name]
    problem.background = Background((Group("pose", "s", pose),), 0.2)
    problem.left, problem.slopes = problem.left + pose[:, 0], {}
    heard.clear()
    Search(problem, tell=heard.append).run()
    assert heard[-1].startswith("missing so far: something; ")


@pytest.mark.parametrize(
    ("seconds", "fits", "ended"), [(0.0, 48, TIME_OVER), (np.inf, 1, MANY_FITS), (np.inf, 48, "")]
)
def test_what_ended_a_search_is_told(rng, monkeypatch, seconds, fits, ended):
    monkeypatch.setattr("wrist_stiffness.inference.search.MOST_FITS", fits)
    search = Search(Disappointing(rng, 0.8), seconds, most_effects=1)
    search.run()
    assert search.ended == ended
    why = {each.why_not for each in standings(search, read(search))}
    assert (f"not compared: {ended}" in why) == bool(ended)
