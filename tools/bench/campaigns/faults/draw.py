"""Draw twenty faults, ten in each of two example programs, which nobody has chosen, and build them.

    python tools/bench/campaigns/faults/draw.py [--seed 41]        print what is drawn; --check: as in drawn/41.json?
    python tools/bench/campaigns/faults/draw.py --build FOLDER     an ELF of each, by that file alone: dodge-01.elf, …

A kind is drawn by its share in the field (`kinds.py` names the source), then a place of that kind evenly among all
sources that make the program. A draw that does not build is replaced by the next one, and so is one that an earlier
seed has drawn, and one that is equivalent: one whose machine code is that of the program itself (M. Papadakis et al.,
"Trivial Compiler Equivalence", ICSE 2015), or that `EQUIVALENT` names with the reason. All draws of a seed stand in
its file, in their order, those that were replaced with the reason.

Needs arm-none-eabi-gcc, and to draw tree-sitter and tree-sitter-c (`pip install tree-sitter tree-sitter-c`).
"""

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from bluepill_sim.program.image import load_image
from robot_bench.firmware.build import HERE, PROGRAMS, build_elf

#: In the order in which they were drawn.
SEEDS = (40, 41, 42, 43, 44)
#: Of each program.
COUNT = 10
DRAWN = ("dodge", "rover")
FOLDER = Path(__file__).with_name("drawn")
#: Draws that were read and change nothing that the program does on its pins, on no input: `name:line:kind:text` → why.
EQUIVALENT: Mapping[str, str] = {
    **dict.fromkeys(
        ("pins.c:66:MFC:;", "pins.c:67:MFC:;", "pins.c:68:MFC:;"),
        "these pins are floating inputs after a reset already (RM0008, 9.2.1)",
    ),
    "startup.c:35:MVI:": "there is no initialised data, so nothing is read from there",
    "startup.c:36:WLEC:>": "there is no initialised data, so nothing is copied either way",
    "rover_board.c:95:MVAV:;": "each tick starts a conversion too, and none is read in the first 100",
    **dict.fromkeys(
        ("odometer.c:18:MIA:", "odometer.c:18:MIFS:;"), "it changes `moved` alone, which dodge never reads"
    ),
    **dict.fromkeys(
        ("motors_bits.c:13:MIFS:;", "motors_bits.c:14:MVAV:;"), "dodge asks for -2 to 3, and never for less than -4"
    ),
    "motors_bits.c:29:MFC:;": "the outputs' register is 0 after a reset already (RM0008, 9.2.4)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFault:
    """A draw."""

    program: str
    kind: str
    file: str
    line: int
    #: Bytes of the file from here, so many of them, are replaced.
    start: int
    right: str
    wrong: str
    #: Why the next draw took its place; empty: it stays.
    replaced: str = ""

    @property
    def key(self) -> str:
        """What `EQUIVALENT` calls it."""
        return f"{self.file}:{self.line}:{self.kind}:{self.wrong}"


def build(fault: DrawnFault, output: Path) -> bool:
    """Build a program with a fault; return whether it builds, warnings not counted.

    Raises:
        ValueError: The source does not say what it said when the fault was drawn.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve() / "sources"
        shutil.copytree(HERE, folder)
        path = folder / fault.file
        source, right = path.read_bytes(), fault.right.encode()
        if source[fault.start : fault.start + len(right)] != right:
            raise ValueError(f"{fault.file}:{fault.line} does not say {fault.right!r} any more")
        path.write_bytes(source[: fault.start] + fault.wrong.encode() + source[fault.start + len(right) :])
        try:
            build_elf(
                PROGRAMS[fault.program], folder=folder, linker_script="f103c8.ld", output=output.resolve(),
                more_flags=("-Wno-error", "-w"),
            )  # fmt: skip
        except subprocess.CalledProcessError:
            return False
    return True


def draw(program: str, seed: int) -> Iterator[DrawnFault]:
    """Yield every draw of a program, until `COUNT` of them stay."""
    from kinds import KINDS, places

    source = random.Random(f"{seed} {program}")
    known = {fault.key for earlier in SEEDS[: SEEDS.index(seed)] for fault in _read(earlier)}
    texts = {name: (HERE / name).read_bytes() for name in PROGRAMS[program]}
    left = {
        name: [(file, place) for file, text in texts.items() for place in places(text, kind)]
        for name, kind in KINDS.items()
    }
    stays = 0
    with tempfile.TemporaryDirectory() as scratch:
        output = Path(scratch) / "drawn.elf"
        sound = _code(HERE / f"{program}.elf")
        while stays < COUNT:
            names = [name for name in KINDS if left[name]]
            kind = source.choices(names, [KINDS[name].percent for name in names])[0]
            file, place = left[kind].pop(source.randrange(len(left[kind])))
            text = texts[file]
            found = DrawnFault(
                program=program, kind=kind, file=file, line=text.count(b"\n", 0, place.start) + 1, start=place.start,
                right=text[place.start : place.end].decode(), wrong=place.text.decode(),
            )  # fmt: skip
            why = (
                "drawn before" if found.key in known
                else "does not build" if not build(found, output)
                else "equivalent: the same machine code" if _code(output) == sound
                else f"equivalent: {EQUIVALENT[found.key]}" if found.key in EQUIVALENT else ""
            )  # fmt: skip
            stays += not why
            yield DrawnFault(**{**asdict(found), "replaced": why})


def _code(path: Path) -> object:
    """Return what a program puts into memory."""
    return load_image(path).segments


def kept(seed: int) -> list[DrawnFault]:
    """Return the draws of a seed that stay."""
    return [fault for fault in _read(seed) if not fault.replaced]


def _file(seed: int) -> Path:
    return FOLDER / f"{seed}.json"


def _read(seed: int) -> list[DrawnFault]:
    return [DrawnFault(**row) for row in json.loads(_file(seed).read_text(encoding="utf-8"))]


def main() -> int:
    """Draw, compare or build."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seed", type=int, choices=SEEDS, default=SEEDS[-1])
    parser.add_argument("--check", action="store_true", help="whether the seed's file is what is drawn")
    parser.add_argument("--write", action="store_true", help="write the seed's file")
    parser.add_argument("--build", type=Path, metavar="FOLDER", help="build what the seed's file holds")
    asked = parser.parse_args()
    if asked.build is not None:
        asked.build.mkdir(parents=True, exist_ok=True)
        for program in DRAWN:
            faults = [fault for fault in kept(asked.seed) if fault.program == program]
            for number, fault in enumerate(faults, 1):
                name = f"{program}-{number:02d}.elf"
                build(fault, asked.build / name)
                print(f"{name}: {_said(fault)}")
        return 0
    found = [fault for program in DRAWN for fault in draw(program, asked.seed)]
    if asked.check:
        return 0 if found == _read(asked.seed) else 1
    if asked.write:
        FOLDER.mkdir(exist_ok=True)
        text = json.dumps([asdict(fault) for fault in found], indent=1)
        _file(asked.seed).write_text(text + "\n", encoding="utf-8")
    for fault in found:
        print(f"{fault.program}  {_said(fault)}" + (f"  [{fault.replaced}]" if fault.replaced else ""))
    return 0


def _said(fault: DrawnFault) -> str:
    right, wrong = (" ".join(text.split()) for text in (fault.right, fault.wrong))
    return f"{fault.file}:{fault.line} {fault.kind} {right!r} -> {wrong!r}"


if __name__ == "__main__":
    sys.exit(main())
