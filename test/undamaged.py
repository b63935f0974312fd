"""Recordings that must be whole."""

from wrist_stiffness.recording import open_recording


def undamaged(path):
    """Open a recording in which everything can be read."""
    recording = open_recording(path)
    for _ in recording.messages():
        pass
    assert recording.damage == ""
    return recording
