"""`p2os mcu debug`: GDB at an emulated BluePill."""

from typing import Annotated

import typer

from bluepill_sim.board import BluePill
from bluepill_sim.cli.console import connect, open_console
from bluepill_sim.cli.driving import print_status, summary, warn_on_stderr
from bluepill_sim.cli.gdb_server import GdbServer
from bluepill_sim.cli.quantities import Firmware, option
from bluepill_sim.debug.machine import LoneChip
from simbase.command_line.gdb_option import GDB_PORT
from simbase.units import PORT

HELP = """Serve a firmware to GDB: run, stop, inspect and rewind it.

It offers unlimited breakpoints and watchpoints, single steps, reverse-step,
reverse-continue, semihosting, and all registers and memories; `monitor help`
lists further commands. Virtual time stands still at a halt.

\b
Examples:
  {program} debug mine.elf                  then: gdb-multiarch mine.elf -ex "target remote :3333"
  {program} debug mine.elf --fast           virtual time as fast as it can
  {program} debug mine.elf --uart log.txt   its USART1 output goes to a file
"""


def debug(
    firmware: Firmware,
    port: Annotated[
        int,
        option(
            PORT,
            "--port",
            purpose="TCP port on this machine; 0 takes a free one.",
            shown=str(GDB_PORT),
            least="0",
            most="65535",
        ),
    ] = GDB_PORT,
    uart: Annotated[str, typer.Option(help="Where USART1 goes: - (stdout), or a file.", metavar="WHERE")] = "-",
    fast: Annotated[bool, typer.Option("--fast", help="Do not hold virtual time back to the clock.")] = False,
    once: Annotated[bool, typer.Option("--once", help="End when GDB leaves, however it does.")] = False,
) -> None:
    """Debug a firmware."""
    board = BluePill(firmware)
    warn_on_stderr(board)
    server = GdbServer(LoneChip(board), port, is_paced=not fast)
    console = open_console(uart)
    connect(console, board.usart1)
    print_status(f"waiting for GDB on port {server.port}: gdb-multiarch {firmware} -ex 'target remote :{server.port}'")
    try:
        server.serve(once=once)
    finally:
        server.close()
        console.close()
        print_status(summary(board))
