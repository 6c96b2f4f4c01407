"""Makes the pictures of docs/pictures, and tells which are older than what they show.

Usage: python -m tools.pictures [--check] [--all] [--folder DIR]

Each picture carries a hash of its inputs (scenario and firmware, the board's files,
and the code that draws) as a PNG text chunk, or a comment of a GIF. Without options the pictures whose inputs have
changed are made anew. `--check` makes none, names them, and ends with 1 where there are any.

Not an input: how chip and robot are simulated. The demo's path is one that the bench drove.
The film of the demonstration needs Chromium and Pillow; pictures of the board need KiCad 9,
pdftoppm, and ngspice (tools/install_board_tools.sh).
"""

import argparse
import contextlib
import hashlib
import os
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hardware.case.picture import draw
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.outputs import generated_files, pictures
from hardware.pcb.spice.decks import decks
from tools.pictures.tutorials import SHOWN

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
#: The text chunk's keyword.
KEYWORD = b"inputs"
SIGNATURE = b"\x89PNG\r\n\x1a\n"
#: Of a GIF: how it begins, and how a comment does; a stamp is the keyword, a 0, and 64 digits (GIF89a, 24).
GIF, COMMENT = b"GIF89a", b"\x21\xfe"
STAMP_BYTES = len(KEYWORD) + 1 + 64
WORLDS = "p2os/pioneer/world/worlds"
PLAN = "tools/page/src/views/plan/*.ts*"
#: How the demonstration is filmed: 120 s in 7.5 s.
FILM = ("--view", "plan", "--size", "560x460", "--speed", "16", "--fps", "8")
BOARD = "hardware/pcb/outputs/pictures.py"


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Pictures that are made in one go, from the same inputs."""

    #: Files below docs/pictures.
    names: tuple[str, ...]
    #: Patterns of files below the checkout; each matches at least one.
    files: tuple[str, ...]
    make: Callable[[], object]
    #: What decides besides files.
    text: str = ""

    def inputs(self) -> str:
        """Return the hash of the inputs, in hexadecimal."""
        digest = hashlib.sha256(self.text.encode())
        for pattern in self.files:
            found = sorted(ROOT.glob(pattern))
            if not found:
                raise SystemExit(f"pictures: no file matches {pattern}")
            for path in found:
                digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
        return digest.hexdigest()


def groups() -> Iterator[Group]:
    """Yield all that docs/pictures holds."""
    files = ("robot_bench/scenarios/dodge.toml", f"{WORLDS}/room.toml", "robot_bench/firmware/dodge.elf", PLAN)
    yield Group(names=("demo.gif",), files=files, make=make_demo, text=" ".join(FILM))
    files = (*files, "tools/pictures/tutorials.py")
    yield Group(names=tuple(f"tutorials/{name}.png" for name in SHOWN), files=files, make=make_tutorials)
    files = ("bluepill_sim/parts/*.py", "tests/bluepill_sim/firmware/parts.elf", "tools/pictures/parts.py")
    yield Group(names=("parts.png",), files=files, make=make_parts)
    yield Group(names=("silicon.png",), files=("tools/pictures/wiring.py",), make=make_wiring)
    for variant in VARIANTS:
        sides = ("top", "bottom", "view", "bare") if variant in pictures.SHOWN_WHOLE else ("top",)
        yield Group(names=tuple(f"board/{variant}-{side}.png" for side in sides),
                    files=(f"hardware/pcb/generated/{variant}/{variant}.kicad_pcb",
                           "hardware/pcb/generated/library/models/*.wrl", BOARD),
                    make=lambda variant=variant: make_board(variant))  # fmt: skip
    for variant in VARIANTS:
        yield Group(names=tuple(f"board/{variant}-{page}.png" for page in pictures.pages_shown(variant)),
                    files=(f"hardware/pcb/generated/{variant}/*.kicad_sch", BOARD),
                    make=lambda variant=variant: pictures.schematic_pictures(variant))  # fmt: skip
    yield Group(names=("board/case.png",), files=("hardware/case/generated/*.stl", "hardware/case/picture.py"),
                make=make_case)  # fmt: skip
    for deck in decks():
        yield Group(names=(f"board/sim-{deck.name}.png",), files=(BOARD,), text=repr(deck),
                    make=lambda deck=deck: make_plot(deck))  # fmt: skip


def make_demo() -> None:
    """Run the demonstration, and film it on the page without a window."""
    from p2os.cli.main import run

    with tempfile.TemporaryDirectory() as folder, Path(os.devnull).open("w") as null, contextlib.redirect_stdout(null):
        target = Path(folder) / "demo"
        if run(["run", "dodge", "--out", str(target)]):
            raise SystemExit("pictures: the demonstration failed")
        if run(["render", str(target), "-o", str(PICTURES / "demo.gif"), *FILM]):
            raise SystemExit("pictures: the demonstration was not filmed (hint: apt-get install chromium)")


def make_tutorials() -> None:
    """Draw the pages that the tutorials show."""
    from tools.pictures.tutorials import draw as draw_tutorials

    draw_tutorials(PICTURES / "tutorials")


def make_parts() -> None:
    """Draw what parts show and do."""
    from tools.pictures.parts import draw

    draw(PICTURES / "parts.png")


def make_wiring() -> None:
    """Draw an analyser at a BluePill."""
    from tools.pictures.wiring import draw as draw_wiring

    draw_wiring(PICTURES / "silicon.png")


def make_board(variant: str) -> None:
    """Render a board with its pours filled."""
    with tempfile.TemporaryDirectory() as folder:
        pictures.board_pictures(variant, generated_files.filled_project(variant, Path(folder)))


def make_case() -> None:
    """Draw the case from its STL files."""
    draw(ROOT / "hardware" / "case" / "generated", PICTURES / "board" / "case.png")


def make_plot(deck: object) -> None:
    """Simulate a circuit and plot it."""
    from hardware.pcb.spice.run import simulate

    pictures.plot(simulate(deck))


def stamp_of(picture: bytes) -> str:
    """Return the hash that a PNG or GIF carries; empty where it carries none."""
    if picture.startswith(GIF):
        _, _, behind = picture.rpartition(COMMENT + bytes([STAMP_BYTES]) + KEYWORD + b"\0")
        return behind[: STAMP_BYTES - len(KEYWORD) - 1].decode("latin-1")
    at = len(SIGNATURE)
    while at < len(picture):
        (length,) = struct.unpack_from(">I", picture, at)
        kind, data = picture[at + 4 : at + 8], picture[at + 8 : at + 8 + length]
        if kind == b"tEXt" and data.startswith(KEYWORD + b"\0"):
            return data[len(KEYWORD) + 1 :].decode("latin-1")
        at += 12 + length
    return ""


def stamped(picture: bytes, inputs: str) -> bytes:
    """Return a PNG with the hash of its inputs after its header, or a GIF with it as a comment at its end."""
    if picture.startswith(GIF):
        return picture[:-1] + COMMENT + bytes([STAMP_BYTES]) + KEYWORD + b"\0" + inputs.encode() + b"\0" + picture[-1:]
    data = b"tEXt" + KEYWORD + b"\0" + inputs.encode()
    chunk = struct.pack(">I", len(data) - 4) + data + struct.pack(">I", zlib.crc32(data))
    header = len(SIGNATURE) + 12 + 13
    return picture[:header] + chunk + picture[header:]


def main(arguments: list[str] | None = None) -> int:
    """Make or check the pictures; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="make nothing; name what is out of date")
    parser.add_argument("--all", action="store_true", help="make all of them anew")
    parser.add_argument("--folder", type=Path, default=PICTURES, help="what --check looks at")
    given = parser.parse_args(arguments)
    known = list(groups())
    if given.check:
        return check(known, given.folder)
    for group in known:
        inputs = group.inputs()
        files = [PICTURES / name for name in group.names]
        if not given.all and all(file.is_file() and stamp_of(file.read_bytes()) == inputs for file in files):
            continue
        for file in files:
            file.unlink(missing_ok=True)
        group.make()
        for file in files:
            if not file.is_file():
                print(f"pictures: {file.name} was not made (hint: tools/install_board_tools.sh)", file=sys.stderr)
                return 1
            file.write_bytes(stamped(file.read_bytes(), inputs))
            print(f"{file.relative_to(PICTURES)}: {file.stat().st_size} bytes")
    return 0


def check(known: list[Group], folder: Path) -> int:
    """Print the pictures that are out of date, missing, or made by nothing; return 1 where there are any."""
    there = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.[pg][ni][gf]")}
    said = []
    for group in known:
        inputs = group.inputs()
        for name in group.names:
            picture = there.pop(name, None)
            if picture is None:
                said.append(f"{name}: missing")
            elif stamp_of(picture) != inputs:
                said.append(f"{name}: its inputs have changed")
    said += [f"{name}: no command makes it" for name in there]
    for line in said:
        print(line)
    if said:
        print("hint: make pictures", file=sys.stderr)
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
