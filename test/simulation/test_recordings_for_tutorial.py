from pathlib import Path

import pytest

from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.simulation.catalogue import ALL

DATA = Path(__file__).parents[1] / "data"
NAMES = ("wrist_a", "wrist_b", "wrist_c", "wrist_d")


@pytest.mark.parametrize("name", NAMES)
def test_recording_is_whole_and_small(name):
    path = DATA / f"{name}.mcap"
    samples = read_samples(open_recording(path))
    assert path.stat().st_size < 1_000_000
    assert len(samples.joints.time_ns) == len(samples.poses.time_ns) == 2400
    assert set(samples.temperatures) >= {"ambient", "frame", "link_1"}


@pytest.mark.parametrize("name", NAMES)
def test_no_effect_is_named_in_a_recording(name):
    recording = open_recording(DATA / f"{name}.mcap")
    texts = [message.data for _, _, message in recording.messages(["/recording_notes"])]
    assert len(texts) == 1
    assert not any(effect in texts[0] for effect in ALL)
