"""The page that tells how to add a peripheral, done as it is printed, in a copy of the package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documentation.page import ROOT, Page

COMPILER = shutil.which("gcc")


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("core", ["native", "python"])
def test_the_device_of_the_page_works_as_it_is_printed(core: str, scratch: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_alarm.py"],
        cwd=scratch, env={**os.environ, "PYTHONPATH": str(scratch), "P2OS_CORE": core},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a copy of the package, and do there what the page says."""
    folder = tmp_path_factory.mktemp("scratch")
    for package in ("bluepill_sim", "simbase"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    c_file, python_file, rows, test = Page(ROOT / "docs" / "peripheral.md").blocks
    for block in (c_file, python_file, test):
        name = block.text.split("\n")[0].strip("/*# ").split(":")[0]
        (folder / name).write_text(block.text, encoding="utf-8")
    put_rows(folder / "bluepill_sim" / "stm32f103.py", *rows.text.splitlines())
    sources = sorted((folder / "bluepill_sim" / "extension" / "source").rglob("*.c"))
    library = folder / "bluepill_sim" / "_native.so"
    command = ["gcc", "-shared", "-fPIC", "-std=c11", "-Wall", "-Wextra", "-Werror", *map(str, sources), "-o", library]
    subprocess.run(command, check=True, timeout=100)
    return folder


def put_rows(page: Path, imported: str, peripheral: str, wire: str) -> None:
    """Put the lines where the page says."""
    text = page.read_text(encoding="utf-8")
    for line, before in (
        (imported, "from bluepill_sim.peripherals.exti "),
        (peripheral, '    (Wwdg, "WWDG"),'),
        (wire, '    "EXTI.pvd_irq"'),
    ):
        assert text.count(before) == 1
        text = text.replace(before, f"{line}\n{before}")
    page.write_text(text, encoding="utf-8")
