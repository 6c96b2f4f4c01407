"""The faults that tools/bench/campaigns/faults has drawn: ten a program, at their places in the sources as they are."""

import importlib.util
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

from robot_bench.firmware import build

TOOL = Path(__file__).parents[3] / "tools" / "bench" / "campaigns" / "faults" / "draw.py"


@pytest.fixture(scope="module")
def draw() -> ModuleType:
    spec = importlib.util.spec_from_file_location("draw", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["draw"] = module
    spec.loader.exec_module(module)
    return module


def test_ten_stay_of_each_program_and_seed_and_none_is_drawn_twice(draw: ModuleType) -> None:
    for seed in draw.SEEDS:
        assert Counter(fault.program for fault in draw.kept(seed)) == dict.fromkeys(draw.DRAWN, 10)
    keys = Counter((fault.program, fault.key) for seed in draw.SEEDS for fault in draw.kept(seed))
    assert set(keys.values()) == {1}


def test_each_stands_where_the_source_says_what_it_replaces(draw: ModuleType) -> None:
    for fault in (fault for seed in draw.SEEDS for fault in draw.kept(seed)):
        source = (build.HERE / fault.file).read_bytes()
        assert source[fault.start :].startswith(fault.right.encode()), fault
        assert source.count(b"\n", 0, fault.start) + 1 == fault.line
        assert fault.right != fault.wrong


@pytest.mark.slow
def test_the_seed_draws_what_is_kept() -> None:
    pytest.importorskip("tree_sitter_c")
    if build.compiler_version() != build.COMPILER_VERSION:
        pytest.skip(f"no {build.COMPILER} of this version")
    asked = [sys.executable, str(TOOL), "--check", "--seed", "41"]  # what an earlier one has drawn goes in too
    assert subprocess.run(asked, capture_output=True, check=False).returncode == 0


def test_a_source_that_has_changed_is_refused(draw: ModuleType, tmp_path: Path) -> None:
    if shutil.which(build.COMPILER) is None:
        pytest.skip(f"no {build.COMPILER}")
    fault = draw.kept(draw.SEEDS[0])[0]
    with pytest.raises(ValueError, match="does not say"):
        draw.build(draw.DrawnFault(**{**draw.asdict(fault), "right": "nothing of this kind"}), tmp_path / "x.elf")
