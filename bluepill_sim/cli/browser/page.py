"""`p2os mcu page`: a page that runs a firmware in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.cli.browser.document import page_of
from simbase.files import write_text

HELP = """Write a page that runs a firmware in a browser.

One HTML file with the emulator in it, as WebAssembly: it opens from the disk, without a server or a network. The chip
alone: console, pins and speed; what this page does not have is named there. Without FIRMWARE, a file is chosen in the
page.

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
