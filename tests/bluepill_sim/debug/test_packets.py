"""The frames of GDB's protocol: any cut, any damage, any bytes."""

from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.debug.packets import MAX_BYTES, GdbPacket, PacketMark, PacketReader, checksum, frame, unescape


@given(st.lists(st.binary(max_size=40), max_size=6), st.data())
def test_packets_come_out_as_they_went_in_however_the_bytes_are_cut(payloads: list[bytes], data: st.DataObject) -> None:
    stream = b"+".join(frame(payload) for payload in payloads)
    reader, events, at = PacketReader(), [], 0
    while at < len(stream):
        size = data.draw(st.integers(1, 9))
        events += reader.receive(stream[at : at + size])
        at += size
    assert [event.payload for event in events if isinstance(event, GdbPacket)] == payloads
    assert set(events) - {GdbPacket(payload) for payload in payloads} <= {PacketMark.ACK}


@given(st.binary(max_size=300))
def test_any_bytes_give_events_and_no_exception(data: bytes) -> None:
    for event in PacketReader().receive(data):
        assert isinstance(event, GdbPacket | PacketMark)


@given(st.binary(max_size=30), st.integers(0, 10_000), st.integers(1, 255))
def test_a_damaged_packet_never_passes_as_another(payload: bytes, place: int, flip: int) -> None:
    sent = bytearray(frame(payload))
    sent[place % len(sent)] ^= flip
    packets = [event.payload for event in PacketReader().receive(bytes(sent)) if isinstance(event, GdbPacket)]
    # One changed byte changes the sum, unless it is a digit that changed its case.
    assert packets in ([], [payload])


def test_a_packet_after_a_cut_off_one_is_whole() -> None:
    assert PacketReader().receive(b"$m0,4$g#67") == [GdbPacket(b"g")]


def test_marks_stand_between_packets() -> None:
    assert PacketReader().receive(b"+-\x03x$g#00") == [
        PacketMark.ACK,
        PacketMark.NAK,
        PacketMark.INTERRUPT,
        PacketMark.DAMAGED,
    ]
    assert PacketReader().receive(b"$g#zz") == [PacketMark.DAMAGED]


def test_a_packet_that_is_too_long_is_refused_and_takes_no_memory() -> None:
    payload = b"A" * (MAX_BYTES + 1)
    assert PacketReader().receive(b"$" + payload + b"#%02x" % checksum(payload)) == [PacketMark.DAMAGED]


def test_an_escape_at_the_end_is_lost() -> None:
    assert unescape(b"a}\x03}") == b"a#"
    assert frame(b"#") == b"$}\x03#80"
