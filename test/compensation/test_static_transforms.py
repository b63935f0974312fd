"""Frames of `/tf_static`: chains up and down, to base or platform, after the parameter `frames`."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wrist_stiffness.compensation.intake import (
    Frames,
    SensorFrame,
    frames_from_yaml,
    sensor_frames,
    static_transform,
)
from wrist_stiffness.compensation.settings import StreamSettings
from wrist_stiffness.compensation.stream import PredictionStream
from wrist_stiffness.errors import FrameError, InputError

RNG = np.random.default_rng(6)
PLACES = RNG.normal(size=(4, 3))
TURNS = Rotation.random(4, random_state=RNG)


def homogeneous(place, turn):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.as_matrix(), place
    return matrix


def transform(parent, child, i):
    return static_transform(parent, child, PLACES[i], TURNS[i].as_quat())


# world -> wrist_base, world -> table -> tracker; wrist_platform -> tool -> ft
CHAIN = [
    transform("world", "wrist_base", 0),
    transform("world", "table", 1),
    transform("table", "tracker", 2),
    transform("wrist_platform", "tool", 3),
    transform("tool", "ft", 0),
    transform("moon", "crater", 1),
]
T = [homogeneous(place, turn) for place, turn in zip(PLACES, TURNS, strict=True)]
EXPECTED = {
    "world": ("wrist_base", np.linalg.inv(T[0])),
    "table": ("wrist_base", np.linalg.inv(T[0]) @ T[1]),
    "tracker": ("wrist_base", np.linalg.inv(T[0]) @ T[1] @ T[2]),
    "tool": ("wrist_platform", T[3]),
    "ft": ("wrist_platform", T[3] @ T[0]),
}


@given(st.permutations(CHAIN))
def test_chains_are_followed_in_both_directions_whatever_their_order(transforms):
    found = sensor_frames(transforms)
    assert found.keys() == EXPECTED.keys()
    for name, (parent, matrix) in EXPECTED.items():
        assert found[name].parent == parent
        assert found[name].acts_on == "platform"
        assert np.allclose(found[name].rotation, matrix[:3, :3])
        assert np.allclose(found[name].position, matrix[:3, 3])


def test_base_and_platform_are_not_joined_by_a_transform():
    found = sensor_frames([transform("wrist_base", "wrist_platform", 0), *CHAIN])
    assert {name: frame.parent for name, frame in found.items()} == {
        name: parent for name, (parent, _) in EXPECTED.items()
    }


@pytest.mark.parametrize("numbers", [(0, 0, 0, 0, 0, 0, 0), (float("nan"), 0, 0, 0, 0, 0, 1)])
def test_a_transform_that_is_none_is_refused(numbers):
    with pytest.raises(InputError, match="static transform a -> b"):
        static_transform("a", "b", numbers[:3], numbers[3:])


def test_a_stream_knows_the_frames_and_the_parameter_goes_first():
    own = SensorFrame("wrist_platform", acts_on="environment")
    stream = PredictionStream(None, StreamSettings())
    with pytest.raises(FrameError, match="'ft' is not known"):
        stream.loads.add(1, "ft", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    stream.on_static_transforms(CHAIN)
    stream.loads.add(1, "ft", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    force = stream.loads.at(1)[1].wrench[:3]
    assert np.allclose(force, EXPECTED["ft"][1][:3, 2])
    stream.settings = StreamSettings(frames=Frames({"ft": own}))
    stream.loads.add(2, "ft", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert stream.loads.at(2)[1].wrench[:3].tolist() == [0.0, 0.0, -1.0]
    # The others stay known, and a transform that comes again in another place counts.
    stream.on_static_transforms([transform("tool", "ft2", 1)])
    stream.loads.add(3, "ft2", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert np.allclose(stream.loads.at(3)[1].wrench[:3], (T[3] @ T[1])[:3, 2])


def test_the_prefix_of_a_wrist_may_stand_before_all_its_frames():
    """By it two wrists share one /tf; the other wrist's frames are none of this one's."""
    mapped = {"here": SensorFrame("wrist_platform")}
    stream = PredictionStream(None, StreamSettings(frames=Frames(mapped, "left/")))
    chain = [
        transform("left/wrist_platform", "left/ft", 1),
        transform("right/wrist_base", "foot", 2),
    ]
    stream.on_static_transforms(chain)
    frames = stream.loads.frames
    for name in ("ft", "left/ft", "/left/ft", "left/here", "wrist_platform", "left/wrist_platform"):
        assert frames.load(name, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)).on_platform
    assert frames.is_at_origin("left/wrist_base")
    assert frames.turns("left/wrist_platform")
    for name in ("foot", "right/wrist_base", "right/ft"):
        with pytest.raises(FrameError, match="is not known"):
            frames.load(name, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


def test_a_slash_before_a_name_does_not_count():
    found = sensor_frames([transform("/wrist_platform", "/ft", 1)])
    assert found.keys() == {"ft"}
    mapped = Frames({"ft": SensorFrame("wrist_platform", position=np.array([0.0, 0.0, 0.1]))})
    heavy = mapped.load("/ft", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert np.allclose(heavy.wrench, [1.0, 0.0, 0.0, 0.0, 0.1, 0.0])
    assert Frames().load("/wrist_base", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)).wrench[0] == 1.0
    assert np.allclose(Frames().in_base("/wrist_base", "pose")[1], 0.0)
    assert frames_from_yaml("{/ft: {parent: wrist_platform}}").sensors.keys() == {"ft"}
