"""Pictures of the tutorials: the page of a run, and of the recording that it holds, as `p2os render` draws them."""

import contextlib
import os
import tempfile
from pathlib import Path

#: The run that all of them show, and how much of its page, in pixels.
RUN = ("run", "dodge", "--body", "kinematic", "--duration", "20s")
SIZE = ("--size", "1200x760")
#: The name of each picture; what of the run's folder it shows; how.
SHOWN = {
    "student": ("", ("--layout", "student", "--at", "15s")),
    "engineer": ("", ("--layout", "firmware", "--at", "12s")),
    "lab": ("wire.jsonl", ("--layout", "student", "--at", "17s")),
}


def draw(folder: Path) -> None:
    """Draw every picture of the tutorials into a folder.

    Raises:
        SystemExit: a command failed, or there is no Chromium.
    """
    from p2os.cli.main import run

    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, Path(os.devnull).open("w") as null, contextlib.redirect_stdout(null):
        target = Path(scratch) / "dodge"
        failed = run([*RUN, "--out", str(target)])
        for name, (part, shown) in SHOWN.items():
            failed = failed or run(["render", str(target / part), "-o", str(folder / f"{name}.png"), *SIZE, *shown])
    if failed:
        raise SystemExit("pictures: the tutorials' were not drawn (hint: apt-get install chromium)")
