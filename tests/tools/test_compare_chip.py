"""The comparison of two checkouts' chips: what it names, and that it neither hangs nor misses a failure."""

from pathlib import Path
from typing import Any

import pytest

from tools.compare_chip.comparison import LEVELS, ChipComparison
from tools.compare_chip.differences import compare, difference_of_states
from tools.compare_chip.generator import generate, labels_at, name_of
from tools.compare_chip.programs import script_of
from tools.compare_chip.worker import Worker, WorkerError

ROOT = Path(__file__).resolve().parents[2]


def seen(folder: Path, **kinds: list[str]) -> Path:
    folder.mkdir()
    for kind, lines in kinds.items():
        (folder / kind).write_text("".join(f"{line}\n" for line in lines))
    return folder


@pytest.mark.parametrize(
    ("second", "shown"),
    [
        (["a", "b", "c", "x", "e"], ["  b", "  c", "- d", "+ x"]),
        (["a", "b", "c"], ["  b", "  c", "- d", "+ (no more)"]),
        (["z", "b", "c", "d", "e"], ["- a", "+ z"]),
        (["a", "b", "c", "d", "e", "f"], ["  d", "  e", "- (no more)", "+ f"]),
    ],
)
def test_the_first_row_that_differs_is_shown_behind_two_that_do_not(
    tmp_path: Path, second: list[str], shown: list[str]
) -> None:
    one, other = seen(tmp_path / "1", edges=["a", "b", "c", "d", "e"]), seen(tmp_path / "2", edges=second)
    (difference,) = compare(one, other, ["edges"])
    assert list(difference.lines) == shown


def test_equal_runs_have_no_difference(tmp_path: Path) -> None:
    kinds = {"edges": ["1 ns PA0 high"], "state": ["cycle = 7"]}
    assert compare(seen(tmp_path / "1", **kinds), seen(tmp_path / "2", **kinds), kinds) == []


def test_each_name_of_a_state_is_compared_and_a_new_one_is_no_difference() -> None:
    first = {"R0": "1", "R1": "2", "GPIOA.ODR": "0"}
    assert difference_of_states(first, {**first, "TIM2.CNT": "5"}) is None
    difference = difference_of_states(first, {"R0": "1", "R1": "3"})
    assert difference is not None
    assert difference.summary == "2 of 3 differ"
    assert difference.lines == ("- R1 = 2", "+ R1 = 3", "- GPIOA.ODR = 0", "+ GPIOA.ODR = is not there")


def test_addresses_of_code_are_named() -> None:
    difference = difference_of_states({"PC": "0x08000130"}, {"PC": "0x08000132"})
    assert difference is not None
    assert "main+0x2" in difference.text({"0x08000132": "main+0x2"}.get)  # type: ignore[arg-type]  # the other stays


def test_inputs_follow_from_seed_and_program_and_not_from_the_length_of_a_run() -> None:
    whole = script_of("dodge", 1, 50_000_000)
    assert script_of("dodge", 1, 10_000_000) == [what for what in whole if what[0] < 10_000_000]
    assert whole != script_of("dodge", 2, 50_000_000)
    assert [what[0] for what in whole] == sorted(what[0] for what in whole)


@pytest.fixture
def worker() -> Any:
    made = Worker(ROOT, 30.0)
    yield made
    made.close()


def test_a_chip_compared_with_itself_is_the_same_and_a_job_that_hangs_is_named(tmp_path: Path, worker: Worker) -> None:
    said: list[str] = []
    comparison = ChipComparison(worker, worker, tmp_path, said.append, slices=("whole", 7919), is_quick=True)
    image = ROOT / "robot_bench" / "firmware" / "sensors.elf"
    assert comparison.compare("sensors", image, LEVELS[:1])
    assert (comparison.runs, comparison.differing, said) == (2, 0, [])
    worker.budget_s = 0.0
    assert not comparison.compare("sensors", image, LEVELS[:1])
    assert "the old chip did not end within 0 s" in said[0]


def test_a_program_that_is_none_is_told_and_the_next_job_runs(tmp_path: Path, worker: Worker) -> None:
    (tmp_path / "bad.elf").write_bytes(b"no program")
    with pytest.raises(WorkerError, match="bad"):
        worker.ask("symbols", image=str(tmp_path / "bad.elf"), addresses=[])
    assert "USART1.SR" in worker.ask("registers", folder=str(tmp_path))["addresses"]


def test_generated_programs_follow_from_seed_and_number_and_use_what_they_should(tmp_path: Path) -> None:
    sources = []
    for number in range(20):
        image = generate(7, number, tmp_path)
        kept = image.read_bytes(), image.with_suffix(".s").read_text()
        assert generate(7, number, tmp_path).read_bytes() == kept[0]
        sources.append(kept[1])
    used = ("wfi", "wfe", "svc", "udf", "cpsid i", "basepri", "stop: b stop", "psp", "blx")
    assert [word for word in used if not any(word in source for source in sources)] == []


def test_addresses_in_a_generated_program_have_its_labels(tmp_path: Path) -> None:
    image = generate(0, 0, tmp_path)
    assert labels_at(image, ["0x08000132"]) == {"0x08000132": "start+0x2 (0x08000132)"}


def test_generated_programs_run_on_both_cores_alike(tmp_path: Path, worker: Worker) -> None:
    said: list[str] = []
    comparison = ChipComparison(worker, worker, tmp_path, said.append, slices=("random",), is_quick=True)
    for number in range(2):
        assert comparison.compare(name_of(0, number), generate(0, number, tmp_path)), said
    assert comparison.runs == 2 * len(LEVELS)
