"""Programs of this folder, built once."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bluepill_sim import BluePill
from tests.tools.examples import build

HERE = Path(__file__).resolve().parent
#: Of board.c the clock.
RUNTIME = ("startup.c", "memory.c", "board.c")


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Build a program of `firmware` and return its ELF."""
    if shutil.which(build.COMPILER) is None:
        pytest.skip(f"{build.COMPILER} is not installed")
    folder = tmp_path_factory.mktemp("buses")
    flags = (f"-I{build.HERE}",)

    def built(name: str) -> Path:
        elf = folder / f"{name}.elf"
        if not elf.exists():
            sources = (*RUNTIME, str(HERE / "firmware" / f"{name}.c"))
            build.build_elf(sources, folder=build.HERE, linker_script="f103c8.ld", output=elf, more_flags=flags)
        return elf

    return built


@pytest.fixture(params=["native", "python"])
def board_of(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, program: Callable[[str], Path], watchdog: None
) -> Iterator[Callable[[str], BluePill]]:
    """Make a board with a program, on each of the cores."""
    monkeypatch.setenv("P2OS_CORE", request.param)
    return lambda name: BluePill(program(name))
