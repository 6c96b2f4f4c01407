"""What verbs of `p2os mcu` answer about two committed programs, whole: each line, figure and file."""

import contextlib
import hashlib
import io
import json
import re
import shlex
import zipfile
import zlib
from pathlib import Path

import pytest

from bluepill_sim import BluePill
from bluepill_sim.__main__ import run
from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.analysis.program_lines import program_lines
from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.program.image import load_image
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from bluepill_sim.program.variables import read_variables
from tests.bluepill_sim.board.parts.test_attaching import ATTACHED
from tests.bluepill_sim.board.parts.test_attaching import PROGRAM as PARTS
from tests.tools.examples import EXAMPLES
from tests.tools.suite.golden import kept_in

is_as_kept = kept_in("mcu")
#: Name, and the words behind `p2os mcu`: a program stands for its file, and `OUT/name` for a file that is written.
VERBS = {
    "info": "info dodge.elf --for 30ms",
    "info-json": "info sensors.elf --json --for 30ms",
    "coverage": "coverage sensors.elf --for 60ms --drive PA6=1@20ms --missed --lcov OUT/lcov",
    "coverage-json": "coverage dodge.elf --for 30ms --json",
    "profile": "profile dodge.elf --for 60ms --all --flame OUT/svg --folded OUT/folded",
    "profile-json": "profile sensors.elf --for 30ms --json",
    "trace": "trace sensors.elf --for 40us",
    "trace-json": "trace dodge.elf --from 10ms --for 10050us --json",
    "trace-calls": "trace sensors.elf --for 12ms --calls",
    "pins": "pins sensors.elf --for 6ms --all --drive PA6=1@2ms --vcd OUT/vcd --sr OUT/sr",
    "pins-json": "pins dodge.elf --for 6ms --json",
    "parts": "parts",
    "run-parts": f"run parts.elf --for 500ms --parts OUT/parts {' '.join(f'--attach {one}' for one in ATTACHED)}",
    "run-usb": "run usb_echo.elf --for 400ms --usb OUT/serial",
    "run-until": "run sensors.elf --for 5s --drive PA6=1@1ms --until 'usart1 matches on$' --itm OUT/itm --swo OUT/swo",
    "run-volts": "run analog.elf --for 120ms --drive PA0=1.65V --drive PA4=z@50ms --usart-baud 9600",
    "run-strict": "run analog.elf --for 120ms --strict",
    "races": "races dodge.elf --for 20ms --runs 2 --drive PA0=1@5ms --send w\\n@10ms",
    "compare-cores": "compare-cores sensors.elf --for 2ms --core python --drive PA6=1@1ms",
    "compare-cores-json": "compare-cores dodge.elf --for 1ms --core exact --json",
}  # fmt: skip


def answer(words: str, folder: Path) -> str:
    """Return what a verb answers: its exit code, both its outputs, and the files that it writes."""
    said, warned = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    given = [_file(word) if word.endswith(".elf") else word.replace("OUT", str(folder)) for word in shlex.split(words)]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(warned):
        code = run(given)
    outputs = [stream.buffer.getvalue().decode().replace("\r", "<CR>") for stream in (said, warned)]
    parts = [f"$ p2os mcu {words}: {code}\n{outputs[0]}", f"--- stderr\n{outputs[1]}"]
    for path in sorted(each for each in folder.rglob("*") if each.is_file()):
        name = path.relative_to(folder).as_posix()
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                parts += [f"--- {name} {each}\n{_shown(archive.read(each))}" for each in archive.namelist()]
        else:
            parts.append(f"--- {name}\n{_shown(path.read_bytes())}")
    whole = "\n".join(parts)
    for place, stands in ((EXAMPLES, "EXAMPLES"), (PARTS.parent, "FIRMWARE"), (folder, "OUT")):
        whole = whole.replace(str(place), stands)
    return whole.rstrip() + "\n"


def _file(name: str) -> str:
    return str(PARTS if name == PARTS.name else EXAMPLES / name)


def _shown(data: bytes) -> str:
    """Return a text, or what stands for bytes that are none; of a picture, for what it has compressed."""
    if data.startswith(b"\x89PNG"):
        data = data[16:24] + zlib.decompress(data[41:-16])  # after IHDR and the head of IDAT, up to its CRC and IEND
    with contextlib.suppress(UnicodeDecodeError):
        if b"\0" not in data:
            return data.decode().replace("\r", "<CR>")
    return f"{len(data)} bytes, SHA-256 {hashlib.sha256(data).hexdigest()}"


#: What is said to `monitor` of GDB, one session; a number: the chip runs up to there, in ns.
MONITOR = (
    "help", "time", "blocks", "pins", "3000000", "time", "pins all", "pin pa9", "pin PA6 1", "pin PA6 z", "pin PA6 0",
    "registers", "registers USART1", "registers RCC CFGR", "registers RCC NO", "registers NVIC", "snapshot",
    "snapshot b", "wait 1ms", "time", "restore", "time", "restore c", "wait", "wait 3", "reset", "fault", "blocks",
    "warnings", "tea", "registers TIM9", "pin", "pin PA4 2", "pin PA4 1 1",
)  # fmt: skip


def monitored() -> str:
    """Return what the lines of `MONITOR` are answered."""
    board = BluePill(EXAMPLES / "sensors.elf")
    session = GdbSession(Execution(LoneChip(board), lambda _: None))
    said = []
    for line in MONITOR:
        if line.isdigit():
            board.advance_to(int(line))
            said.append(f"# {board.now_ns} ns\n")
        else:
            answered = session.answer(b"qRcmd," + line.encode().hex().encode())
            assert answered is not None
            said.append(f"(gdb) monitor {line}\n{bytes.fromhex(answered.decode()).decode()}")
    return "".join(said)


def variables() -> str:
    """Return the numbers of three programs, and those that are offered for some beginnings."""
    said = []
    for program in (EXAMPLES / "dodge.elf", PARTS, PARTS.with_name("unoptimised.elf")):
        table = read_variables(load_image(program))
        for name in table.offered("", 2000):
            if re.search(r"\[([3-9]|\d\d+)\]", name) is None:
                one = table.variable(name)
                said.append(f"{one.address:#x} {one.size} {one.encoding.name} {one.first_bit} {one.bits} {name}: "
                            f"{one.type_name}")  # fmt: skip
        said += [f"{begun!r}: {', '.join(table.offered(begun, 4))}" for begun in ("main", "s", "STATE", "ring[2")]
    return "\n".join(said) + "\n"


def first_run() -> str:
    """Return what has run of a program and when first, as the page of a run shows it."""
    board = BluePill(EXAMPLES / "sensors.elf")
    listener = Coverage(board.image, read_lines(board.image), StaticCode(board.chip.memory))
    with Observation(board, [listener]):
        board.advance_to(40_000_000)
    found = program_lines(listener, Path("/nowhere"))
    return "\n".join(json.dumps(row) for part in found.values() for row in part) + "\n"  # type: ignore[attr-defined]


#: Name, and what makes it.
OTHERS = {"monitor": monitored, "variables": variables, "first-run": first_run}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_read_out_of_programs_is_what_it_was(name: str) -> None:
    assert is_as_kept(OTHERS[name]().splitlines(), name)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_answers_as_it_did(name: str, tmp_path: Path) -> None:
    assert is_as_kept(answer(VERBS[name], tmp_path).splitlines(), name)
