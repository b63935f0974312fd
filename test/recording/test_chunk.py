"""The records of a chunk: the compiled walk finds what the one in Python finds, of any bytes."""

import struct

from hypothesis import example, given
from hypothesis import strategies as st

from wrist_stiffness.recording import mcap_chunk


@st.composite
def chunks(draw):
    """Return records of any kind, some of them cut or of a wrong length."""
    out = bytearray()
    for _ in range(draw(st.integers(0, 12))):
        content = draw(st.binary(max_size=40))
        length = draw(st.sampled_from([len(content)] * 8 + [0, 2**63, 2**64 - 1]))
        out += struct.pack("<BQ", draw(st.sampled_from([5, 5, 5, 3, 4, 0])), length) + content
    return bytes(out[: draw(st.sampled_from([len(out)] * 4 + [max(0, len(out) - 5)]))])


def test_it_is_built_here():
    assert mcap_chunk.records is not None


@given(buffer=chunks() | st.binary(max_size=60))
@example(buffer=b"")
@example(buffer=struct.pack("<BQ", 5, 0))
def test_both_walks_find_the_same(buffer):
    places, others, position = mcap_chunk._compiled_walk(buffer)
    wanted = mcap_chunk._walk(buffer)
    assert (places.tolist(), others, position) == (wanted[0].tolist(), *wanted[1:])
