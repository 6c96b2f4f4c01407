"""`p2os mcu run`: boots a firmware and shows what it prints."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, ClassVar, Protocol

import typer

from bluepill_sim.board import BluePill, run_until
from bluepill_sim.cli.browser.viewing import ViewedRun, view_run
from bluepill_sim.cli.can_socket import join_can
from bluepill_sim.cli.console import PTY, connect, open_console, open_traces
from bluepill_sim.cli.driving import (
    OverBudgetError,
    Schedule,
    parse_changes,
    print_fault,
    print_status,
    showing_where_it_hangs,
    summary,
    warn_on_stderr,
)
from bluepill_sim.cli.parts import attach_parts, show_parts
from bluepill_sim.cli.quantities import Firmware, option, time_option
from bluepill_sim.core.halts import ChipReached
from bluepill_sim.parts.registry import parse_part
from simbase.command_line.gdb_option import GDB_PORT, usual_port
from simbase.command_line.help_pages import Usual, VerbPage
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reason
from simbase.units import BAUD, PORT

HELP = """Run a firmware on an emulated BluePill.

USART1 goes to stdout as text; control characters appear as \\x1b and the like
unless --raw. Time is virtual: a program that sleeps runs much faster than real
time.

Exit code 1: the firmware died of a fault, or the wall clock's budget was used
up; its last blocks are shown. Resets are no failure; the last line counts them
by cause. 100 resets, each within a millisecond of the last and without a pin
change or character, end the program as failed.

\b
Examples:
  {program} run mine.elf                          one second of virtual time
  {program} run mine.elf --for 2s --uart log.txt  its output goes to a file
  {program} run mine.elf --realtime --uart pty:   a serial port for any terminal program
  {program} run mine.elf --itm log.txt            the output of ITM_SendChar, with times
  {program} run mine.elf --drive PA6=1@500ms      a level on an input
  {program} run mine.elf --drive PA0=1.65V        a voltage for the ADC
  {program} run mine.elf --until "pin PC13 low"   up to an event
  {program} run mine.elf --attach ssd1306,on=I2C1 --parts shots      an OLED, and its picture at the end
  {program} run mine.elf --attach ./mine.py:Sensor,on=I2C1,x=3       a part of your own
  {program} run mine.elf --usb pty:               plug in USB: its serial port is a terminal here
  {program} run mine.elf --can vcan0              join its CAN to SocketCAN: candump, cansend
  {program} run mine.elf --can udp:127.0.0.1:29536     the same by datagrams, without SocketCAN
  {program} run mine.elf --view              live on a page in the browser: pins, program, chip; halted and set back
  {program} run mine.elf --view --gdb        the page, and GDB at the same halt
"""

#: chosen: how often typed input reaches a running program, and its time is held back to the clock.
SLICE_NS: Nanos = 2 * NS_PER_MS
#: chosen: so often the wall clock is looked at, and how far a program runs between two looks, at first and at most.
LOOK_S = 0.05
_STRIDES_NS: tuple[Nanos, Nanos] = NS_PER_MS // 10, 20 * NS_PER_MS
#: chosen: longer than anybody waits for a run.
_BUDGET_NS: Nanos = 600 * NS_PER_S
#: Without an end: until Ctrl-C.
_FOR_EVER_NS: Nanos = 365 * 24 * 3600 * NS_PER_S


class ChipRunPage(VerbPage):
    """Lets `--gdb` stand without a port."""

    usual: ClassVar[Mapping[str, Usual]] = {"--gdb": usual_port}


PAGE = ChipRunPage


class _Opened(Protocol):
    def close(self) -> None: ...


def run(
    firmware: Firmware,
    span_ns: Annotated[
        Nanos | None, time_option("--for", purpose="How much virtual time.", shown="1s, with --realtime without end")
    ] = None,
    uart: Annotated[str, typer.Option(help="Where USART1 goes: - (stdout), pty:, or a file.", metavar="WHERE")] = "-",
    raw: Annotated[bool, typer.Option("--raw", help="To stdout every byte as it is, escape sequences too.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="At the speed of the clock, until Ctrl-C.")] = False,
    drive: Annotated[
        list[str] | None,
        typer.Option(help="Put a level or volts on a pin at a time; repeatable.", metavar="PIN=LEVEL@TIME"),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            help='End earlier: "pin PA4 high", "usart1 sends ready", "usart1 matches ^end", "fault".', metavar="EVENT"
        ),
    ] = None,
    budget_ns: Annotated[
        Nanos, time_option("--budget", purpose="Most time of the wall clock, unless --realtime.", shown="10min")
    ] = _BUDGET_NS,
    usb: Annotated[
        str | None,
        typer.Option(
            help="Plug USB in; where its serial port (CDC) goes: pty:, - (stdout), or a file.", metavar="WHERE"
        ),
    ] = None,
    can: Annotated[
        str | None,
        typer.Option(
            help="Join its CAN to one of this machine, at the clock's speed: vcan0, udp:127.0.0.1:PORT or unix:PATH.",
            metavar="BUS",
        ),
    ] = None,
    can_log: Annotated[
        Path | None,
        typer.Option("--can-log", help="Frames of --can with times, as candump -L has them.", metavar="FILE"),
    ] = None,
    usart_baud: Annotated[
        int | None,
        option(BAUD, "--usart-baud", purpose="Speed of USART1's far end; unset follows the program.", above_zero=True),
    ] = None,
    itm: Annotated[
        Path | None,
        typer.Option("--itm", help="What it writes to the ITM's ports, as text with times.", metavar="FILE"),
    ] = None,
    swo: Annotated[
        Path | None, typer.Option("--swo", help="The same as the packets that a probe receives on SWO.", metavar="FILE")
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="The first warning ends the run.")] = False,
    attach: Annotated[
        list[str] | None,
        typer.Option(help="Attach a part; repeatable. The verb `parts` lists them.", metavar="PART,KEY=VALUE,..."),
    ] = None,
    view: Annotated[
        bool, typer.Option("--view", help="Show it live on a page in the browser, at the clock's speed, until Ctrl-C.")
    ] = False,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="With --view: print its link alone.")] = False,
    gdb: Annotated[
        int | None,
        option(
            PORT,
            "--gdb",
            purpose=f"With --view: GDB may come at this TCP port, {GDB_PORT} if none is named.",
            metavar="[PORT]",
            least="0",
            most="65535",
        ),
    ] = None,
    parts_folder: Annotated[
        Path | None, typer.Option("--parts", help="Where pictures and files of parts go at the end.", metavar="FOLDER")
    ] = None,
) -> None:
    """Boot a firmware."""
    end_ns = span_ns if span_ns is not None else _FOR_EVER_NS if realtime or view else NS_PER_S
    if view:
        beside = {
            "--uart": uart != "-", "--raw": raw, "--realtime": realtime, "--drive": bool(drive), "--until": until,
            "--usb": usb, "--can": can, "--can-log": can_log, "--itm": itm, "--swo": swo, "--strict": strict,
            "--parts": parts_folder, "--budget": budget_ns != _BUDGET_NS,
        }  # fmt: skip
        _refuse_beside_view(beside)
        specs = [parse_part(one) for one in attach or []]
        view_run(
            ViewedRun(
                firmware=Path(firmware), end_ns=end_ns, usart_baud=usart_baud, parts=specs, gdb=gdb,
                is_opened=not no_browser,
            )
        )  # fmt: skip
        return
    if gdb is not None or no_browser:
        raise UsageError(f"{'--gdb' if gdb is not None else '--no-browser'} goes with --view only", hint="add --view")
    board = BluePill(firmware, strict=strict)
    board.usart1.far_baud = usart_baud
    changes = parse_changes(drive or [], board)
    traces = open_traces(board, itm, swo)
    warn_on_stderr(board)
    attach_parts(board, attach or [])
    consoles = [open_console(uart, raw=raw)]
    carriers = [connect(consoles[0], board.usart1)]
    if uart in PTY:
        print_status(f"USART1 is at {consoles[0].description}")
    if usb is not None:
        consoles.append(open_console(usb, raw=raw))
        carriers.append(connect(consoles[1], board.usb_serial))
        board.usb.plug()
        print_status(f"USB is plugged in; its serial port goes to {consoles[1].description}")
    buses = join_can(board, can, can_log)
    carriers += [bus.carry for bus in buses]
    is_paced = realtime or bool(buses) or bool(PTY & {uart, usb})
    advance = _paced(board, carriers) if is_paced else bounded(board, budget_ns)
    schedule = Schedule(board, changes, advance)
    opened: list[_Opened] = [*consoles, *traces, *buses]
    with showing_where_it_hangs(board):
        try:
            if until is None:
                schedule.run_to(end_ns)
            else:
                run_until(board, until, end_ns, schedule.advance_to)
        finally:
            with ExitStack() as closing:  # each, whatever becomes of the others
                for one in reversed(opened):
                    closing.callback(one.close)
            if uart == "-" and board.usart1.unread and not board.usart1.unread.endswith(b"\n"):
                typer.echo("")
    show_parts(board, parts_folder)
    print_status(summary(board))
    for bus in buses:
        print_status(f"can: {bus.describe()}")
    if print_fault(board):
        raise typer.Exit(1)


def _refuse_beside_view(options: Mapping[str, object]) -> None:
    """Refuse what a page has in its own way.

    Raises:
        UsageError: One of the options is given.
    """
    for name, value in options.items():
        if value:
            raise UsageError(f"{name} cannot stand beside --view", hint="the page has consoles, hands and halts")


def bounded(board: BluePill, budget_ns: Nanos) -> Callable[[Nanos], ChipReached]:
    """Return a way to advance that ends with the wall clock's budget, however a program spins.

    A program may cost a thousand times as much as another for the same virtual time, such as one that resets itself
    over and over: the stride follows what the last one cost.
    """
    stride_ns, most_ns = _STRIDES_NS
    end_ns = time.monotonic_ns() + budget_ns

    def advance(limit_ns: Nanos) -> ChipReached:
        nonlocal stride_ns
        while True:
            began_ns = time.monotonic_ns()
            reached = board.advance_to(min(limit_ns, board.now_ns + stride_ns))
            took_s = (time.monotonic_ns() - began_ns) / NS_PER_S
            stride_ns = max(1, min(most_ns, 2 * stride_ns, int(stride_ns * LOOK_S / max(took_s, 1e-6))))
            if reached.reason is not Reason.DEADLINE or reached.now >= limit_ns:
                return reached
            if time.monotonic_ns() > end_ns:
                raise OverBudgetError(
                    f"{budget_ns / NS_PER_S:g} s of wall clock are used up at "
                    f"{board.now_ns / NS_PER_S:.6f} s of virtual time",
                    hint="--budget gives more, --for asks for less",
                )

    return advance


def _paced(board: BluePill, carriers: Sequence[Callable[[], None]]) -> Callable[[Nanos], ChipReached]:
    """Return a way to advance in short slices that keep to the wall clock, with the console served between them."""
    start_ns = time.monotonic_ns() - board.now_ns

    def advance(limit_ns: Nanos) -> ChipReached:
        for carry in carriers:
            carry()
        reached = board.advance_to(min(limit_ns, board.now_ns + SLICE_NS))
        ahead_ns = start_ns + board.now_ns - time.monotonic_ns()
        if ahead_ns > 0:
            time.sleep(ahead_ns / NS_PER_S)
        return reached

    return advance
