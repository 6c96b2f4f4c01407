"""Judges notice a wrong answer: programs of ours that answer, and the same judge that wants something else."""

import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from bluepill_sim import BluePill
from tests.bluepill_sim.machine import Machine
from tests.tools.forked_python import forked_python
from tools.foreign.judges.dialogue import Dialogue, Exchange
from tools.foreign.judges.hosted import CountedEdges, Hosted, SwitchedAxis
from tools.foreign.judges.scripted import Scripted
from tools.foreign.judges.usb_classes import Dfu, MassStorage, lamp_program
from tools.foreign.row import RowError, RowPlace

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")

#: Clocks of port A and USART1; PA0 an output, PA9 TX; USART1 at 115200 of 8 MHz. R0 is GPIOA, R2 USART1; RXNE and PA3
#: are read by their bit-band words.
SET_UP = """mov32 r0, #0x40021018
mov32 r1, #0x4004
str r1, [r0, #0]
mov32 r0, #0x40010800
mov32 r1, #0x44444433
str r1, [r0, #0]
mov32 r1, #0x444444B4
str r1, [r0, #4]
mov32 r2, #0x40013800
movs r1, #69
str r1, [r2, #8]
mov32 r1, #0x200C
str r1, [r2, #12]
"""
#: Gives each character back, one higher, with a pulse at PA0.
ANSWERS = (
    SET_UP
    + """mov32 r5, #0x42270014
loop: ldr r1, [r5, #0]
cmp r1, #0
beq loop
ldr r4, [r2, #4]
adds r4, #1
str r4, [r2, #4]
movs r1, #1
str r1, [r0, #16]
str r1, [r0, #20]
b loop"""
)
#: Steps at PA0, PA1 low, until PA3 is high, and then says so.
HOMES = (
    SET_UP
    + """mov32 r5, #0x4221010C
loop: ldr r1, [r5, #0]
cmp r1, #0
bne home
movs r1, #1
str r1, [r0, #16]
str r1, [r0, #20]
mov32 r3, #4000
wait: subs r3, #1
bne wait
b loop
home: movs r1, #72
str r1, [r2, #4]"""
)
#: Sends "abc", prints what comes back.
HOST = """import os, sys, termios, tty
line = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(line)
os.write(line, b"abc")
came = b""
while len(came) < 3:
    came += os.read(line, 10)
print("came", came.decode())
sys.exit(int(sys.argv[2]))
"""


@pytest.fixture
def place(tmp_path: Path) -> RowPlace:
    return RowPlace(cache=tmp_path, scratch=tmp_path)


@pytest.fixture
def image(tmp_path: Path) -> Callable[[str], str]:
    """Write an assembled program into the cache: image(source) is its name there."""

    def make(source: str) -> str:
        ((_, data),) = Machine(source, {}).image.segments
        (tmp_path / "image.bin").write_bytes(data)
        return "image.bin"

    return make


def hosted(image: str, code: int = 0, **wanted: object) -> Hosted:
    words = (forked_python(), "-c", HOST, "{line}", str(code))
    return Hosted(image=image, hosts=(words,), **cast("dict[str, tuple[str, ...]]", wanted))


# Dialogues.


def test_a_dialogue_tells_what_it_heard(image, place: RowPlace) -> None:
    steps = (Exchange(pause="1 ms", say=b"abc", hear=rb"b(cd)"), Exchange(say=b"z", hear=rb"\{"))
    assert Dialogue(image=image(ANSWERS), steps=steps).run(place) == "cd; {"


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (
            Exchange(pause="1 ms", say=b"abc", hear=rb"abc", within="50 ms"),
            r"no b'abc' to b'abc' within 50 ms; it said b'bcd'",
        ),
        (Exchange(hear=rb"ready", within="50 ms"), r"no b'ready' within 50 ms; it said b''"),
    ],
)
def test_a_dialogue_fails_by_what_was_said_in_place_of_it(image, place: RowPlace, step: Exchange, said: str) -> None:
    with pytest.raises(RowError, match=said):
        Dialogue(image=image(ANSWERS), steps=(step,)).run(place)


def test_what_was_heard_before_a_question_answers_none(image, place: RowPlace) -> None:
    steps = (Exchange(pause="1 ms", say=b"a", hear=rb"b"), Exchange(hear=rb"b", within="50 ms"))
    with pytest.raises(RowError, match="no b'b' within 50 ms"):
        Dialogue(image=image(ANSWERS), steps=steps).run(place)


def test_what_came_before_something_is_said_is_no_answer_to_it(image, place: RowPlace) -> None:
    steps = (
        Exchange(pause="1 ms", say=b"ab", hear=rb"b"),
        Exchange(pause="1 ms", say=b"x", hear=rb"c", within="50 ms"),
    )
    with pytest.raises(RowError, match="no b'c' to b'x' within 50 ms; it said b'y'"):
        Dialogue(image=image(ANSWERS), steps=steps).run(place)


def test_a_dialogue_with_a_program_that_dies_says_of_what(image, place: RowPlace) -> None:
    with pytest.raises(RowError, match="UsageFault: undefined instruction"):
        Dialogue(image=image("udf"), steps=(Exchange(hear=rb"x", within="1 h"),)).run(place)


# Hosts.


@pytest.mark.slow
def test_a_host_passes_by_what_it_printed_and_by_the_edges_that_it_caused(image, place: RowPlace) -> None:
    judge = hosted(image(ANSWERS), hears=(r"came (\w+)",), edges=(CountedEdges(pin="PA0", least=3),))
    assert judge.run(place) == "bcd; 3 edges at PA0"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "wanted", "said"),
    [
        (3, {}, "ended with 3: 'came bcd'"),
        (0, {"hears": (r"came abc",)}, "the host did not print 'came abc': 'came bcd'"),
        (0, {"hears": (r"bcd", r"came")}, "the host did not print 'came'"),
        (0, {"edges": (CountedEdges(pin="PA0", least=4),)}, "3 edges at PA0, 4 to 4 must be"),
        (0, {"edges": (CountedEdges(pin="PA0", least=1, most=2),)}, "3 edges at PA0, 1 to 2 must be"),
        (0, {"edges": (CountedEdges(pin="PA0", least=1, since="PA1"),)}, "0 edges at PA0, 1 to 1 must be"),
    ],
)
def test_a_host_fails_by_its_code_its_words_and_its_edges(
    image, place: RowPlace, code: int, wanted: dict[str, object], said: str
) -> None:
    with pytest.raises(RowError, match=said):
        hosted(image(ANSWERS), code, **wanted).run(place)


@pytest.mark.slow
def test_a_host_that_does_not_end_fails_with_where_the_program_is(image, place: RowPlace) -> None:
    judge = Hosted(image=image(ANSWERS), hosts=(("sleep", "60"),), hosts_s=0.2)
    with pytest.raises(RowError, match=r"sleep did not end: within 0\.2 s"):
        judge.run(place)


@pytest.mark.slow
def test_an_axis_closes_its_switch_where_it_is_reached(image, place: RowPlace) -> None:
    host = "import os, sys; print(os.read(os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY), 1))"
    axis = SwitchedAxis(step="PA0", direction="PA1", switch="PA3", above=20)
    judge = Hosted(
        image=image(HOMES), hosts=((forked_python(), "-c", host, "{line}"),), axes=(axis,), hears=("(b'H')",),
        edges=(CountedEdges(pin="PA0", least=20, most=22),),
    )  # fmt: skip
    assert judge.run(place).startswith("b'H'; 2")


def test_an_error_of_the_emulators_is_the_rows(image, place: RowPlace) -> None:
    def script(board: BluePill, _place: RowPlace) -> str:
        return str(board.usb.wait_configured("1 ms"))

    with pytest.raises(RowError, match="the USB device is not configured"):
        Scripted(image=image("nop"), script=script).run(place)


# Classes of USB.


class FakeUsb:
    """Answers what it is told to."""

    def __init__(self, *answers: bytes) -> None:
        self.answers, self.written = list(answers), list[bytes]()

    def write(self, _endpoint: int, data: bytes) -> None:
        self.written.append(data)

    def wait_packet(self, _endpoint: int) -> SimpleNamespace:
        return SimpleNamespace(data=self.answers.pop(0))

    def transfer(self, *_setup: object, **_options: object) -> bytes:
        return self.answers.pop(0)


def board_with(*answers: bytes) -> BluePill:
    fake = SimpleNamespace(usb=FakeUsb(*answers), run_for=lambda _span: None)
    return cast("BluePill", fake)


def status(result: int, tag: int = 1) -> bytes:
    return struct.pack("<IIIB", 0x53425355, tag, 0, result)


def test_a_disk_is_believed_by_its_status_alone() -> None:
    whole = b"x" * 64
    assert MassStorage(board_with(whole, whole, status(0)), 1, 0x81).command(b"\x28", 128) == 2 * whole
    for wrong in (status(1), status(0, tag=2), b"USBC" + status(0)[4:]):
        with pytest.raises(RowError, match="SCSI 28: status"):
            MassStorage(board_with(whole, whole, wrong), 1, 0x81).command(b"\x28", 128)


def test_a_disk_that_sends_less_may_say_its_status_in_place_of_data() -> None:
    assert MassStorage(board_with(b"short", status(0)), 1, 0x81).command(b"\x12", 36) == b"short"


def test_a_download_ends_by_the_devices_state() -> None:
    busy, idle = bytes((0, 10, 0, 0, 4, 0)), bytes((0, 0, 0, 0, 5, 0))
    assert Dfu(board_with(b"", busy, busy, idle)).download(0, b"x") == 5
    with pytest.raises(RowError, match="DFU status 3 in state 10"):
        Dfu(board_with(b"", busy, bytes((3, 0, 0, 0, 10, 0)))).download(0, b"x")
    with pytest.raises(RowError, match="still state 4 after 200 polls"):
        Dfu(board_with(b"", *(300 * [busy]))).download(0, b"x")


def test_the_program_that_is_flashed_lights_the_lamp(tmp_path: Path) -> None:
    file = tmp_path / "lamp.bin"
    file.write_bytes(lamp_program(0x0800_0000))
    board = BluePill(file)
    assert not board.led_is_on
    board.run_for("1 ms")
    assert board.led_is_on
    assert board.fault is None
    assert sys.byteorder == "little"
