"""C of ours under the address and undefined-behaviour sanitizers, with every warning an error."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

#: A null pointer and a place beside an object end it by the address sanitizer: to look for them twice takes long.
FLAGS = (
    "-std=c11", "-Og", "-g1", "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror", "-fPIC", "-shared",
    "-fsanitize=address,undefined", "-fno-sanitize=null,object-size", "-fno-sanitize-recover=all",
)  # fmt: skip
ROOT = Path(__file__).resolve().parents[3]
needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


def built_sanitized(library: Path, sources: Sequence[Path], *flags: str) -> Path:
    """Build a library of sources, by more flags, and return it."""
    _run("gcc", *FLAGS, *flags, "-o", str(library), *map(str, sources))
    return library


def printed_under_sanitizers(program: str, *arguments: str, **environment: str) -> str:
    """Return what a program in Python prints that loads such a library; a finding fails, no sanitizer skips."""
    preload = _run("gcc", "-print-file-name=libasan.so").strip()
    if not Path(preload).is_file():
        pytest.skip("the compiler comes without a sanitizer's library")
    return _run(
        sys.executable, "-c", program, *arguments, LD_PRELOAD=preload, ASAN_OPTIONS="detect_leaks=0", **environment
    )


def _run(*command: str, **environment: str) -> str:
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False, cwd=ROOT, env={**os.environ, **environment}
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done.stdout
