"""Repeat the tests that read a real clock while the machine is busy: `python -m tests.tools.suite.steady [PATH …]`.

    make steady                      twenty times, eight processes beside it that never wait
    make steady STEADY="--times 3 tests/p2os/client"

Prints after each round what has failed and why, and at the end each of them with how often; exit code 1 where one has.
None of them is left out for it.
"""

import argparse
import re
import subprocess
import sys
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BUSY = "while True: pass"
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+).*$", re.MULTILINE)


def main() -> int:
    """Run them so often; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("paths", nargs="*", default=["tests"])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--load", type=int, default=8, help="processes beside them that never wait")
    words = parser.parse_args()
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "3",
        "-m",
        "real_clock and not soak and not hardware",
        *words.paths,
    ]
    failed = Counter[str]()
    with ExitStack() as held:
        for _ in range(words.load):
            busy = held.enter_context(subprocess.Popen([sys.executable, "-c", BUSY]))
            held.callback(busy.kill)
        for number in range(1, words.times + 1):
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            found = list(FAILED.finditer(done.stdout))
            failed.update(each[1] for each in found)
            came_to = done.stdout.strip().splitlines()[-1] if done.stdout.strip() else done.stderr.strip()
            reasons = "".join(f"  {each[0]}\n" for each in found)
            sys.stdout.write(f"{number} of {words.times}: {came_to}\n{reasons}")
            sys.stdout.flush()
            if done.returncode not in (0, 1):
                return 1
    for name, count in failed.most_common():
        sys.stdout.write(f"{name}: failed {count} of {words.times}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
