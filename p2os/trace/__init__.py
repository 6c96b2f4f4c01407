"""Recorded conversations: captures, the files that hold them, their rows, and every byte explained.

Nothing here reads a clock or opens a port; `p2os decode`, `sniff`, `record`,
`replay` and `export` are skins on it.
"""

from p2os.trace.capture import Capture, CaptureBuilder, Chunk, Direction, capture_of
from p2os.trace.explain import Part, explain
from p2os.trace.listing import Lister, Reading, Row, frame_chunks, rows_of
from p2os.trace.pcap import read_pcap, write_pcap
from p2os.trace.recording import read_recording, write_recording
from p2os.trace.sources import read_argument, read_capture, read_file

__all__ = [
    "Capture",
    "CaptureBuilder",
    "Chunk",
    "Direction",
    "Lister",
    "Part",
    "Reading",
    "Row",
    "capture_of",
    "explain",
    "frame_chunks",
    "read_argument",
    "read_capture",
    "read_file",
    "read_pcap",
    "read_recording",
    "rows_of",
    "write_pcap",
    "write_recording",
]
