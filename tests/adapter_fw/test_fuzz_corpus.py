"""What a fuzzer found worth keeping, read again with g++'s sanitizers; its findings, now fixed, are among it."""

import subprocess
from pathlib import Path

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


def test_the_corpus_stays_small() -> None:
    sizes = [path.stat().st_size for path in CORPUS.iterdir()]
    assert len(sizes) <= 400
    assert sum(sizes) <= 64 * 1024
