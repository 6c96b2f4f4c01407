"""The kernel of the bench knows no program that ships: what knows one stands beside its scenario, as a user's would.

Looked at are strings, docstrings and comments. A name that is an English word too (`motors`) counts where it stands
for the program: as a file, as a scenario that is loaded, or before the colon of what the program prints.
"""

import io
import re
import tokenize
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
KERNEL = ("scenario", "report", "bench", "recording")
#: Names that are words of the field as well.
WORDS = {"motors", "sensors", "encoders", "codes", "analog"}
PLUGGED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
SHIPPED = {
    *(path.stem for pattern in ("firmware/*.elf", "firmware/*_fsm.c", "scenarios/*.toml")
      for path in (ROOT / "robot_bench").glob(pattern)),
    *PLUGGED.get("robot_bench.goals", {}),
}  # fmt: skip


def any_of(names: set[str]) -> str:
    return "|".join(sorted(map(re.escape, names), key=len, reverse=True))


NAMED = re.compile(
    rf"(?<![\w-])(?:({any_of(SHIPPED - WORDS)})(?![\w-])"  # wherever it stands
    rf"|({any_of(WORDS)})(?:\.(?:elf|toml|c|h)\b|:))"  # a file, or what the program prints
    rf"|scenario\([\"']({any_of(WORDS)})\b"  # loaded
)


def names_in(text: str) -> set[str]:
    """Return the shipped programs, scenarios and goals that a source names."""
    said = [token.string for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type in {tokenize.COMMENT, tokenize.STRING}]  # fmt: skip
    return {name for one in said for match in NAMED.finditer(one) for name in match.groups() if name}


def test_no_module_of_the_kernel_names_a_program_that_ships() -> None:
    found = {
        path.relative_to(ROOT).as_posix(): sorted(names)
        for package in KERNEL for path in (ROOT / "robot_bench" / package).rglob("*.py")
        if (names := names_in(path.read_text(encoding="utf-8")))
    }  # fmt: skip
    assert found == {}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("X = 15  # chosen: so long (dodge_fsm.c: 12 s)", "dodge_fsm"), ("hint = 'firmware = \"rover.elf\"'", "rover"),
        ('"""As `two-dodge` has it."""', "two-dodge"), ("LINE = 'encoders: done'", "encoders"),
        ("load('dodge')", "dodge"), ("'motors.elf'", "motors"),
        ("'x.from_scenario(\"motors\")'", "motors"), ('"sensor_named"', "sensor_named"),
    ],
)  # fmt: skip
def test_a_name_that_stands_in_the_kernel_is_seen(text: str, name: str) -> None:
    assert name in names_in(text + "\n")


@pytest.mark.parametrize("text", ["data['motors']", "'the sensors that should see it'", "f'{x} codes'", "dodge = 1"])
def test_a_word_that_names_no_program_is_none(text: str) -> None:
    assert names_in(text + "\n") == set()
