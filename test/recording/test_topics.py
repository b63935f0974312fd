"""Topic names given on a command line."""

import pytest

from wrist_stiffness.errors import InputError
from wrist_stiffness.topics import parse_topic_remaps


def test_remaps_are_parsed():
    assert parse_topic_remaps(["/joint_states:=/robot/js", "covariates/rh := /lab/rh"]) == {
        "/joint_states": "/robot/js",
        "/covariates/rh": "/lab/rh",
    }


@pytest.mark.parametrize(
    ("remaps", "reason"),
    [
        (["/joint_states"], "not of the form"),
        (["/joint_states="], "not of the form"),
        (["/joint_states:="], "not of the form"),
        ([":=/a"], "not of the form"),
        (["/joint_state:=/a"], "/joint_state is not a standard topic; these are /joint_states"),
        (["/joint_states:=/a", "joint_states:=/b"], "mapped twice"),
        (["/joint_states:=/a", "/load_estimate:=/a"], "used for two"),
    ],
)
def test_bad_remaps_are_refused(remaps, reason):
    with pytest.raises(InputError, match=reason):
        parse_topic_remaps(remaps)
