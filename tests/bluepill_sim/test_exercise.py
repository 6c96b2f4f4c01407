"""A compiled program meets each peripheral through the real core and bus."""

import itertools
import shutil
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("unicorn")

from collections.abc import Sequence

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.board import BluePill, BoardSnapshot
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from tests.bluepill_sim.firmware.compiled import COMPILER, HERE, compiled
from tests.bluepill_sim.machine import listen

pytestmark = pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"{COMPILER} is not installed")

MS = 1_000_000
#: 115200 baud at 72 MHz: 10 bits of 625 cycles.
CHARACTER_NS = 10 * 625 * 1000 // 72
EXPECTED = """\
unclocked 00000000
unmodelled 00000000
clocked 44444444
pb4-jtag 00000010
pb4-free 00000010
bit-band 00000080
locked 44444444
reset 44244444
erased ffffffff
programmed abcd1234
flash-sr 00000020
csr 0c000000
ready
"""


@pytest.fixture(scope="session")
def elf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled("exercise", tmp_path_factory.mktemp("exercise"), "-Og")


@pytest.mark.parametrize("core", ["python", "native"])
def test_a_program_linked_at_zero_runs_in_the_alias(
    elf: Path, tmp_path: Path, core: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    script = (HERE / "exercise.ld").read_text().replace("0x08000000", "0x0")
    (tmp_path / "zero.ld").write_text(script)
    path = tmp_path / "zero.elf"
    flags = ["-mcpu=cortex-m3", "-mthumb", "-Og", "-g", "-ffreestanding", "-nostdlib", "-Wl,--build-id=none"]
    sources = ["-T", str(tmp_path / "zero.ld"), str(HERE / "exercise.c"), "-lgcc", "-o", str(path)]
    subprocess.run([COMPILER, *flags, *sources], check=True)
    session = Session(path)
    assert session.run(50 * MS) == EXPECTED
    assert session.board.pc < 0x2_0000
    assert "exercise.c:" in "".join(session.board.last_blocks())
    code = Coverage(session.board.image, read_lines(session.board.image), StaticCode(session.board.chip.memory))
    assert any("exercise.c" in file.name and file.functions for file in code.files())


class Session:
    """A board that runs the program, and what came out of it."""

    def __init__(self, elf: Path) -> None:
        self.board = BluePill(elf)
        self.board.pin("PB4").drive(True)
        self.text = ""
        self.times: list[int] = []
        self.edges: list[tuple[str, str, int]] = []
        self.board.usart1.subscribe(self._take)
        listen(self.board, self.edges)

    def _take(self, rows: Sequence[tuple[int, int]]) -> None:
        self.text += "".join(chr(word) for word, _ in rows)
        self.times += [at_ns for _, at_ns in rows]

    def run(self, span_ns: int, slice_ns: int = MS) -> str:
        """Run for a while, and return what came out."""
        self.text, self.times = "", []
        end_ns, end_wall = self.board.now_ns + span_ns, time.monotonic() + 60
        while self.board.now_ns < end_ns:
            self.board.advance_to(min(self.board.now_ns + slice_ns, end_ns))
            assert time.monotonic() < end_wall
        return self.text


@pytest.fixture(scope="module")
def ready(elf: Path) -> tuple[BoardSnapshot, list[str]]:
    """The board that has printed all its lines and sleeps, and its warnings."""
    session = Session(elf)
    assert session.run(50 * MS) == EXPECTED
    return session.board.snapshot(), session.board.warnings


@pytest.fixture
def session(elf: Path, ready: tuple[BoardSnapshot, list[str]]) -> Session:
    session = Session(elf)
    session.board.restore(ready[0])
    return session


def test_warnings_name_what_the_program_did_wrong(session: Session) -> None:
    beginnings = (
        "GPIOC has no clock: RCC_APB2ENR bit 4 is 0 (write of 0x44344444 to 0x40011000) at meet_gpio+0x",
        "TIM5 is not modelled (read of 0x40000c00) at meet_gpio+0x",
        "PC13: configured while locked: ignored at meet_gpio+0x",
        "write to flash without FLASH_CR PG: ignored at program_flash+0x",
    )
    assert len(session.board.warnings) == len(beginnings)
    for warning, beginning in zip(session.board.warnings, beginnings, strict=True):
        assert warning.startswith(beginning)


def test_characters_are_a_character_time_apart(session: Session) -> None:
    session.board.usart1.receive(b"hello")
    start_ns = session.board.now_ns
    assert session.run(MS) == "HELLO"
    gaps = [later - earlier for earlier, later in itertools.pairwise(session.times)]
    assert all(abs(gap - CHARACTER_NS) < 1000 for gap in gaps)
    # In at the end of the first character, answered by the handler at once, out one character later.
    assert 0 < session.times[0] - start_ns - 2 * CHARACTER_NS < 2000


@pytest.mark.parametrize(("pin", "level", "text"), [("PA0", True, "edge 0\n"), ("PB10", False, "edge 10\n")])
def test_an_edge_wakes_the_program_within_a_microsecond(session: Session, pin: str, level: bool, text: str) -> None:
    session.board.pin(pin).drive(not level)
    session.run(2 * MS)
    session.edges.clear()
    start_ns = session.board.now_ns
    session.board.pin(pin).drive(level)
    assert session.run(2 * MS) == text
    # PA9 shows the bits of what is sent.
    (_, high, at_ns), (_, low, later_ns) = [edge for edge in session.edges if edge[0] != "PA9"]
    assert (high, low) == ("high", "low")
    # 12 cycles of entry and a dozen instructions at 72 MHz.
    assert start_ns < at_ns < later_ns < start_ns + 1000


@pytest.mark.parametrize("slice_ns", [7_000, 100_000, 10 * MS])
def test_slices_do_not_show(elf: Path, slice_ns: int) -> None:
    first, second = Session(elf), Session(elf)
    first.run(7 * MS)
    second.run(7 * MS, slice_ns)
    assert (second.text, second.times, second.edges) == (first.text, first.times, first.edges)


def test_a_watched_pin_ends_the_slice_at_its_edge(session: Session) -> None:
    session.board.subscribe_pins(["PB7"], lambda _rows: None, ends_slice=["PB7"])
    session.edges.clear()
    session.board.pin("PA0").drive(True)
    reached = session.board.advance_to(session.board.now_ns + MS)
    assert reached.reason.name == "EDGE"
    assert session.edges[0][2] <= reached.now < session.edges[0][2] + 1000


def test_a_restored_board_goes_on_identically(session: Session) -> None:
    session.board.usart1.receive(b"abcdef")
    session.run(250_000)
    state = session.board.snapshot()
    first = (session.run(2 * MS), session.times)
    session.board.restore(state)
    assert (session.run(2 * MS), session.times) == first
