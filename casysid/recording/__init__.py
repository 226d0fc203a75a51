"""Recordings: checked samples of a robot, in memory or on disk."""

from casysid.recording.declared import Declared, parse_drive, parse_units, read_map
from casysid.recording.file import Facts, RecordingFile
from casysid.recording.reading import (
    draft_map,
    is_log,
    open_recording,
    open_recordings,
    read_recording,
    read_recordings,
)
from casysid.recording.recording import GAP, Recording
from casysid.recording.source import BATCH, Source, Stretch
from casysid.recording.spectrum import PositionSpectrum
from casysid.recording.summary import RecordingSummary

__all__ = [
    "BATCH",
    "GAP",
    "Declared",
    "Facts",
    "PositionSpectrum",
    "Recording",
    "RecordingFile",
    "RecordingSummary",
    "Source",
    "Stretch",
    "draft_map",
    "is_log",
    "open_recording",
    "open_recordings",
    "parse_drive",
    "parse_units",
    "read_map",
    "read_recording",
    "read_recordings",
]
