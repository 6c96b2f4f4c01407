"""The ITM's stimulus ports in files: text with times, and packets that a decoder of its own reads back."""

import io
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.__main__ import run
from bluepill_sim.debug.itm import PacketWriter, TextWriter
from tests.bluepill_sim.machine import Machine

WRITES = st.lists(
    st.tuples(
        st.integers(0, 1 << 40),
        st.integers(0, 31),
        st.sampled_from([1, 2, 4]).flatmap(lambda n: st.binary(min_size=n, max_size=n)),
    ),
    max_size=20,
)


class Kept(io.BytesIO):
    """A file whose bytes outlive it."""

    def close(self) -> None:
        self.data = self.getvalue()


def decoded(data: bytes) -> list[tuple[int, int, bytes]]:
    """Return (cycle, port, bytes) by the tables of ARMv7-M appendix E."""
    found: list[tuple[int, int, bytes]] = []
    words: list[tuple[int, bytes]] = []
    cycle = at = 0
    while at < len(data):
        header = data[at]
        at += 1
        if header & 3:
            size = (0, 1, 2, 4)[header & 3]
            assert not header & 4, "a packet of the ITM, not of the DWT"
            words.append((header >> 3, data[at : at + size]))
            at += size
            continue
        if header & 0xF0 == 0xC0:
            shift = 0
            while True:
                cycle += (data[at] & 0x7F) << shift
                shift += 7
                at += 1
                if not data[at - 1] & 0x80:
                    break
            assert shift <= 28
        else:
            assert header & 0x8F == 0
            assert 1 <= header >> 4 <= 6
            cycle += header >> 4
        if at == len(data) or data[at] & 3:
            found += [(cycle, *word) for word in words]
            words = []
    return found


@settings(max_examples=100)
@given(writes=WRITES)
def test_packets_say_what_was_written_when_and_to_which_port(writes: list[tuple[int, int, bytes]]) -> None:
    file, cycle, expected = Kept(), 0, []
    writer = PacketWriter(file)
    for cycles, port, data in writes:
        cycle += cycles
        writer.write(0, cycle, port, data)
        expected.append((cycle, port, data))
    writer.close()
    assert decoded(file.data) == expected


@pytest.mark.parametrize(
    ("cycles", "stamp"),
    [(0, "c000"), (1, "10"), (6, "60"), (7, "c007"), (127, "c07f"), (128, "c08001"), ((1 << 28) - 1, "c0ffffff7f"),
     (1 << 28, "c0ffffff7f10")],
)  # fmt: skip
def test_a_time_stamp_is_as_long_as_it_needs_to_be(cycles: int, stamp: str) -> None:
    file = Kept()
    writer = PacketWriter(file)
    writer.write(0, cycles, 3, b"ab")
    writer.close()
    assert file.data.hex() == "1a6162" + stamp


def test_lines_have_the_time_of_their_first_character() -> None:
    file = io.StringIO()
    close, file.close = file.close, lambda: None  # type: ignore[method-assign]  # what was written is looked at
    writer = TextWriter(file)
    for at, port, data in ((1_000, 0, b"h"), (2_000, 0, b"i\r\n"), (3_000, 5, b"\x34\x12"), (4_000, 0, b"\x01x")):
        writer.write(at, 0, port, data)
    writer.close()
    assert file.getvalue().splitlines() == [
        "   0.000001000   0  hi", "   0.000003000   5  0x1234", "   0.000004000   0  \\x01x",
    ]  # fmt: skip
    close()


#: What CMSIS' ITM_SendChar does, with what a probe sets left to the probe: port 0 if it is on and ready.
SEND = """
send: mov32 r1, #0xE0000E80
ldr r2, [r1, #0]
movs r3, #1
.half 0x401A
cmp r2, #0
beq none
mov32 r1, #0xE0000000
ready: ldr r2, [r1, #0]
cmp r2, #0
beq ready
strb r0, [r1, #0]
none: bx lr
"""


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_program_prints_to_a_file_as_with_a_probe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, watchdog: None, core: str
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    text = "".join(f"movs r0, #{byte}\nbl send\n" for byte in b"ok\n")
    ((_, image),) = Machine(f"{text}b stop\n{SEND}", {}).image.segments
    (tmp_path / "itm.bin").write_bytes(image)
    options = ["--for", "1ms", "--itm", str(tmp_path / "log.txt"), "--swo", str(tmp_path / "log.swo")]
    assert run(["run", str(tmp_path / "itm.bin"), *options]) == 0
    (line,) = (tmp_path / "log.txt").read_text().splitlines()
    assert line.split()[1:] == ["0", "ok"]
    rows = decoded((tmp_path / "log.swo").read_bytes())
    assert b"".join(data for _, _, data in rows) == b"ok\n"
    assert float(line.split()[0]) == pytest.approx(rows[0][0] * 125e-9, abs=1e-9)
    assert run(["run", str(tmp_path / "itm.bin"), "--for", "1ms"]) == 0, "without a probe nothing waits"
