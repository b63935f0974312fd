from pathlib import Path

import pytest

from wrist_stiffness.recording import open_recording, read_samples
from wrist_stiffness.simulation.catalogue import ALL

FOLDER = Path(__file__).parents[1] / "data/tutorial"
DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday")


@pytest.mark.parametrize("day", DAYS)
def test_a_day_is_small_and_names_no_effect(day):
    path = FOLDER / f"{day}.mcap"
    recording = open_recording(path)
    assert path.stat().st_size < 1_000_000
    texts = [message.data for _, _, message in recording.messages(["/recording_notes"])]
    assert len(texts) == 1
    assert not any(effect in texts[0] for effect in (*ALL, "clamp", "plate"))


def test_days_follow_each_other_and_the_clamp_was_there_on_two_of_them():
    samples = [read_samples(open_recording(FOLDER / f"{day}.mcap")) for day in DAYS]
    starts = [each.joints.time_ns[0] / 86_400e9 for each in samples]
    assert [round(start - starts[0], 6) for start in starts] == [0, 1, 2, 3, 4, 5]
    clamp = ["clamp_bar"]
    assert [sorted(each.covariates) for each in samples] == [[], [], clamp, clamp, [], []]
