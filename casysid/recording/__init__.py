"""Recordings: checked samples of a robot, in memory or on disk."""

from casysid.recording.file import Facts, RecordingFile
from casysid.recording.reading import open_recording, open_recordings, read_recording, read_recordings
from casysid.recording.recording import GAP, Recording
from casysid.recording.source import BATCH, Source, Stretch
from casysid.recording.spectrum import PositionSpectrum
from casysid.recording.summary import RecordingSummary

__all__ = [
    "BATCH",
    "GAP",
    "Facts",
    "PositionSpectrum",
    "Recording",
    "RecordingFile",
    "RecordingSummary",
    "Source",
    "Stretch",
    "open_recording",
    "open_recordings",
    "read_recording",
    "read_recordings",
]
