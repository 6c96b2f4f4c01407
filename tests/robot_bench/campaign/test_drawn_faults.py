"""The faults that tools/bench/campaigns/faults has drawn: ten a program, at their places in the sources as they are.

And the sound variants, which no campaign may call faulty.
"""

import importlib.util
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

from robot_bench.campaign.campaign_file import parse_campaign
from robot_bench.campaign.conduct import Conduct, PointFinding
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.workers.processes import Processes
from robot_bench.firmware import build
from robot_bench.scenario.loading import load_scenario

TOOL = Path(__file__).parents[3] / "tools" / "bench" / "campaigns" / "faults" / "draw.py"


def tool(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, TOOL.with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def draw() -> ModuleType:
    return tool("draw")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with all sound variants."""
    if build.compiler_version() != build.COMPILER_VERSION:
        pytest.skip(f"no {build.COMPILER} of this version")
    folder = tmp_path_factory.mktemp("sound")
    variants = tool("sound")
    for program, rows in variants.VARIANTS.items():
        for name, variant in rows.items():
            variants.build(program, variant, folder / f"{program}-{name}.elf")
    return folder


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


@pytest.mark.soak
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


@pytest.mark.slow
def test_sound_variants_are_other_programs_than_the_one_that_ships(sound: Path) -> None:
    for program in ("dodge", "rover"):
        found = {path.stem: path.read_bytes() for path in sound.glob(f"{program}-*.elf")}
        assert len(set(found.values())) == len(found) == 4
        assert found[f"{program}-shipped"] == (build.HERE / f"{program}.elf").read_bytes()


@pytest.mark.soak
@pytest.mark.parametrize("variant", ["refactored", "constants", "optimised"])
@pytest.mark.parametrize("program", ["dodge", "rover"])
def test_no_sound_variant_is_called_faulty(program: str, variant: str, sound: Path, tmp_path: Path) -> None:
    text = suggested(load_scenario(program), program, "mine.toml", {"runs": 32, "seed": 7})
    campaign = parse_campaign(text, tmp_path / "mine.toml", firmware=sound / f"{program}-{variant}.elf")
    workers = Processes(2, campaign.limits)
    try:
        conduct = Conduct(campaign, tmp_path, workers, clock=time.monotonic_ns)
        rows = [row for batch in conduct.batches() for row in batch]
    finally:
        workers.close()
    assert len(rows) == 32
    assert {row.finding for row in rows} <= {PointFinding.PASSED, PointFinding.EXCUSED, PointFinding.CHEAP_ONLY}
