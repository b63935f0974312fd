"""What is said of recordings before a command works on them."""

import json
import shutil
from pathlib import Path

import pytest

from wrist_stiffness.lookup.table_file import load_table
from wrist_stiffness.recording import RecordingWriter, open_recording, topics
from wrist_stiffness.recording.messages import String
from wrist_stiffness.shipped import shipped_file
from wrist_stiffness.workflows.read_sessions import Recordings, read_sessions

THURSDAY = Path(__file__).parent.parent / "data" / "tutorial" / "thursday.mcap"


@pytest.fixture(scope="module")
def table():
    return load_table(shipped_file("precomputed/palmieri2015.npz"))


def read(paths, table):
    return read_sessions(Recordings(paths, {}), table, lambda done, total: None)


def test_a_copy_of_a_recording_is_no_second_session(tmp_path, table):
    """Else a fit to the one would be judged by the other as by a day it has not seen."""
    copy = shutil.copy(THURSDAY, tmp_path / "friday.mcap")
    (session,) = read([THURSDAY, copy], table).values()
    assert session.name == "thursday.mcap"
    assert session.remarks[-1] == f"{copy} is a copy of it: used once"


def test_a_note_that_calls_calibrated_what_no_fit_refits_is_said(tmp_path, table):
    path = tmp_path / "noted.mcap"
    note = String(json.dumps({"calibrated": ["encoder_offset", "encoder_ofset", 3]}))
    with RecordingWriter(path) as writer:
        for topic, stamp_ns, message in open_recording(THURSDAY).messages():
            writer.write(topic, note if topic == topics.RECORDING_NOTES else message, stamp_ns)
    (session,) = read([path], table).values()
    assert "'calibrated' names encoder_ofset, 3, without effect" in session.remarks[-1]
