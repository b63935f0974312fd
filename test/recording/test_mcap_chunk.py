"""Payloads taken at once by a chunk's own index, against a walk from record to record."""

from dataclasses import replace

import numpy as np
import pytest

from wrist_stiffness.recording.mcap_chunk import contents_of
from wrist_stiffness.recording.mcap_index import index_mcap


@pytest.fixture
def indexed(tmp_path, timeline, written, mcap_of):
    index = index_mcap(mcap_of(written(tmp_path / "recording", timeline(40))))
    return index.chunks, set(index.channels)


def held(chunk, wanted):
    """Return times and payloads by channel as plain lists."""
    return {
        number: (times.tolist(), [bytes(payload) for payload in payloads])
        for number, (times, payloads) in contents_of(chunk).payloads(wanted).items()
    }


def walked(chunk, wanted):
    return held(replace(chunk, indexed={}), wanted)


def test_the_index_gives_what_a_walk_gives(indexed):
    chunks, wanted = indexed
    assert sum(len(times) for chunk in chunks for times, _ in held(chunk, wanted).values()) > 40
    for chunk in chunks:
        assert chunk.indexed
        assert held(chunk, wanted) == walked(chunk, wanted)
        # Rows of numbers, not payloads one by one: else the walk was compared with itself.
        assert any(
            isinstance(p, np.ndarray) for _, p in contents_of(chunk).payloads(wanted).values()
        )


@pytest.mark.parametrize(
    "lie",
    [
        lambda places: places[:-1],
        lambda places: places[1:],
        lambda places: places + 1,
        lambda places: np.append(places, places[-1:]),
        lambda places: np.append(places, 1 << 40),
        lambda places: np.append(places, -1 << 40),
        lambda places: np.append(places, 0),
        lambda places: places[:0],
    ],
    ids=[
        "last one left out",
        "first one left out",
        "shifted",
        "twice",
        "beyond",
        "below",
        "no message",
        "none",
    ],
)
def test_an_index_that_lies_is_not_followed(indexed, lie):
    (chunk, *_), wanted = indexed
    for number, places in chunk.indexed.items():
        lied = replace(chunk, indexed={**chunk.indexed, number: lie(places)})
        assert held(lied, wanted) == walked(chunk, wanted)
