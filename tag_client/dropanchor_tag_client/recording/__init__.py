"""Recordings: folders of tables with the samples of one tag, and optionally the truth."""

from dropanchor_tag_client.recording.reading import read_recording
from dropanchor_tag_client.recording.recording import Anchor, Recording, RecordingError

__all__ = ["Anchor", "Recording", "RecordingError", "read_recording"]
