"""Run a target of `tools/fuzz_protocol.py` guided by coverage, until it is told to stop. Needs `pip install atheris`.

Usage: python tools/fuzz_atheris.py TARGET [libFuzzer options, such as -max_total_time=600 or -runs=100000]
"""

import runpy
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["p2os"]):
    FUZZ = runpy.run_path(str(Path(__file__).with_name("fuzz_protocol.py")))


def main() -> None:
    """Fuzz from the target's seeds in a folder of their own."""
    if len(sys.argv) < 2 or sys.argv[1] not in FUZZ["TARGETS"]:
        sys.exit(f"usage: {sys.argv[0]} {'|'.join(FUZZ['TARGETS'])} [libFuzzer options]")
    target, options = sys.argv[1], sys.argv[2:]
    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate(FUZZ["seeds"](target)):
            (Path(folder) / f"{number:04d}").write_bytes(seed)
        atheris.Setup([sys.argv[0], *options, "-timeout=20", "-rss_limit_mb=1500", folder], FUZZ["TARGETS"][target])
        atheris.Fuzz()


if __name__ == "__main__":
    main()
