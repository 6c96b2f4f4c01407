"""`p2os board test`: the self-test of an adapter board, at two serial ports or emulated."""

import json
import time
from typing import Annotated, Self

import typer

from adapter_sim.pinout import Pinout, load_pinout
from p2os.cli.groups import BENCH
from p2os.transport import Transport, open_url
from p2os.transport.waiting import wait_for_bytes
from robot_bench.wires.board_test.circuit import EN, BoardFault, Side, WireFault
from robot_bench.wires.board_test.ends import AdapterEnd, BluePillEnd
from robot_bench.wires.board_test.verdicts import BoardVerdict, VerdictRow, judge
from robot_bench.wires.board_test.walk import BoardWalk
from simbase.errors import UsageError, nearest

BLUEPILL_BAUD, ADAPTER_BAUD = 57_600, 115_200
#: chosen: many times what an answer takes, on a busy machine too; a module in reset costs it.
ANSWER_S = 1.0

GROUP_HELP = """Test an adapter board.

\b
Examples:
  p2os board test --emulated    every wire of a simulated board
"""
HELP = """Test an adapter board: every wire, end to end.

The BluePill runs board_test.elf, the ESP32 the adapter's firmware; this verb
drives both consoles. Disconnect the robot first: the wires are toggled.

--emulated tests a simulated board, also with faults: open:DD3, unsoldered:DD3,
gnd:DD3, 3v3:DD3, short:DD3,DD4, swapped:DD3,DD4; append @esp32 for a fault at
the ESP32's end.

\b
Examples:
  p2os board test --emulated                  a simulated board without faults
  p2os board test --emulated --fault open:DD3  DD3 is named, exit code 1
  p2os board test --adapter serial:/dev/ttyUSB0 --bluepill serial:/dev/ttyUSB1
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    board = typer.Typer(help=GROUP_HELP)
    board.command("test", help=HELP)(walk_through)
    app.add_typer(board, name="board", rich_help_panel=BENCH)


def walk_through(
    adapter: Annotated[str | None, typer.Option(help="The ESP32's console.", metavar="URL")] = None,
    bluepill: Annotated[str | None, typer.Option(help="The BluePill's USART1, PA9 and PA10.", metavar="URL")] = None,
    emulated: Annotated[bool, typer.Option("--emulated", help="Test a board without electronics.")] = False,
    fault: Annotated[list[str] | None, typer.Option(help="A fault of it, such as open:DD3.", metavar="FAULT")] = None,
    revision: Annotated[str, typer.Option(help="The board's revision.", metavar="NAME")] = "rev-b",
    json_output: Annotated[bool, typer.Option("--json", help="Print the table as JSON.")] = False,
) -> None:
    """Walk through a board and print what was found."""
    pinout = load_pinout()
    if revision not in {known.name for known in pinout.revisions}:
        raise UsageError(
            f"there is no revision {revision!r}", hint=nearest(revision, [row.name for row in pinout.revisions])
        )
    if emulated:
        if adapter or bluepill:
            raise UsageError("--emulated needs no ports", hint="p2os board test --emulated")
        findings = _emulated(pinout, revision, fault or [])
    elif fault:
        raise UsageError("--fault plants faults in an emulated board only", hint="add --emulated")
    elif adapter and bluepill:
        findings = _at_ports(adapter, bluepill, pinout, revision)
    else:
        raise UsageError(
            "which ports are the board's consoles?", hint="--adapter URL --bluepill URL (p2os ports), or --emulated"
        )
    _print(findings, as_json=json_output)
    if any(finding.is_fault for finding in findings):
        raise typer.Exit(1)


def fault_of(text: str, pinout: Pinout) -> BoardFault:
    """Return the fault that a word such as "short:DD1,DD2@esp32" names.

    Raises:
        UsageError: It names none.
    """
    kinds = ", ".join(kind.value for kind in WireFault)
    kind_word, _, rest = text.partition(":")
    wires, _, side_word = rest.partition("@")
    if kind_word not in {kind.value for kind in WireFault}:
        raise UsageError(f"{text!r} is no fault", hint=f"KIND:WIRE, KIND one of {kinds}")
    kind, names = WireFault(kind_word), wires.split(",")
    needed = 2 if kind in {WireFault.SHORT, WireFault.SWAPPED} else 1
    if len(names) != needed:
        raise UsageError(f"{text!r}: {kind.value} takes {needed} wire{'s' if needed == 2 else ''}", hint="open:DD3")
    if side_word not in {"", *(side.value for side in Side)}:
        raise UsageError(f"{text!r}: there is no side {side_word!r}", hint="@bluepill or @esp32")
    known = {wire.name for wire in pinout.wires} | ({EN[0]} if kind is WireFault.SHORT else set())
    for name in names:
        if name not in known:
            raise UsageError(f"{text!r}: there is no wire {name!r}", hint=nearest(name, known))
    if names[0] == EN[0] or len(set(names)) != needed:
        raise UsageError(f"{text!r}: a wire and another one", hint="short:DD1,DD2")
    return BoardFault(kind, names[0], names[1] if needed == 2 else "", Side(side_word or Side.BLUEPILL.value))


def _emulated(pinout: Pinout, revision: str, faults: list[str]) -> list[VerdictRow]:
    planted = tuple(fault_of(text, pinout) for text in faults)
    from robot_bench.wires.board_test.emulated import EmulatedBoard
    from robot_bench.wires.board_test.esp32 import PARTS

    if revision not in PARTS:
        raise UsageError(f"there is no program for {revision}", hint=f"--revision {' or '.join(PARTS)}")

    board = EmulatedBoard(planted, revision=revision)
    return judge(BoardWalk(board.bluepill_end, board.adapter_end, pinout).measure(), pinout, revision)


def _at_ports(adapter: str, bluepill: str, pinout: Pinout, revision: str) -> list[VerdictRow]:
    with _PortLine(adapter, ADAPTER_BAUD) as one, _PortLine(bluepill, BLUEPILL_BAUD) as other:
        walk = BoardWalk(BluePillEnd(other), AdapterEnd(one, pinout), pinout)
        return judge(walk.measure(), pinout, revision)


class _PortLine:
    """A console at a port, in real time."""

    def __init__(self, url: str, baud: int) -> None:
        self._line: Transport = open_url(url)
        self._line.set_baud(baud)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._line.close()

    def ask(self, line: str, prefix: str) -> str | None:
        """Send a line and wait for its answer; see `ends.ConsoleLine`."""
        while self._line.read():
            pass
        self._line.write(f"{line}\n".encode())
        said, ends_s = b"", time.monotonic() + ANSWER_S
        while (left_s := ends_s - time.monotonic()) > 0:
            wait_for_bytes(self._line, left_s)
            *lines, said = (said + self._line.read()).split(b"\n")
            for answer in lines:
                if answer.decode("ascii", "replace").startswith(prefix):
                    return answer.decode("ascii", "replace").strip()
        return None


def _print(findings: list[VerdictRow], *, as_json: bool) -> None:
    if as_json:
        rows = [
            {"name": row.name, "path": row.path, "verdict": row.verdict.value, "detail": row.detail, "with": row.others}
            for row in findings
        ]
        typer.echo(json.dumps(rows))
        return
    for row in findings:
        typer.echo(f"{row.name:13}{row.path:17}{row.verdict.value:14}{row.detail}".rstrip())
    faults = sum(row.is_fault for row in findings)
    untested = sum(row.verdict is BoardVerdict.UNKNOWN for row in findings)
    reported = "no fault" if not faults else "1 fault" if faults == 1 else f"{faults} faults"
    typer.echo(f"{reported} in {len(findings)} rows, {untested} not tested")
