"""Build sound variants of the example programs: what a campaign finds in them is a false alarm.

    python tools/bench/campaigns/faults/sound.py FOLDER       dodge-shipped.elf, dodge-refactored.elf, …

Each program in four forms: as it ships; with its decisions written anew (`sound/`); with other constants, each within
what its comment and its README promise; and by another optimisation level. `search.py FOLDER NAME…` beside it runs the
campaigns. Needs arm-none-eabi-gcc.
"""

import argparse
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robot_bench.firmware.build import HERE, PROGRAMS, build_elf

SOUND = Path(__file__).with_name("sound")


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundVariant:
    """How a variant differs from the program."""

    #: Of `SOUND`, in place of the sources of that name.
    files: Sequence[str] = ()
    #: Source → lines of it, and what stands in their place.
    edits: Mapping[str, Mapping[str, str]] | None = None
    flags: Sequence[str] = ()


VARIANTS: Mapping[str, Mapping[str, SoundVariant]] = {
    "dodge": {
        "shipped": SoundVariant(),
        "refactored": SoundVariant(files=("dodge_fsm.c",)),
        "constants": SoundVariant(edits={"dodge_fsm.c": {
            "#define RELEASE_TICKS 25": "#define RELEASE_TICKS 22",
            "#define SOON_WAY 12": "#define SOON_WAY 13",
            "#define LONG_TWIST 14": "#define LONG_TWIST 15",
            "#define BOLD_EVERY 2": "#define BOLD_EVERY 3",
            "#define CONTRARY_EVERY 7": "#define CONTRARY_EVERY 9",
            "#define NARROW_WAY 4": "#define NARROW_WAY 5",
            "#define BACK_LEAST_WAY 6": "#define BACK_LEAST_WAY 5",
            "#define BACK_MOST_WAY 10": "#define BACK_MOST_WAY 9",
            "#define STATE_MOST_TICKS 1200": "#define STATE_MOST_TICKS 1150",
            "#define STRAIGHT_TICKS 60": "#define STRAIGHT_TICKS 70",
        }}),
        "optimised": SoundVariant(flags=("-O2",)),
    },
    "rover": {
        "shipped": SoundVariant(),
        "refactored": SoundVariant(files=("rover.c",)),
        "constants": SoundVariant(edits={"rover.c": {
            "#define TURN (EDGES_PER_M * 15 / 100)": "#define TURN (EDGES_PER_M * 14 / 100)",
            "#define RAMP 5": "#define RAMP 6",
            "#define CREEP 40": "#define CREEP 30",
            "#define FRICTION_MV 280": "#define FRICTION_MV 260",
            "#define BEHIND_MV 32": "#define BEHIND_MV 28",
            "#define NEAR_MV 1300u": "#define NEAR_MV 1320u",
            "#define CLEAR_MV 1100u": "#define CLEAR_MV 1080u",
            "#define READY_TICKS 100u": "#define READY_TICKS 120u",
        }}),
        "optimised": SoundVariant(flags=("-O2",)),
    },
}  # fmt: skip


def build(program: str, variant: SoundVariant, output: Path) -> None:
    """Build a variant of a program.

    Raises:
        ValueError: A line that it changes does not stand once in its source.
        subprocess.CalledProcessError: The compiler refused.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve() / "sources"
        shutil.copytree(HERE, folder)
        for name in variant.files:
            shutil.copy(SOUND / name, folder / name)
        for name, edits in (variant.edits or {}).items():
            text = (folder / name).read_text(encoding="utf-8")
            for before, after in edits.items():
                if text.count(before) != 1:
                    raise ValueError(f"{before!r} does not stand once in {name}")
                text = text.replace(before, after)
            (folder / name).write_text(text, encoding="utf-8")
        build_elf(
            PROGRAMS[program], folder=folder, linker_script="f103c8.ld", output=output.resolve(),
            more_flags=tuple(variant.flags),
        )  # fmt: skip


def main() -> int:
    """Build all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for program, variants in VARIANTS.items():
        for name, variant in variants.items():
            build(program, variant, folder / f"{program}-{name}.elf")
            print(f"{program}-{name}.elf")
    return 0


if __name__ == "__main__":
    sys.exit(main())
