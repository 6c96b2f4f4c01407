"""The pictures of docs/ show what the tree holds: each carries a hash of its inputs."""

import shutil
import subprocess
import sys
from pathlib import Path

from p2os.pioneer.world import load_world
from p2os.pioneer.world.drawing import svg

ROOT = Path(__file__).parent.parent.parent
PICTURES = ROOT / "docs" / "pictures"


def check(folder: Path) -> tuple[int, str]:
    ran = subprocess.run(
        [sys.executable, "-m", "tools.pictures", "--check", "--folder", str(folder)], cwd=ROOT, text=True,
        capture_output=True, check=False, timeout=60, env={"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    return ran.returncode, ran.stdout + ran.stderr


def test_no_picture_is_older_than_what_it_shows() -> None:
    assert check(PICTURES) == (0, "")


def test_the_drawing_of_a_world_is_the_worlds() -> None:
    assert (PICTURES / "world-office.svg").read_text(encoding="utf-8") == svg(load_world("office")), (
        "p2os world show office --out docs/pictures/world-office.svg"
    )


def test_a_picture_that_is_old_or_missing_or_made_by_hand_is_named(tmp_path: Path) -> None:
    shutil.copytree(PICTURES, tmp_path, dirs_exist_ok=True)
    old, gone = tmp_path / "demo.gif", tmp_path / "board" / "sim-reset.png"
    picture = old.read_bytes()
    digit = picture.index(b"inputs\0") + len(b"inputs\0")
    old.write_bytes(picture[:digit] + (b"1" if picture[digit : digit + 1] == b"0" else b"0") + picture[digit + 1 :])
    gone.unlink()
    old.with_name("mine.gif").write_bytes(picture)
    code, said = check(tmp_path)
    assert code == 1
    assert said.splitlines() == [
        "demo.gif: its inputs have changed", "board/sim-reset.png: missing", "mine.gif: no command makes it",
        "hint: make pictures",
    ]  # fmt: skip
