"""The inside of a chip on a page: what a debugger would read, in the manual's words, and the run is not changed."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from bluepill_sim.analysis.program_lines import NO_CODE
from bluepill_sim.board import BluePill
from bluepill_sim.debug.chip_state import (
    clock_rows,
    core_rows,
    exception_rows,
    source_place,
    stack_rows,
)
from p2os.view.header import PageDrawing, PageSection, PageSource, PageTable, PageText
from p2os.view.run_control import RunCommand
from p2os.view.targets import panels_of
from robot_bench.bench import Bench
from robot_bench.cli.shown.chip_panels import LEFT, RIGHT
from robot_bench.cli.shown.live_run import LOOK_NS, LiveRun
from robot_bench.recording.run_record import read_run
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from tests.robot_bench.firmware.hurried import hurried_scenario

SCENARIO = hurried_scenario("dodge", 1, mode="direct", body="kinematic", duration_s=0.3)
MS = 1_000_000


@pytest.fixture(scope="module")
def bench() -> Bench:
    made = Bench(SCENARIO)
    made.run_until("100 ms")
    return made


@pytest.fixture
def board(bench: Bench) -> BluePill:
    assert isinstance(bench.chip, BluePill)
    return bench.chip


def tables(board: BluePill, panel: str, choice: str = "") -> dict[str, list[list[str]]]:
    """Return the rows of each table of a panel, by its section's title."""
    found = next(one for one in panels_of(board) if one.name == panel).look(choice)
    return {section.title: [[cell.text for cell in row] for row in block.rows]
            for section in found for block in section.blocks if isinstance(block, PageTable)}  # fmt: skip


def test_every_peripheral_has_its_registers_with_the_manuals_fields(board: BluePill) -> None:
    choices = next(one for one in panels_of(board) if one.name == "chip").header.choices
    assert set(board.chip.parts.by_name) < set(choices)
    for name in board.chip.parts.by_name:
        assert [row[0] for row in tables(board, "chip", name)[name]] == list(board.registers(name))
    rows = {row[0]: row for row in tables(board, "chip", "USART1")["USART1"]}
    assert rows["CR1"][1] == "0x4001380c"
    assert "UE 1" in rows["CR1"][3]
    assert "RXNEIE" in rows["CR1"][3]
    assert tables(board, "chip", "no such") == {}


def test_clocks_are_those_that_rcc_says(board: BluePill) -> None:
    clocks = {row.name: (row.source, row.hz) for row in clock_rows(board)}
    assert clocks["PLLCLK"] == ("HSE x 9", 72_000_000)
    assert clocks["SYSCLK"] == ("PLLCLK", board.chip.clocks.sysclk_hz)
    assert clocks["PCLK1"][1] == 36_000_000
    assert tables(board, "chip", "clock tree")["clock tree"][3] == ["SYSCLK", "PLLCLK", "72 MHz"]


def test_exceptions_are_named_with_how_they_stand(board: BluePill) -> None:
    nvic = board.chip.processor.nvic
    saved = nvic.snapshot()
    try:
        nvic.pend(15)
        nvic.activate(16 + 28)
        nvic.priorities[16 + 28] = 0x40
        rows = {
            row.name: (row.is_enabled, row.is_pending, row.is_active, row.priority) for row in exception_rows(board)
        }
    finally:
        nvic.restore(saved)
    assert rows["SysTick"] == (False, True, False, 0)
    assert rows["TIM2"] == (False, False, True, 0x40)
    assert tables(board, "chip", "NVIC")["NVIC"][0][:3] == ["USART1", "53", "yes"]


def test_the_core_the_stack_and_the_line_are_where_the_program_is(board: BluePill) -> None:
    core = {row.name: row for row in core_rows(board)}
    assert core["pc"].value == board.pc
    assert core["sp"].value % 4 == 0
    stack = stack_rows(board)
    assert stack[0].name == f"{core['sp'].value:#010x}"
    assert any(row.meaning.startswith("Reset_Handler") for row in stack)
    place = source_place(board)
    assert place is not None
    listing = look(board)[0].blocks[0]
    assert isinstance(listing, PageText), "its file is nowhere near"
    assert "is not to be had" in listing.text
    assert {row[0] for row in tables(board, "program")["Core"]} >= {"r0", "pc", "xpsr", "primask"}


@pytest.fixture(scope="module")
def dodge() -> Bench:
    """Return a bench whose program's sources are beside it, 20 ms on."""
    made = Bench.from_scenario("dodge", mode="direct", body="kinematic")
    made.run_until("20 ms")
    return made


def look(chip: object, choice: str = "next line") -> Sequence[PageSection]:
    return next(one for one in panels_of(chip) if one.name == "program").look(choice)


def test_the_source_around_the_next_line_is_shown_with_what_has_run_of_it(dodge: Bench) -> None:
    assert isinstance(dodge.chip, BluePill)
    place = source_place(dodge.chip)
    assert place is not None
    source = look(dodge.chip)[0].blocks[0]
    assert isinstance(source, PageSource)
    assert (source.title, source.next) == (f"{place.file}:{place.line} in {place.function}", place.line)
    assert source.first <= place.line < source.first + len(source.lines) <= source.first + 13
    assert re.search("wait_for|interrupts_on", source.lines[place.line - source.first])
    assert source.ran_ns[place.line - source.first] == 0
    assert {0, NO_CODE} <= set(source.ran_ns)


def test_what_has_run_grows_as_the_program_goes_on(dodge: Bench) -> None:
    assert isinstance(dodge.chip, BluePill)

    def ran() -> tuple[dict[str, str], set[tuple[str, int]]]:
        shares, sources = look(dodge.chip, "what has run")
        table = shares.blocks[0]
        assert isinstance(table, PageTable)
        lines = {
            (block.title, block.first + n)
            for block in sources.blocks if isinstance(block, PageSource)
            for n, at in enumerate(block.ran_ns) if at >= 0
        }  # fmt: skip
        return {row[0].text: row[1].text for row in table.rows}, lines

    functions, lines = ran()
    assert functions["Reset_Handler"] != "0 %"
    assert functions["dodge_tick"] == "0 %"
    before = dodge.snapshot()
    dodge.run_until("3500 ms")
    later, more = ran()
    assert later["dodge_tick"] not in {"0 %", "100 %"}
    assert lines < more
    dodge.restore(before)
    assert ran() == (later, more), "what was gone back over has run"


def test_the_board_shows_each_pin_of_its_headers_and_the_led(board: BluePill) -> None:
    (section,) = next(one for one in panels_of(board) if one.name == "board").look("")
    (drawing,) = section.blocks
    assert isinstance(drawing, PageDrawing)
    titles = [shape.title for shape in drawing.shapes if shape.kind == "circle"]
    assert {title.partition(":")[0] for title in titles} - {"LED off (PC13)", "LED on (PC13)"} == {*LEFT, *RIGHT}
    bonded = {pin.name for pin in board.pins if not pin.name.startswith("PD")} - {
        "PB2",
        "PA13",
        "PA14",
    }  # at jumpers of their own
    assert bonded == {name for name in (*LEFT, *RIGHT) if name.startswith("P")}
    assert section.note == ("LED on" if board.led_is_on else "LED off")
    assert any(title.startswith("PA9: high, alternate") for title in titles), titles


def test_what_is_no_emulated_board_has_no_panels() -> None:
    assert panels_of(object()) == []


def test_a_run_whose_inside_is_looked_at_leaves_the_same_trace(tmp_path: Path) -> None:
    plain = run_scenario(SCENARIO, tmp_path / "plain", files=Files.SUMMARY).folder
    now = [0]

    def clock() -> int:
        now[0] += LOOK_NS
        return now[0]

    live = LiveRun(SCENARIO, speed=0.0, clock=clock)
    looks = [
        ("program", "next line"),
        ("program", "what has run"),
        ("board", ""),
        ("chip", "NVIC"),
        ("chip", "clock tree"),
        ("chip", "USART1"),
        ("chip", "TIM2"),
    ]
    seen = {look: list[int]() for look in looks}
    turn = live._turn

    def looking(session: object) -> None:
        for look in looks:
            state = live.look(*look)
            if state is not None:
                seen[look].append(state.at_ns)
        assert live.look("no such panel", "") is None
        turn(session)  # type: ignore[arg-type]  # as it came

    live._turn = looking  # type: ignore[method-assign]  # what pages would ask for
    for at in (50 * MS, 20 * MS):
        live.offer(RunCommand(do="go", at_ns=at))
    live.offer(RunCommand(do="run"))
    folder = run_scenario(SCENARIO, tmp_path / "looked", drive=live.drive, files=Files.SUMMARY).folder
    assert read_run(folder).end["trace_sha256"] == read_run(plain).end["trace_sha256"]
    assert all(len(set(times)) > 2 for times in seen.values()), seen
    live.source.update()
    assert [one.name for one in live.source.recording.header.panels] == ["board", "program", "chip"]
