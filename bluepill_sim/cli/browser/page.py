"""`p2os mcu page`: a page that runs a firmware in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.cli.browser.document import page_of
from simbase.files import write_text

HELP = """Write a page that runs a firmware in a browser.

The HTML file contains the emulator as WebAssembly and opens from disk, without
a server or network. It has the chip alone: console, pins and speed; the page
names what it does not model. Without FIRMWARE, the page asks for a file.

\b
Examples:
  {program} page                          page.html, which asks for an ELF file
  {program} page mine.elf --out mine.html   with the program in it
"""

_KIB = 1024


def page(
    firmware: Annotated[
        Path | None, typer.Argument(help="An ELF file.", metavar="FIRMWARE", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="The file that is written.", metavar="FILE")] = Path("page.html"),
) -> None:
    """Write the page."""
    text = page_of(firmware)
    write_text(out, text)
    typer.echo(f"{out}: {len(text) // _KIB} KiB; open it in a browser")
