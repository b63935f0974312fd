"""What the bench takes for a right sentence about a stranger."""

from types import SimpleNamespace

import pytest

from wrist_stiffness.simulation.catalogue import STRANGERS


def law(form, component):
    return SimpleNamespace(form=SimpleNamespace(name=form), component=component)


@pytest.mark.parametrize(
    ("stranger", "form", "component", "right"),
    [
        # link_1 is where a law of joint_2 is asked: the very same screw.
        ("dent@joint_2", "a spot of turn_2", "link_1", True),
        ("dent@joint_2", "a spot of theta_2", "link_1", False),
        ("dent@joint_2", "a spot of turn_2", "platform", False),
        ("spinning_tool@platform", "a passing answer of theta_1", "load_sensor", True),
        ("spinning_tool@platform", "a wave of theta_1", "load_sensor", False),
        ("cable_stop@platform", "a wave of theta_1 + theta_2", "load_sensor", True),
        ("cable_stop@platform", "a passing answer of theta_1", "load_sensor", False),
        ("cable_stop@platform", "hysteresis of theta_1", "load_sensor", False),
        ("plastic_set@joint_1", "a step of time", "joint_1", True),
        ("plastic_set@joint_1", "a wave of time", "joint_1", False),
        ("loosening_screw@link_1", "a product of W_fz and T_motor_2", "link_1", True),
    ],
)
def test_a_sentence_is_right_by_its_component_and_what_it_follows(
    stranger, form, component, right, bench
):
    effect, _, place = stranger.partition("@")
    assert bench("right_sentences").is_right(effect, place, [law(form, component)]) is right


def test_component_and_signal_of_two_laws_make_no_right_sentence(bench):
    laws = [law("a spot of turn_2", "platform"), law("a wave of time", "link_1")]
    assert not bench("right_sentences").is_right("dent", "joint_2", laws)


def test_every_stranger_has_a_right_sentence(bench):
    assert bench("right_sentences").RIGHT.keys() == STRANGERS.keys()
