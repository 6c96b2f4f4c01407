"""Parts attached to a board: by words, on all buses at once, in slices, from a snapshot; and what is refused."""

import pickle
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest

from bluepill_sim import BluePill, BluePillError
from bluepill_sim.__main__ import run
from bluepill_sim.cli.parts import show_parts
from bluepill_sim.parts import Ssd1306
from bluepill_sim.parts.attached import PartError, Use
from bluepill_sim.parts.registry import PARTS, PartSpec, attach, build, parse_part, part_class
from simbase.errors import FileError
from simbase.trust import own_code

PROGRAM = Path(__file__).parents[2] / "firmware" / "parts.elf"
ATTACHED = (
    "ssd1306,on=I2C1", "mpu6050,on=I2C1,int=PB1", "24c02,on=I2C1", "sd-card,on=SPI1,select=PA4",
    "hc-sr04,trig=PB8,echo=PB9,distance_m=0.5", "servo,signal=PA0", "ws2812,din=PA8,leds=3",
    "potentiometer,wiper=PA1,position=0.25",
    "can-node,on=CAN,period_ms=60,data=0A", "button,out=PB12,presses_s=0.07,held_s=0.01",
    "leds,led0=PB13,led1=PB14", "gps,on=USART3,rate_hz=5,fix_s=0.3",
)  # fmt: skip
SAID = (
    """\
oled written
imu is 104
imu x 0
imu z 16384
imu turns 0
eeprom has 90
card idle 1
card knows 8 1
card echoes 170
card waits 1
card ocr 192
card takes 0
card took 5
card gives 0
card sum 65280
echo us 2912
strip sent
volts 1024
can id 802
can data 48879
can id 291
can data 10
button changed 1
button is 1
$GPGGA,000000.20,,,,,0,00,99.99,,,,,,*64
$GPRMC,000000.20,V,,,,,,,010126,,,N*7B
$GPGGA,000000.40,4808.22000,N,01134.50000,E,1,08,1.00,520.0,M,0.0,M,,*60
done
""".replace("\n$", "\r\n$")
    .replace("*60\n", "*60\r\n")
    .replace("is 1\r", "is 1")
)


def equipped() -> BluePill:
    board = BluePill(PROGRAM)
    for words in ATTACHED:
        attach(board, parse_part(words))
    return board


def reported(board: BluePill) -> dict[str, str]:
    return {name: part.words() for name, part in board.attached.by_name.items() if hasattr(part, "words")}


@pytest.fixture(scope="module")
def finished() -> BluePill:
    board = equipped()
    board.run_for("500 ms")
    return board


def test_a_program_drives_one_of_every_part_at_once(finished: BluePill) -> None:
    assert finished.usart1.unread.decode() == SAID
    # 2.912 ms are 1 m at 343.42 m/s: 2911.9 us.
    assert finished.warnings == []
    words = reported(finished)
    oled = finished.attached.by_name["ssd1306"]
    dots = [(x, y) for y, row in enumerate(oled.dots()) for x, dot in enumerate(row) if dot]
    # Eight squares of 8 by 8, the upper row beside the first, and the left column below it.
    assert len(dots) == 8 * 64 + 120 + 56
    assert ((0, 0) in dots, (63, 63) in dots, (64, 63) in dots) == (True, True, False)
    assert words["servo"] == "at +45.0 deg, commanded +45.0 deg by 25 pulses"
    assert words["ws2812"] == "#ff1020 #0000ff #ffffff after 1 frames"
    assert words["sd-card"] == "8 MiB, 1 blocks read, 1 written"
    assert words["leds"].startswith("led0 lit after ")
    assert words["hc-sr04"] == "1 measurements"
    assert words["button"] == "pressed 1 times"
    assert words["can-node"].startswith("1 frames heard, 9 sent")


def test_the_result_depends_neither_on_slices_nor_on_a_snapshot_in_between(finished: BluePill) -> None:
    sliced, said = equipped(), bytearray()
    sliced.usart1.subscribe(lambda rows: said.extend(word for word, _ in rows))
    end = finished.now_ns
    while sliced.now_ns < 150_000_000:
        sliced.advance_to(sliced.now_ns + 377_777)
    other = equipped()
    other.restore(pickle.loads(pickle.dumps(sliced.snapshot())))  # noqa: S301 - our own
    other.usart1.subscribe(lambda rows: said.extend(word for word, _ in rows))
    while other.now_ns < end:
        other.advance_to(end)
    assert said.decode() == SAID
    assert (reported(other), other.cycle) == (reported(finished), finished.cycle)


def test_every_part_that_ships_is_found_and_has_a_section_in_its_page() -> None:
    page = (Path(__file__).parents[4] / "docs" / "parts.md").read_text(encoding="utf-8")
    for kind, row in PARTS.items():
        assert callable(part_class(kind))
        assert f"`{kind}`" in page, row


MINE = """
from simbase.state import Stateful
from bluepill_sim.parts import Socket, Use

class Blinker(Stateful):
    PINS = {"out": Use.HELD}
    STATE = ("due",)
    def __init__(self, *, period_ms: int = 10, label: str = "x", loud: bool = False):
        if period_ms < 1:
            raise ValueError(f"a period of {period_ms} ms")
        self.period, self.label, self.loud, self.due, self.times = period_ms * 1_000_000, label, loud, 0, []
    def plug(self, socket: Socket) -> None:
        self.socket = socket
    def next_deadline(self):
        return self.due
    def advance_to(self, now_ns):
        self.times.append(now_ns)
        self.socket.pin("out").drive(len(self.times) % 2)
        self.due += self.period

class Stuck(Blinker):
    def advance_to(self, now_ns):
        pass
"""


def mine(folder: Path, words: str, text: str = MINE) -> PartSpec:
    (folder / "mine.py").write_text(text)
    sys.modules.pop("p2os_part_mine", None)
    kind = own_code(f"mine.py:{words.partition(',')[0]}", folder)
    return PartSpec(kind=kind, settings=parse_part(words).settings, folder=str(folder))


def test_a_class_in_a_file_is_a_part_with_settings_of_its_types(tmp_path: Path) -> None:
    board = BluePill(PROGRAM)
    attach(board, mine(tmp_path, "Blinker,period_ms=0x10,loud=yes,label=7,out=PB12"))
    part = board.attached.by_name["Blinker"]
    board.run_for("32 ms")
    assert (part.times, part.label, part.loud) == ([0, 16_000_000, 32_000_000], "7", True)
    assert board.pin("PB12").level
    saved = board.snapshot()
    board.run_for("20 ms")
    board.restore(saved)
    assert part.due == 48_000_000


def test_a_part_that_stays_due_is_an_error_and_no_hang(tmp_path: Path) -> None:
    board = BluePill(PROGRAM)
    attach(board, mine(tmp_path, "Stuck,out=PB12"))
    with pytest.raises(PartError, match="time stands still"):
        board.run_for("1 ms")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "names no part"),
        ("ssd1307,on=I2C1", "there is no part 'ssd1307'"),
        ("ssd1306,on", "is no KEY=VALUE"),
        ("ssd1306,on=I2C1,on=I2C2", "stands there twice"),
        ("ssd1306,on=I2C3", "no such I2C: I2C3"),
        ("ssd1306,on=I2S1", "cannot hang on 'I2S1'"),
        ("ssd1306,on=USART1", "does not know USART"),
        ("ssd1306,on=SPI1", "needs dc=PIN"),
        ("ssd1306,on=I2C1,dc=PA8", "dc is for an SPI"),
        ("ssd1306,on=I2C1,select=PA4", "selected by a pin on an SPI only"),
        ("ssd1306,select=PA4", "selected on no bus"),
        ("ssd1306,on=I2C1,address=high", "'high' is not a whole number"),
        ("ssd1306,on=I2C1,adress=60", "no setting 'adress'"),
        ("ssd1306,on=I2C1,address=0x20", "no SSD1306 at 0x20"),
        ("hc-sr04,trig=PA8", "needs its pin 'echo'"),
        ("24c02", "the 24c02 is connected to nothing"),
        ("ssd1306,dc=PA8", "the ssd1306 is connected to nothing"),
        ("hc-sr04,trig=PA8,echo=PF1", "the chip has no leg PF1"),
        ("hc-sr04,trig=PA8,echo=PC1", "the chip has no leg PC1"),
        ("servo,signal=PA8,least_us=2000", "no servo"),
        ("gps,on=USART4", "no such port: USART4"),
        ("gps", "the gps is connected to nothing"),
        ("sd-card,on=SPI1,image=none.img", "no such file"),
        ("24c02,on=I2C1,contents=none.bin", "no such file"),
        ("button,out=PA8,presses_s=1+x", "'x' is not a number"),
        ("button,out=PA8,is_active_low=perhaps", "'perhaps' is not true or false"),
        ("leds", "the leds is connected to nothing"),
        ("ws2812", "the ws2812 is connected to nothing"),
        ("can-node,on=CAN,data=0", "no data in hex"),
        ("none.py:Part", "there is no file none.py"),
    ],
)
def test_what_cannot_be_attached_is_refused_in_one_line(words: str, message: str) -> None:
    board = BluePill(PROGRAM)
    with pytest.raises(BluePillError, match=re.escape(message)) as caught:
        attach(board, parse_part(words))
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("class Blinker(", "SyntaxError"),
        ("class Other: pass", "has no class 'Blinker'"),
        ("class Blinker:\n    def __init__(self, *, n: int = 1):\n        raise KeyError('n')", "KeyError"),
    ],
)
def test_a_file_that_is_no_part_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(PartError, match=message):
        build(mine(tmp_path, "Blinker", text))


def test_a_second_part_of_a_name_gets_another_one() -> None:
    board = BluePill(PROGRAM)
    for name in ("oled", "oled", ""):
        board.attach(Ssd1306(), on="I2C1", name=name)
    assert list(board.attached.by_name) == ["oled", "oled-2", "Ssd1306"]


def test_the_command_line_shows_what_parts_came_to_and_writes_their_pictures(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    options = ["--for", "60ms", "--parts", str(tmp_path / "shots"), "--attach", "ssd1306,on=I2C1,name=oled"]
    assert run(["run", str(PROGRAM), *options]) == 0
    assert "oled: 128x64, on, 688 dots lit\n" in capfd.readouterr().err
    assert (tmp_path / "shots" / "oled.png").read_bytes()[:4] == b"\x89PNG"
    assert run(["run", str(PROGRAM), "--attach", "ssd1307"]) == 2
    assert "there is no part 'ssd1307'" in capfd.readouterr().err


def test_the_command_line_lists_parts_with_their_settings(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["parts"]) == 0
    listed = capfd.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(PARTS)
    assert max(map(len, listed)) <= 80
    assert run(["parts", "hc-sr04"]) == 0
    one = capfd.readouterr().out
    assert "  pins  trig, echo\n" in one
    assert "  temperature_c = 20.0\n" in one


@pytest.mark.parametrize("name", ["../X", "/X", "a/b", "a\\b", "..", ".X", "x\ny", "x\0y"])
def test_a_part_has_no_name_that_leads_out_of_a_folder(name: str) -> None:
    board = BluePill(PROGRAM)
    with pytest.raises(PartError, match="is no name of a part"):
        attach(board, parse_part(f"sd-card,on=SPI1,select=PA4,save=true,name={name}"))
    assert not board.attached.by_name


class Writer:
    """A part of a user that leaves a file behind whose name leads elsewhere."""

    PINS: ClassVar = {"out": Use.HELD}

    def files(self) -> dict[str, bytes]:
        return {"/../../X": b"x"}


def test_a_part_writes_no_file_out_of_the_folder(tmp_path: Path) -> None:
    board = BluePill(PROGRAM)
    board.attach(Writer(), name="writer", out="PB12")
    with pytest.raises(FileError, match="leads out of the folder"):
        show_parts(board, tmp_path / "parts")
    assert list(tmp_path.parent.rglob("X*")) == []


@pytest.mark.parametrize("name", ["../card.img", "above", "/dev/zero", "inner", "there/../../card.img"])
@pytest.mark.parametrize(("kind", "key"), [("sd-card,on=SPI1", "image"), ("24c02,on=I2C1", "contents")])
def test_a_part_of_a_scenario_reads_files_of_its_folder_alone(kind: str, key: str, name: str, tmp_path: Path) -> None:
    here = tmp_path / "here"
    (here / "inner").mkdir(parents=True)
    (tmp_path / "card.img").write_bytes(bytes(512 * 1024))
    (here / "above").symlink_to(tmp_path / "card.img")
    spec = parse_part(f"{kind},{key}={name}")
    with pytest.raises(PartError, match=r"leads out of the folder|is no file"):
        build(replace(spec, folder=str(here)))


def test_a_part_of_the_command_line_reads_any_file_but_a_device(tmp_path: Path) -> None:
    (tmp_path / "card.img").write_bytes(bytes(512 * 1024))
    assert build(parse_part(f"sd-card,on=SPI1,image={tmp_path}/card.img"))
    with pytest.raises(PartError, match="/dev/zero is no file"):
        build(parse_part("sd-card,on=SPI1,image=/dev/zero"))


def test_a_file_that_a_part_cannot_read_is_said_without_the_name_of_an_error() -> None:
    with pytest.raises(PartError) as refused:
        build(parse_part("sd-card,on=SPI1,image=/no/such.img"))
    assert str(refused.value).startswith("sd-card: cannot read /no/such.img: no such file or directory")
