"""Recordings in and out: rosbag2 folders with MCAP storage and bare MCAP files.

Nothing here needs a ROS installation: MCAP comes from the package ``mcap``, the messages' CDR from
`cdr`.  A recording is read as messages (`open_recording`) or as arrays (`samples.read_samples`).
"""

from wrist_stiffness.recording.reader import Recording, open_recording
from wrist_stiffness.recording.samples import Samples, read_samples
from wrist_stiffness.recording.writer import RecordingWriter

__all__ = [
    "Recording",
    "RecordingWriter",
    "Samples",
    "open_recording",
    "read_samples",
]
