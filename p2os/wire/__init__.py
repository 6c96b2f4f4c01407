"""The wire: checksum, frames, and a decoder that no stream of bytes can wedge."""

from p2os.wire.checksum import checksum
from p2os.wire.decoder import BadChecksum, BadCount, Decoder, DecoderStats, Item, Noise, Stalled
from p2os.wire.frame import MAX_COUNT, MAX_PAYLOAD_BYTES, Frame

__all__ = [
    "MAX_COUNT",
    "MAX_PAYLOAD_BYTES",
    "BadChecksum",
    "BadCount",
    "Decoder",
    "DecoderStats",
    "Frame",
    "Item",
    "Noise",
    "Stalled",
    "checksum",
]
