"""What the walks have shown: a checksum of each episode's trace, which a test holds the models to.

    python -m tests.bluepill_sim.peripherals.walks.approved                 names the episodes that are otherwise
    python -m tests.bluepill_sim.peripherals.walks.approved --write FOLDER  writes every trace, a file a walk
    python -m tests.bluepill_sim.peripherals.walks.approved --approve       takes what they show now for right

A change of a model that is meant changes traces too. Write them before it and behind it, read the difference
(`diff -u`), and approve it together with the change: `approved.json` beside this file.
"""

import argparse
import json
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from tests.bluepill_sim.peripherals.walks.buses import BUSES
from tests.bluepill_sim.peripherals.walks.system import SYSTEM
from tests.bluepill_sim.peripherals.walks.timers import TIMERS
from tests.bluepill_sim.peripherals.walks.walker import RegisterWalk, RegisterWalker

WALKS: tuple[RegisterWalk, ...] = (*BUSES, *TIMERS, *SYSTEM)
APPROVED = Path(__file__).with_name("approved.json")
COMMAND = "python -m tests.bluepill_sim.peripherals.walks.approved"


def checksum(lines: Sequence[str]) -> str:
    """Return what stands for a trace."""
    return f"{zlib.crc32(chr(10).join(lines).encode()):08x}"


def approved(file: Path = APPROVED) -> Mapping[str, Sequence[str]]:
    """Return the checksums of each walk's episodes."""
    found: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
    return {name: text.split() for name, text in found.items()}


def judge_of(*names: str) -> Callable[..., None]:
    """Return the test of some walks: each does to the nanosecond what it did when it was approved."""

    @pytest.mark.parametrize("walk", [walk for walk in WALKS if walk.name in names], ids=lambda walk: walk.name)
    def judged(walk: RegisterWalk, watchdog: None) -> None:
        right = approved()[walk.name]
        assert len(right) == walk.episodes
        for number, before in enumerate(right):
            lines = RegisterWalker(walk, number).go()
            if checksum(lines) != before:
                pytest.fail(_difference(walk, number, lines), pytrace=False)

    return judged


def _difference(walk: RegisterWalk, number: int, lines: Sequence[str]) -> str:
    shown = "\n".join(f"  {n:2} {line}" for n, line in enumerate(lines))
    return (
        f"{walk.name}, episode {number}, is otherwise than approved; now it is\n{shown}\n"
        f"(hint: `{COMMAND} {walk.name} --write FOLDER` at both commits, `diff -u`; --approve if it is right)"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, write or approve; return the exit code: 1 where an episode is otherwise."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Traces of the peripherals' walks.")
    parser.add_argument("walks", nargs="*", metavar="WALK", help="only these")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the traces there")
    parser.add_argument("--approve", action="store_true", help="take them for right")
    chosen = parser.parse_args(arguments)
    known = {**approved()} if APPROVED.exists() else {}
    others = []
    for walk in WALKS:
        if chosen.walks and walk.name not in chosen.walks:
            continue
        traces = [RegisterWalker(walk, n).go() for n in range(walk.episodes)]
        now = [checksum(trace) for trace in traces]
        before = known.get(walk.name, ())
        others += [f"{walk.name} {n}" for n, one in enumerate(now) if n >= len(before) or before[n] != one]
        known[walk.name] = now
        if chosen.write:
            chosen.write.mkdir(parents=True, exist_ok=True)
            text = "".join(f"episode {n}\n" + "".join(f"{line}\n" for line in one) for n, one in enumerate(traces))
            (chosen.write / f"{walk.name}.txt").write_text(text, encoding="utf-8")
    if chosen.approve:
        rows = {walk.name: " ".join(known[walk.name]) for walk in WALKS if walk.name in known}
        APPROVED.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        return 0
    if others:
        sys.stdout.write(f"otherwise than approved: {', '.join(others)}\n")
    return int(bool(others))


if __name__ == "__main__":
    sys.exit(main())
