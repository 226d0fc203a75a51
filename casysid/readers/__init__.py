"""Logs on disk to recordings: formats, column names, faults and weaknesses."""

from casysid.readers.reading import read_recording, read_recordings

__all__ = ["read_recording", "read_recordings"]
