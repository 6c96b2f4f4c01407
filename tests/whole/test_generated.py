"""`make generated`: one command for every file that is made of a declaration, wherever it is run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_one_command_runs_every_generator_and_ends_at_the_first_that_fails(tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path / "Makefile")
    folder, bin_folder = tmp_path / "tools" / "generators", tmp_path / "bin"
    folder.mkdir(parents=True)
    bin_folder.mkdir()
    (bin_folder / "python").symlink_to(sys.executable)
    for name in ("a", "b", "c", "../other"):
        (folder / f"{name}.py").write_text(f"print('{name}')")
    words = ["make", "-s", "-o", "setup", f"BIN={bin_folder}", "generated"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout.split()) == (0, ["a", "b", "c"]), done.stderr
    (folder / "b.py").write_text("raise SystemExit(3)")
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode != 0
    assert done.stdout.split() == ["a"]
