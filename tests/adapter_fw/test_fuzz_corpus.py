"""What a fuzzer found worth keeping, read again with g++'s sanitizers; its findings, now fixed, are among it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.adapter_fw.builds import ROOT, built

CORPUS = ROOT / "adapter_fw" / "fuzz" / "corpus"
#: Once each broke a rule or a sanitizer: settings that overflow, a SIP that was older than it looked, a loop that spun.
FOUND = ("found-settings-overflow", "found-late-sip", "found-spinning")


def test_no_kept_input_breaks_a_rule(tmp_path: Path) -> None:
    program, _ = built("replay", tmp_path)
    inputs = sorted(CORPUS.iterdir())
    assert {path.name for path in inputs} >= set(FOUND)
    done = subprocess.run([program, *inputs], capture_output=True, text=True, check=False, timeout=120)
    assert (done.returncode, done.stdout) == (0, f"{len(inputs)} inputs, nothing found\n"), done.stderr


def test_a_file_that_is_missing_is_said(tmp_path: Path) -> None:
    program, _ = built("replay", tmp_path)
    done = subprocess.run([program, tmp_path / "no"], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert "cannot open" in done.stderr


@pytest.mark.soak
def test_a_search_guided_by_coverage_finds_nothing(tmp_path: Path) -> None:
    if not has_fuzzer(tmp_path):
        pytest.skip("clang++ with libFuzzer is not here (apt-get install clang libclang-rt-14-dev)")
    words = [sys.executable, ROOT / "adapter_fw" / "fuzz" / "search.py", "--seconds", "2", "--work", tmp_path]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(re.findall(r"Done (\d+) runs", done.stderr)[-1]) > len([*CORPUS.iterdir()])


def has_fuzzer(folder: Path) -> bool:
    """Tell whether clang is here with its runtime of libFuzzer, which is a package of its own."""
    if shutil.which("clang++") is None:
        return False
    empty = folder / "empty.cpp"
    empty.write_text('extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }\n')
    words = ["clang++", "-fsanitize=fuzzer,address", str(empty), "-o", str(folder / "empty")]
    return subprocess.run(words, capture_output=True, check=False, timeout=60).returncode == 0


def test_the_corpus_stays_small() -> None:
    sizes = [path.stat().st_size for path in CORPUS.iterdir()]
    assert len(sizes) <= 400
    assert sum(sizes) <= 64 * 1024
