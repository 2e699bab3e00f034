"""Recorded crowds: file formats, catalogue, interpolation, draws, facts."""

from socialnav_mj.recordings.catalogue import load_recording
from socialnav_mj.recordings.reading import DEFAULT_READING, Reading
from socialnav_mj.recordings.recording import Crowd, Recording, Track

__all__ = ["DEFAULT_READING", "Crowd", "Reading", "Recording", "Track", "load_recording"]
