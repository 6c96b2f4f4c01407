"""Search for inputs that break the adapter's core: `python adapter_fw/fuzz/search.py [--seconds S] [--work DIR]`.

Needs clang with libFuzzer. The kept corpus is where it begins; what it finds new
goes to the work folder. `--keep` merges the smallest set of inputs with the same
coverage back into the kept corpus.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
FIRMWARE = HERE.parent
CORPUS = HERE / "corpus"
FLAGS = (
    "-std=c++17", "-O1", "-g", "-fno-exceptions", "-fno-rtti", "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=all",
)  # fmt: skip
#: chosen: a run of some thirty actions, and a corpus that stays a few dozen kilobytes.
LONGEST_SEARCHED, LONGEST_KEPT = 300, 80
SLOWEST_S = 20


def build(output: Path) -> None:
    """Build the fuzzer.

    Raises:
        subprocess.CalledProcessError: The compiler refused.
    """
    sources = [*sorted((FIRMWARE / "core").rglob("*.cpp")), HERE / "target.cpp", FIRMWARE / "selftest" / "robot.cpp"]
    subprocess.run(["clang++", *FLAGS, *map(str, sources), "-o", str(output)], check=True)  # noqa: S607 - from PATH


def main() -> int:
    """Search; the fuzzer's exit code is ours."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600, help="how long to search")
    parser.add_argument("--work", type=Path, default=FIRMWARE / "build" / "fuzz", help="folder of the search")
    parser.add_argument("--keep", action="store_true", help="merge what covers new ground into the kept corpus")
    words = parser.parse_args()
    if shutil.which("clang++") is None:
        print("search: clang++ is not installed\nhint: apt-get install clang", file=sys.stderr)
        return 2
    found = words.work / "corpus"
    found.mkdir(parents=True, exist_ok=True)
    fuzzer = words.work / "fuzzer"
    build(fuzzer)
    limits = [f"-timeout={SLOWEST_S}", f"-artifact_prefix={words.work}/"]
    folders = [str(found), str(CORPUS)]
    search = [str(fuzzer), *folders, f"-max_total_time={words.seconds}", f"-max_len={LONGEST_SEARCHED}", *limits]
    code = subprocess.run(search, check=False).returncode
    if code == 0 and words.keep:
        merge = [str(fuzzer), "-merge=1", "-use_counters=0", str(CORPUS), str(found), f"-max_len={LONGEST_KEPT}"]
        code = subprocess.run(merge, check=False).returncode
    return min(code, 1)


if __name__ == "__main__":
    sys.exit(main())
