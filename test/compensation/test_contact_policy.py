import numpy as np
import pytest

from wrist_stiffness.compensation.contact_policy import POLICIES, ContactGuard, ContactSettings
from wrist_stiffness.errors import InputError
from wrist_stiffness.model.error_model import Load

SECOND = 1_000_000_000
PAYLOAD = np.array([0.0, 0.0, -1.0, 0.01, 0.0, 0.0])
PUSH = np.array([0.0, 0.0, 2.0, 0.0, 0.1, 0.0])


def run(settings, loads, seconds=0.01):
    """Return the loads corrected for, and whether there was contact, sample by sample."""
    guard, used, contact = ContactGuard(), [], []
    for i, load in enumerate(loads):
        used.append(guard.load(SECOND + round(i * seconds * SECOND), Load(load), settings).wrench)
        contact.append(guard.in_contact)
    return np.array(used), contact


@pytest.mark.parametrize("policy", POLICIES)
def test_free_loads_are_used_as_they_are(policy):
    settings = ContactSettings(policy)
    loads = [PAYLOAD, PAYLOAD + 0.05 * PUSH, PAYLOAD - 0.09 * PUSH]
    used, contact = run(settings, loads)
    assert np.array_equal(used, loads)
    assert contact == [False] * 3


def test_freezing_uses_the_payload_alone():
    used, contact = run(ContactSettings("freeze_in_contact"), [PAYLOAD, PAYLOAD + PUSH])
    assert np.array_equal(used[1], PAYLOAD)
    assert contact == [False, True]


@pytest.mark.parametrize("gain", [0.0, 0.3, 1.0])
def test_gain_uses_that_part_of_the_departure(gain):
    used, _ = run(ContactSettings("gain", gain=gain), [PAYLOAD, PAYLOAD + PUSH])
    assert np.allclose(used[1], PAYLOAD + gain * PUSH)


def test_lowpass_follows_with_its_time_constant():
    settings = ContactSettings("load_lowpass", gain=0.5, lowpass_s=0.5)
    used, _ = run(settings, [PAYLOAD] + 201 * [PAYLOAD + PUSH])
    share = (used - PAYLOAD)[:, 2] / (0.5 * PUSH[2])
    # After n steps of 10 ms a first-order filter has come to 1 - exp(-n 0.01 / 0.5).
    assert share[50] == pytest.approx(1.0 - np.exp(-50 * 0.02), rel=1e-9)
    assert share[200] == pytest.approx(1.0 - np.exp(-200 * 0.02), rel=1e-9)


def test_contact_ends_only_after_the_force_was_small_for_a_while():
    # force   0 | 2 for 10 | 0.15 for 100 (above half of 0.2) | 0.05 for 100
    force = [0.0] + 10 * [2.0] + 100 * [0.15] + 100 * [0.05]
    loads = [PAYLOAD + np.array([f, 0, 0, 0, 0, 0]) for f in force]
    _, contact = run(ContactSettings(), loads)
    assert contact[:1] == [False]
    assert contact[1:110] == [True] * 109
    assert contact[111 : 111 + 48] == [True] * 48
    assert contact[-1] is False


def test_enabling_again_takes_the_present_load_as_payload():
    guard, settings = ContactGuard(), ContactSettings()
    guard.load(SECOND, Load(PAYLOAD), settings)
    guard.load(SECOND + 1, Load(PAYLOAD + PUSH), settings)
    assert guard.in_contact
    guard.forget()
    assert np.array_equal(
        guard.load(SECOND + 2, Load(PAYLOAD + PUSH), settings).wrench, PAYLOAD + PUSH
    )
    assert not guard.in_contact


def test_a_load_in_another_frame_than_the_payload_is_refused():
    guard = ContactGuard()
    guard.load(SECOND, Load(PAYLOAD), ContactSettings())
    with pytest.raises(InputError, match="another frame"):
        guard.load(SECOND, Load(PAYLOAD, on_platform=True), ContactSettings())
