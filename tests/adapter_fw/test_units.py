"""Single parts of the firmware, by checks in C++ (adapter_fw/selftest): what changed is compiled for each run."""

import subprocess
from pathlib import Path

import pytest

from tests.adapter_fw.builds import built


@pytest.mark.parametrize("name", ["units", "library"])
def test_checks_on_the_pc_hold(name: str, tmp_path: Path) -> None:
    program, _ = built(name, tmp_path)
    done = subprocess.run([program], capture_output=True, text=True, check=False, timeout=60)
    assert (done.stdout, done.returncode) == ("ok\n", 0), done.stderr
