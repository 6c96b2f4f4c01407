"""The examples of the documentation run, as they stand there.

Every fenced block of `python` is executed and every line `$ p2os …` or `$ make -C …`
of a `console` block must end with exit code 0, all blocks of one page in one folder.
A block that cannot run here says why in the line before it:
`<!-- not run: the reason -->`.
"""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from robot_bench.firmware.build import COMPILER

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(?P<before>[^\n]*)\n```(?P<language>python|console)\n(?P<text>.*?)```", re.DOTALL)
LIMIT_S = 240


def pages() -> list[Path]:
    """Return the README and every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands(page: Path) -> list[list[str]]:
    """Return the argument lists that a page's blocks amount to."""
    found = []
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block["before"].startswith("<!-- not run:"):
            continue
        if block["language"] == "python":
            found.append([sys.executable, "-c", block["text"]])
        else:
            lines = [line[2:] for line in block["text"].splitlines() if line.startswith("$ ")]
            programs = {"p2os": str(Path(sys.executable).parent / "p2os"), "make": "make"}
            found += [
                [programs[line.split()[0]], *shlex.split(line)[1:]]
                for line in lines
                if line.startswith(("p2os ", "make -C "))
            ]
    return found


@pytest.mark.parametrize("page", [page for page in pages() if commands(page)], ids=lambda page: page.name)
def test_the_examples_of_a_page_run(page: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "NO_COLOR": "1", "TERM": "dumb"}
    if any(command[0] == "make" for command in commands(page)) and shutil.which(COMPILER) is None:
        pytest.skip("no cross compiler")
    for command in commands(page):
        done = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT_S, env=environment, check=False
        )
        assert done.returncode == 0, f"{page.name}: {command}\n{done.stdout}\n{done.stderr}"


def test_links_between_pages_lead_somewhere() -> None:
    for page in pages():
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} points to {target}"


def test_the_api_reference_is_up_to_date() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "generate_api.py"), "--check"],
        capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_ranges_in_the_pages_are_those_that_the_readers_check_by() -> None:
    generator = runpy.run_path(str(ROOT / "tools" / "generate_ranges.py"))
    texts = [path.read_text(encoding="utf-8") for path in generator["PAGES"]]
    assert sorted(re.findall(r"<!-- ranges: ([a-z ]+) -->", "".join(texts))) == sorted(generator["tables"]())
    assert [generator["page"](text) for text in texts] == texts, "run tools/generate_ranges.py"
