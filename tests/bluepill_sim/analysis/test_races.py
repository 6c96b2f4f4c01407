"""The race finder: planted races of three kinds, their mended versions, what counts as another output, the verb."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.__main__ import run
from bluepill_sim.analysis.interrupts import races
from bluepill_sim.analysis.interrupts.races import (
    Channel,
    HandlerStretches,
    OutputParting,
    RaceReport,
    RaceSearch,
    RunOutputs,
    Slack,
    parting_of,
)
from bluepill_sim.core.recorder import EXCEPTION_RETURN
from bluepill_sim.errors import BluePillError
from bluepill_sim.program.image import load_image
from simbase.timing import NS_PER_MS
from tests.bluepill_sim.firmware.compiled import COMPILER, HERE, compiled
from tests.tools.examples import EXAMPLES

needs_compiler = pytest.mark.skipif(shutil.which(COMPILER) is None, reason="needs a cross compiler")
#: Kind → a piece of the line that the interrupt has to fall into, for how long that is looked for, and by which seed.
RACES = {
    "PORT": ("GPIOB_ODR ^= MAIN;", 6 * NS_PER_MS, 0),
    "TICK": ("first = high, second = low", 3 * NS_PER_MS, 3),
    "FLAG": ("if (found) {", 2 * NS_PER_MS, 2),
}
LINES = (HERE / "races.c").read_text(encoding="utf-8").splitlines()


@pytest.fixture(autouse=True)
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")


def line_of(text: str) -> int:
    return next(number for number, line in enumerate(LINES, 1) if text in line)


def search(program: Path, span_ns: int, seeds: Sequence[int]) -> RaceReport:
    return RaceSearch(load_image(program), span_ns, lambda board: board.advance_to).search(seeds)


@needs_compiler
@pytest.mark.parametrize("kind", RACES)
def test_a_planted_race_is_named_by_its_line_and_its_mended_version_has_none(kind: str, tmp_path: Path) -> None:
    text, span_ns, seed = RACES[kind]
    report = search(compiled("races", tmp_path, "-Og", f"-DRACE_{kind}"), span_ns, [seed])
    assert report.differing
    assert report.races
    line = line_of(text)
    places = {report.lines.place(at.address) for race in report.races for at in (race.before, race.behind)}
    assert places & {f"races.c:{near}" for near in (line, line + 1)}
    for race in report.races:
        assert race.before.address != race.behind.address
        assert race.before.puts_out != race.behind.puts_out
    assert (
        search(compiled("races", tmp_path, "-Og", f"-DRACE_{kind}", "-DMENDED"), 10 * NS_PER_MS, [0, 1]).differing == 0
    )


@needs_compiler
def test_the_verb_tells_both_orders_and_calls_it_no_fault(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    program = compiled("races", tmp_path, "-Og", "-DRACE_PORT")
    words = ["races", str(program), "--for", "6ms", "--runs", "1"]
    assert run(words) == 1
    shown = capfd.readouterr().out
    assert "depends: 1 of 1 runs" in shown
    assert "SysTick against" in shown
    assert f"races.c:{line_of(RACES['PORT'][0])}" in shown
    assert "fault" not in shown
    assert run(words) == 1
    assert capfd.readouterr().out == shown


@pytest.mark.parametrize("name", ["dodge", "rover", "motors", "encoders", "sensors"])
def test_a_shipped_program_depends_on_no_latency(name: str) -> None:
    report = search(EXAMPLES / f"{name}.elf", 50 * NS_PER_MS, [0, 1])
    assert report.interrupts > 0
    assert report.differing == 0


def test_a_latency_is_drawn_by_its_seed_and_lets_the_rest_alone() -> None:
    program = EXAMPLES / "encoders.elf"

    def entries(**latency: int) -> list[tuple[int, int, int]]:
        board = BluePill(program)
        if latency:
            board.chip.latency.vary(**latency)
        recorder = board.chip.record_blocks(1 << 18)
        board.run_for("20 ms")
        return [row for row in recorder.drain() if row[2] > 0]

    as_it_is = entries()
    late = [row[0] - was[0] for row, was in zip(entries(seed=1), as_it_is, strict=True)]
    assert set(late) <= set(range(13))
    assert len(set(late)) > 5
    assert entries(seed=1, most=12) == entries(seed=1) != entries(seed=2)
    assert entries(seed=1, most=0) == as_it_is
    assert {row[0] - was[0] for row, was in zip(entries(seed=1, most=1), as_it_is, strict=True)} == {0, 1}
    # Only the fourth, by seven cycles; and all up to it as drawn.
    single = [row[0] - was[0] for row, was in zip(entries(seed=1, most=0, until=3, last=7), as_it_is, strict=True)]
    assert single == [7 * (number == 3) for number in range(len(as_it_is))]
    first = [row[0] - was[0] for row, was in zip(entries(seed=1, until=3), as_it_is, strict=True)]
    assert first == [*late[:3], *[0] * (len(late) - 3)]


def test_a_board_goes_on_from_a_snapshot_with_what_was_held() -> None:
    whole, cut = BluePill(EXAMPLES / "encoders.elf"), BluePill(EXAMPLES / "encoders.elf")
    for board in (whole, cut):
        board.chip.latency.vary(seed=3, most=1000)
    while not cut.chip.processor.nvic.held:
        cut.advance_to(cut.now_ns + 2000)
    other = BluePill(EXAMPLES / "encoders.elf")
    other.restore(cut.snapshot())
    other.advance_to(5 * NS_PER_MS)
    whole.advance_to(5 * NS_PER_MS)
    assert other.chip.latency.count == whole.chip.latency.count > 0
    assert (other.cycle, bytes(other.chip.memory.sram)) == (whole.cycle, bytes(whole.chip.memory.sram))
    assert not other.chip.processor.nvic.held


@pytest.mark.parametrize("core", ["", "native", "own"])
def test_a_core_that_takes_interrupts_at_block_ends_is_refused(core: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    with pytest.raises(BluePillError, match="taken at the instruction"):
        BluePill(EXAMPLES / "encoders.elf").chip.latency.vary(seed=1)


def outputs(end: int = 1000, **channels: list[tuple[int, int]]) -> RunOutputs:
    found = {name: Channel([at for at, _ in rows], [value for _, value in rows]) for name, rows in channels.items()}
    return RunOutputs(channels=found, end=end, interrupts=0)


SLACK = Slack(latency_ns=2, stretch_ns=8, entries=())


@pytest.mark.parametrize(
    ("late_by", "parts"),
    [(0, False), (20, False), (21, True)],  # twice a latency and a stretch
)
def test_a_time_counts_only_beyond_what_latencies_explain(late_by: int, parts: bool) -> None:
    one = outputs(PA0=[(100, 1), (200, 0)])
    other = outputs(PA0=[(100, 1), (200 + late_by, 0)])
    assert (parting_of(one, other, SLACK) is not None) is parts


def test_a_drift_of_a_latency_for_each_interrupt_does_not_count() -> None:
    slack = Slack(latency_ns=2, stretch_ns=8, entries=range(0, 1000, 5))
    one = outputs(PA0=[(at, at // 50 % 2) for at in range(50, 900, 50)])
    other = outputs(PA0=[(at + at // 5, at // 50 % 2) for at in range(50, 900, 50)], end=800)
    assert parting_of(one, other, slack) is None


def test_another_value_and_what_is_missing_count_and_what_may_still_come_does_not() -> None:
    one = outputs(USART1=[(100, 65), (200, 66), (300, 67)])
    found = parting_of(one, outputs(USART1=[(100, 65), (200, 70), (300, 67)]), SLACK)
    assert found is not None
    assert (found.at, found.channel, found.place) == (200, "USART1", 1)
    found = parting_of(one, outputs(USART1=[(100, 65), (200, 66)]), SLACK)
    assert found is not None
    assert (found.at, found.place) == (300, 2)
    assert parting_of(one, outputs(USART1=[(100, 65), (200, 66)], end=320), SLACK) is None
    assert parting_of(one, outputs(USART1=[(100, 65), (200, 66)], end=321), SLACK) is not None


@pytest.mark.parametrize(("apart", "counts"), [(10, False), (11, True)])
def test_the_order_of_two_pins_counts_where_they_are_farther_apart_than_a_stretch(apart: int, counts: bool) -> None:
    one = outputs(PA0=[(100, 1)], PA1=[(100 + apart, 1)])
    other = outputs(PA0=[(100 + apart, 1)], PA1=[(100, 1)])
    assert (parting_of(one, other, SLACK) is not None) is counts


@given(st.lists(st.integers(1, 900), unique=True), st.integers(0, 10))
def test_a_run_parts_from_itself_nowhere_nor_from_one_that_is_a_little_late(times: list[int], late: int) -> None:
    rows = [(at, number % 2) for number, at in enumerate(sorted(times))]
    one, other = outputs(PB0=rows), outputs(PB0=[(at + late, value) for at, value in rows])
    assert parting_of(one, one, SLACK) is None
    assert parting_of(one, other, SLACK) is None


def test_the_verb_leaves_the_choice_of_the_core_alone(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("P2OS_CORE")
    words = ["races", str(EXAMPLES / "codes.elf"), "--for", "1ms", "--runs", "1"]
    assert run(words) == 0
    assert capfd.readouterr().out == "it puts out the same, whatever the latency\n"
    assert "P2OS_CORE" not in os.environ
    monkeypatch.setenv("P2OS_CORE", "own")
    assert run(words) == 2


@pytest.mark.parametrize("text", ["ping", "@1ms", "ping@soon", r"\x@1s"])
def test_text_to_send_that_is_not_understood_is_refused(text: str) -> None:
    assert run(["races", str(EXAMPLES / "codes.elf"), "--send", text]) == 2


def test_a_line_that_rises_again_while_its_interrupt_is_pending_draws_nothing_anew() -> None:
    board = BluePill(EXAMPLES / "codes.elf")
    board.chip.latency.vary(seed=0, most=0, until=0, last=12)
    for level in (True, False, True):
        board.chip.fabric.set_line(28, level)
    assert board.chip.latency.count == 1
    assert board.chip.processor.nvic.held == 1 << 44


def test_a_stretch_is_as_long_as_handlers_run_one_in_another_and_at_once_after_each_other() -> None:
    taken, longest = HandlerStretches(), []
    rows = [(10, 4), (20, EXCEPTION_RETURN), (20, 5), (35, EXCEPTION_RETURN), (36, 4), (40, 6), (50, EXCEPTION_RETURN),
            (55, 0), (58, EXCEPTION_RETURN), (60, EXCEPTION_RETURN), (70, 4), (99, EXCEPTION_RETURN)]  # fmt: skip
    for cycle, kind in rows:
        taken.put(cycle, 0x0800_0000, kind)
        longest.append(taken.longest)
    assert longest == [0, 10, 10, 25, 25, 25, 25, 25, 25, 25, 25, 29]
    assert taken.entries == [10, 20, 36, 40, 70]


@pytest.mark.parametrize(
    ("one", "other", "found"),
    [
        ({"PA0": [(100, 1)], "PA1": [(111, 1)]}, {"PA0": [(111, 1)], "PA1": [(100, 1)]}, (111, "PA0", 0, "PA1")),
        ({"PA0": [(0, 1)], "PA1": [(11, 1)]}, {"PA0": [(11, 1)], "PA1": [(0, 1)]}, (11, "PA0", 0, "PA1")),
        ({"PA0": [(50, 1), (100, 0)], "PA1": [(111, 1)]}, {"PA0": [(50, 1), (111, 0)], "PA1": [(100, 1)]},
         (111, "PA0", 1, "PA1")),
        ({"PA0": [(100, 1)]}, {}, (100, "PA0", 0, "")),
        ({"PA1": [(100, 1)], "PA0": [(100, 1)]}, {}, (100, "PA0", 0, "")),
        ({"PA1": [(100, 1)], "PA0": [(990, 1)]}, {"PA1": [(100, 1)]}, None),
        ({"PA0": [(100, 1), (140, 0)]}, {"PA0": [(100, 1), (161, 0)]}, (140, "PA0", 1, "")),
        ({"PA0": [(100, 1), (140, 0)]}, {"PA0": [(100, 1), (160, 0)]}, None),
    ],
)  # fmt: skip
def test_the_first_parting_is_told_with_its_channel_its_place_and_what_came_before_it(
    one: dict[str, list[tuple[int, int]]], other: dict[str, list[tuple[int, int]]], found: tuple[int, str, int, str]
) -> None:
    parted = parting_of(outputs(1000, **one), outputs(1000, **other), SLACK)
    assert parted == (None if found is None else OutputParting(*found))


def test_what_two_channels_put_out_in_another_order_is_shown_each_with_its_name() -> None:
    run = outputs(PA0=[(100, 2), (400, 1)], USART1=[(120, 65)])
    shown = races._shown(run, OutputParting(100, "PA0", 0, "USART1"), SLACK)
    assert [row.split(" at ")[0] for row in shown] == ["PA0 high", "USART1 'A'", "PA0 low"]
