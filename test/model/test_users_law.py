"""A law of the user's own, however it is written, changes nothing but what it adds."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.compensation.correction_stream import CorrectionStream
from wrist_stiffness.compensation.parameters import stream_settings
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.block import Load, Sample
from wrist_stiffness.model.contribution import Contribution
from wrist_stiffness.model.effect import Effect
from wrist_stiffness.model.law import Law
from wrist_stiffness.model.parameters import Estimate, Parameter

NAMES = ("motor_1_joint", "motor_2_joint")
SECOND = 1_000_000_000


class Own(Law):
    """Turns the platform about its x."""

    id = "own"
    stage = "geometry"
    places = ("platform",)
    sentence = "{place} is turned"
    check = "look"
    excited_by = "poses"
    own = (Parameter("turn_mdeg", lower=-100.0, upper=100.0, scale=10.0),)

    def turned(self, at, place, angle):
        home = np.zeros((len(at.block), 6))
        home[:, 3] = angle
        return at.screw(place, home)


def with_own(model, law):
    return model.with_effects(Effect(law, "platform", {"turn_mdeg": Estimate(30.0)}))


def commanded(model, angles):
    """Return what the corrector sends for commands 10 ms apart, and why it corrects none."""
    settings = stream_settings({"load_policy": "follow", "slew_deg_s": 1000.0})
    stream = CorrectionStream(model, settings, True)
    answers = []
    for number, theta in enumerate(angles):
        stamp_ns = 100 * SECOND + number * SECOND // 100
        stream.loads.add(stamp_ns, "wrist_base", (0.0, 0.0, -1.0), (0.0, 0.0, 0.0))
        answers.append(stream.on_command(stamp_ns, "", NAMES, theta))
    return answers


@pytest.mark.parametrize(
    ("what", "named"),
    [
        ("at.block.theta", "at.block.theta"),
        ("at.load", "at."),
        ("at.wrench", "at."),
        ("at.speed", "at.block.theta_dot"),
        ("at.covariate('humidity')", "at.block.humidity"),
        ("at.configuration.theta", "at."),
        ("at.configuration.bodies", "at.configuration."),
        ("at.body(place)", "at.configuration."),
    ],
)
def test_a_law_that_writes_into_what_it_is_told_is_refused(model, what, named):
    class Writes(Own):
        def added(self, at, place, values):
            told = eval(what, {"at": at, "place": place})
            told *= 2.0
            return self.turned(at, place, values["turn_mdeg"])

    wrong = with_own(model, Writes())
    theta = np.array([0.3, -0.2])
    for on_platform in (False, True):
        load = Load(0.05 * np.ones(6), on_platform)
        sample = Sample(0.0, theta, load, np.ones(2), covariates={"humidity": 1.0})
        block = replace(sample.block)
        for predict in (lambda: wrong.session().advance(sample), lambda: wrong.batch(block)):  # noqa: B023
            with pytest.raises(InputError, match=f"own@platform: writes into {named}"):
                predict()
        assert (block.theta == theta).all()
        assert (block.load == 0.05).all()


@pytest.mark.parametrize(
    "what", ["at.contact_force", "at.through", "at.through_place('joint_1')", "at.jacobian"]
)
def test_a_law_that_writes_into_what_follows_from_that_is_refused(model, what):
    class Writes(Own):
        stage = "reaction"

        def added(self, at, place, values):
            assert at.through.any()
            told = eval(what, {"at": at})
            told *= 2.0
            return self.turned(at, place, values["turn_mdeg"])

    with pytest.raises(InputError, match="own@platform: ValueError: .* read-only"):
        with_own(model, Writes()).predict(np.array([0.3, -0.2]), Load(0.05 * np.ones(6)))


def test_a_covariate_named_as_the_angles_does_not_hide_them(model):
    class Writes(Own):
        def added(self, at, place, values):
            at.block.theta[:] = 0.0
            return self.turned(at, place, values["turn_mdeg"])

    theta = np.array([0.3, -0.2])
    sample = Sample(0.0, theta, Load(np.zeros(6)), covariates={"theta": 1.0})
    with pytest.raises(InputError, match="writes into at.block.theta"):
        with_own(model, Writes()).session().advance(sample)
    assert theta.tolist() == [0.3, -0.2]


def test_a_law_may_write_into_the_parts_it_gets(model):
    """They are its own: the table stays as it is, and every model begins from there."""

    class Softens(Own):
        stage = "parts"

        def changed(self, parts, place, values):
            parts.flexibility[...] *= 2.0
            for flange in parts.contact.values():
                flange.gap[...] += 1e-3
            return parts

    class Purely(Softens):
        def changed(self, parts, place, values):
            contact = {j: replace(each, gap=each.gap + 1e-3) for j, each in parts.contact.items()}
            return replace(parts, flexibility=2.0 * parts.flexibility, contact=contact)

    def twist(law):
        one = with_own(model, law) if law else model
        return one.predict(np.array([0.3, -0.2]), Load(0.05 * np.ones(6))).twist.tolist()

    first = twist(None)
    changed = [twist(law) for law in (Softens(), Softens(), Purely())]
    assert changed[0] == changed[1] == changed[2] != first
    assert twist(None) == first


def test_a_law_that_writes_into_the_angles_moves_no_motor(model):
    class Writes(Own):
        def added(self, at, place, values):
            at.block.theta[:] = 0.0
            return self.turned(at, place, values["turn_mdeg"])

    for answer in commanded(with_own(model, Writes()), [(0.3, -0.2)] * 3):
        assert answer.positions.tolist() == [0.3, -0.2]
        assert "own@platform" in str(answer.fault)


def test_what_a_law_writes_into_its_values_is_forgotten(model):
    class Grows(Own):
        def added(self, at, place, values):
            values["turn_mdeg"] *= 2.0
            return self.turned(at, place, values["turn_mdeg"])

    session = with_own(model, Grows()).session()
    first, second = (session.advance(Sample(t, np.zeros(2), Load(np.zeros(6)))) for t in (0.0, 1.0))
    assert second.twist.tolist() == first.twist.tolist()


def test_a_preview_forgets_what_a_law_wrote_into_its_state(model):
    """The search for a correction tries many angles, which are no motion."""

    class Follows(Own):
        """Motor 1 with play."""

        def advance(self, at, place, values, state):
            last = [at.block.theta[0, 0]] if state is None else list(state)
            turns = []
            for angle in at.block.theta[:, 0]:
                last[0] = min(max(last[0], angle - 2e-4), angle + 2e-4)
                turns.append(values["turn_mdeg"] * (angle - last[0]) / 2e-4)
            return self.turned(at, place, np.array(turns)), last

    class InPlace(Follows):
        def advance(self, at, place, values, state):
            added, last = super().advance(at, place, values, state)
            if state is not None:
                state[:] = last
            return added, last if state is None else state

    swing = 0.1 + 1e-3 * np.sin(np.linspace(0.0, 6.0, 40))
    angles = np.stack([swing, np.zeros(40)], axis=1).tolist()
    answers = [commanded(with_own(model, law), angles) for law in (Follows(), InPlace())]
    pure, in_place = ([each.positions.tolist() for each in own] for own in answers)
    assert in_place == pure
    assert pure != angles


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        (lambda parts: 1 / 0, "own@platform: ZeroDivisionError"),
        (lambda parts: None, "own@platform: changed gives a NoneType, not ElasticComponents"),
    ],
)
def test_a_law_that_cannot_change_the_parts_is_one_clear_error(model, changed, text):
    class Softens(Own):
        stage = "parts"

        def changed(self, parts, place, values):
            return changed(parts)

    with pytest.raises(InputError, match=text):
        with_own(model, Softens()).predict(np.zeros(2), Load(np.zeros(6)))


@pytest.mark.parametrize("field", ["both", "through"])
def test_a_constant_law_adds_what_a_constant_can(model, field):
    shape = {"both": (1, 6), "through": (1, 8, 6)}[field]

    class Constantly(Own):
        constant = True

        def added(self, at, place, values):
            return Contribution(**{field: np.ones(shape)})

    with pytest.raises(InputError, match="own@platform: a law with constant = True cannot"):
        with_own(model, Constantly()).predict(np.zeros(2), Load(np.zeros(6)))
