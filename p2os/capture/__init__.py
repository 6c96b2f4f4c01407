"""Recorded conversations: captures, the files that hold them, their rows, and every byte explained.

Nothing here reads a clock or opens a port; `p2os decode`, `sniff`, `record`,
`replay` and `export` are layers over it.
"""

from p2os.capture.chunks import Capture, Chunk, Direction, capture_of
from p2os.capture.explain import FramePart, explain
from p2os.capture.formats.pcap import write_pcap
from p2os.capture.formats.recording import write_recording
from p2os.capture.formats.sources import (
    CaptureSource,
    open_argument,
    open_capture,
    open_file,
    read_capture,
    read_file,
)
from p2os.capture.listing import Lister, ListingRow, frame_chunks, rows_of
from p2os.capture.reading import FollowedReading, Reading

__all__ = [
    "Capture",
    "CaptureSource",
    "Chunk",
    "Direction",
    "FollowedReading",
    "FramePart",
    "Lister",
    "ListingRow",
    "Reading",
    "capture_of",
    "explain",
    "frame_chunks",
    "open_argument",
    "open_capture",
    "open_file",
    "read_capture",
    "read_file",
    "rows_of",
    "write_pcap",
    "write_recording",
]
