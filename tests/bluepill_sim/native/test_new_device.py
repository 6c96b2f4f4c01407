"""The page that tells how to add a peripheral, done as it is printed, in a copy of the package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documentation.page import ROOT, Block, Page
from tests.tools.made_once import made_once

COMPILER = shutil.which("gcc")


#: Where the page puts its test: a folder that has room for it.
TEST = "tests/bluepill_sim/peripherals/tim/test_alarm.py"
#: The tables that the page names, and what judges a device by them.
TABLES = (
    "../tools/examples.py", "../tools/svd.py", "conftest.py", "machine.py",
    "peripherals/test_reset_values.py", "peripherals/test_register_views.py", "fabric/test_descriptions.py",
)  # fmt: skip


def test_the_python_of_the_page_is_as_ruff_has_it() -> None:
    """`make test` begins with ruff: what is taken from the page passes there too."""
    python_file, _, _, _, test = Page(ROOT / "docs" / "peripheral.md").blocks
    ruff = Path(sys.executable).with_name("ruff")
    for block in (python_file, test):
        first, _, text = block.text.partition("\n")
        for words in (("format", "--diff"), ("check", "--no-cache")):
            done = subprocess.run(
                [ruff, *words, "--stdin-filename", first.strip("# "), "-"], input=text, cwd=ROOT,
                capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("core", ["native", "python"])
def test_the_device_of_the_page_works_as_it_is_printed(core: str, scratch: Path) -> None:
    assert "1 passed" in pytest_there(scratch, core, TEST)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_tables_of_the_tests_take_the_device_of_the_page(scratch: Path) -> None:
    """Each test that has a row for every device of the chip passes with this one."""
    rows = [name for name in TABLES if "/test_" in name]
    words = [f"tests/bluepill_sim/{name}" for name in rows]
    wanted = "TIM6 or no_row_is_for or committed_files or tabulates_it or spells_a_name"
    assert "7 passed" in pytest_there(scratch, "native", *words, "-k", wanted)
    assert "ALARMIE 0 rw" in (scratch / "docs" / "registers.md").read_text(encoding="utf-8")


def pytest_there(scratch: Path, core: str, *words: str) -> str:
    """Return what pytest says there of tests that pass."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", scratch, *words],
        cwd=scratch, env={**os.environ, "PYTHONPATH": str(scratch), "P2OS_CORE": core},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the package in which is done what the page says."""
    return made_once(tmp_path_factory, "new-device", make_scratch)


def make_scratch(folder: Path) -> Path:
    for package in ("bluepill_sim", "simbase"):  # compiled modules too
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("*.so"))
    python_file, header, c_file, rows, test = Page(ROOT / "docs" / "peripheral.md").blocks
    for block in (c_file, python_file, test):
        put_block(block, folder)
    put_rows(folder / "bluepill_sim" / "stm32f103.py", *rows.text.splitlines())
    for name in TABLES:
        target = folder / "tests" / "bluepill_sim" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / "tests" / "bluepill_sim" / name, target)
    (folder / "tools" / "generators").mkdir(parents=True)
    shutil.copyfile(ROOT / "tools" / "generators" / "chip.py", folder / "tools" / "generators" / "chip.py")
    generate = [sys.executable, "-m", "tools.generators.chip"]
    subprocess.run(generate, check=True, timeout=60, cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)})
    made = (folder / "bluepill_sim/extension/source/registers/alarm.h").read_text(encoding="utf-8")
    assert made == header.text, "the page shows another header"
    sources = sorted((folder / "bluepill_sim" / "extension" / "source").rglob("*.c"))
    library = folder / "bluepill_sim" / "_native.so"
    command = ["gcc", "-shared", "-fPIC", "-std=c11", "-Wall", "-Wextra", "-Werror", *map(str, sources), "-o", library]
    subprocess.run(command, check=True, timeout=100)
    return folder


def put_block(block: Block, folder: Path) -> None:
    """Write a block where its first line says."""
    path = folder / block.text.partition("\n")[0].strip("/*# ").split(":")[0]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(block.text, encoding="utf-8")


def put_rows(page: Path, imported: str, peripheral: str, wire: str) -> None:
    """Put the lines where the page says."""
    put_line(page, imported, "from bluepill_sim.peripherals.exti ")
    put_line(page, peripheral, '    (Wwdg, "WWDG"),')
    put_line(page, wire, '    "EXTI.pvd_irq"')


def put_line(page: Path, line: str, before: str) -> None:
    """Put a line before another, which stands there once; whoever has followed the page has it already."""
    text = page.read_text(encoding="utf-8")
    if line in text.splitlines():
        return
    assert text.count(before) == 1
    page.write_text(text.replace(before, f"{line}\n{before}"), encoding="utf-8")
