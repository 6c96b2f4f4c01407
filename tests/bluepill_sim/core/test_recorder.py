"""The record of blocks and exceptions: what is in it, its bounds, and that it changes nothing."""

import random

import pytest

from bluepill_sim.core import BLOCK, EXCEPTION_RETURN, BlockRecorder
from bluepill_sim.core.debugging.debug_unit import WatchKind, Watchpoint
from bluepill_sim.core.recorder import RECORD

SYSTICK = "mov32 r1, #0xE000E010\nmov32 r2, #799\nstr r2, [r1, #4]\nstr r2, [r1, #8]\nmovs r2, #7\nstr r2, [r1, #0]\n"
CALLS = "movs r5, #3\nloop: bl work\nsubs r5, #1\nbne loop\nb stop\nwork: bx lr"
MS = 1_000_000


def test_each_block_is_reported_with_the_cycle_of_its_start(boot) -> None:
    machine = boot(CALLS)
    recorder = machine.board.chip.record_blocks(100)
    machine.board.advance_to(MS)
    label = machine.label
    start, loop, work = label("start"), label("loop"), label("work")
    # R7, movs and bl: 3 + 2; bx lr: 3; subs and a taken bne: 3; bl: 2; the last bne falls through: 2; b stop: 2.
    assert recorder.drain() == [
        (0, start, BLOCK), (5, work, BLOCK), (8, loop + 4, BLOCK), (11, loop, BLOCK), (13, work, BLOCK),
        (16, loop + 4, BLOCK), (19, loop, BLOCK), (21, work, BLOCK), (24, loop + 4, BLOCK), (26, loop + 8, BLOCK),
        (28, label("stop"), BLOCK),
    ]  # fmt: skip
    assert recorder.drain() == []


def test_exceptions_are_reported_with_the_place_they_interrupt(boot) -> None:
    machine = boot(SYSTICK + "movs r3, #0\nloop: adds r3, #1\nb loop\ntick: adds r6, #1\nbx lr", {15: "tick"})
    recorder = machine.board.chip.record_blocks(10_000)
    machine.run(120)
    rows = recorder.drain()
    at = next(n for n, row in enumerate(rows) if row[2] == 15)
    entry, handler, back, again = rows[at : at + 4]
    assert entry[1] == machine.label("loop")
    assert handler == (entry[0] + 12, machine.label("tick"), BLOCK)
    assert back == (handler[0] + 2, machine.label("loop"), EXCEPTION_RETURN)
    assert again == (back[0] + 12, machine.label("loop"), BLOCK)


def test_a_tail_chain_is_a_return_and_an_entry_at_one_time(boot) -> None:
    source = "svc #0\nb stop\ncall: mov32 r1, #0xE000ED04\nmov32 r2, #0x10000000\nstr r2, [r1, #0]\nbx lr\nsv: bx lr"
    machine = boot(source, {11: "call", 14: "sv"})
    recorder = machine.board.chip.record_blocks(100)
    machine.run(100)
    exceptions = [row for row in recorder.drain() if row[2] != BLOCK]
    (entry, left, chained, back) = exceptions
    assert (entry[2], left[2], chained[2], back[2]) == (11, EXCEPTION_RETURN, 14, EXCEPTION_RETURN)
    assert left[0] == chained[0]
    assert left[1] == chained[1] == 0xFFFF_FFF9
    assert back[0] == chained[0] + 6 + 1


def test_rows_do_not_depend_on_slices(boot) -> None:
    def rows(slice_us: float | None) -> list[tuple[int, int, int]]:
        source = SYSTICK + "movs r3, #200\nloop: subs r3, #1\nbne loop\nspin: b spin\ntick: adds r6, #1\nbx lr"
        machine = boot(source, {15: "tick"})
        recorder = machine.board.chip.record_blocks(100_000)
        machine.run(1000, slice_us)
        return recorder.drain()

    whole = rows(None)
    assert [row[2] for row in whole].count(15) == 9
    assert rows(7) == whole
    assert rows(1) == whole


def test_recording_changes_nothing_and_can_begin_and_end_anywhere(boot) -> None:
    plain, recorded = boot(CALLS).run(1), boot(CALLS).run(1)
    recorder = recorded.board.chip.record_blocks(1000)
    plain.run(2)
    recorded.run(2)
    assert len(recorder) > 0
    recorded.board.chip.stop_recording()
    count = len(recorder)
    plain.run(100)
    recorded.run(100)
    assert len(recorder) == count
    assert (plain.board.cycle, plain.board.pc) == (recorded.board.cycle, recorded.board.pc)


@pytest.mark.parametrize("together", [1, 2, 4, 5])
def test_a_recorder_is_bounded_however_many_rows_come_together(together: int) -> None:
    recorder = BlockRecorder(3)
    for first in range(0, 5, together):
        recorder.put_packed(packed(*range(first, min(5, first + together))))
    assert [row[0] for row in recorder.last(2)] == [3, 4]
    assert recorder.last(0) == []
    assert [row[0] for row in recorder.drain()] == [2, 3, 4]
    assert recorder.lost == 2
    with pytest.raises(ValueError, match="not 0"):
        BlockRecorder(0)


def packed(*cycles: int) -> bytes:
    return b"".join(RECORD.pack(cycle, 0, BLOCK) for cycle in cycles)


def test_rows_that_come_as_bytes_and_one_by_one_are_in_their_order() -> None:
    recorder = BlockRecorder(5)
    for _ in range(2):
        recorder.put(1, 0, BLOCK)
        recorder.put_packed(packed(2, 3))
        assert [row[0] for row in recorder.last(2)] == [2, 3]
        recorder.put(4, 0, BLOCK)
        recorder.put_packed(packed(5, 6))
        assert (len(recorder), recorder.drain_packed()) == (5, packed(2, 3, 4, 5, 6))
    assert (len(recorder), recorder.lost, recorder.drain()) == (0, 2, [])


@pytest.mark.parametrize("capacity", [1, 2, 5])
@pytest.mark.parametrize("drains", [False, True])
def test_a_recorder_keeps_the_last_rows_and_counts_the_others(capacity: int, drains: bool) -> None:
    draw, kept, lost = random.Random(f"{capacity} {drains}"), list[int](), 0
    recorder = BlockRecorder(capacity, BlockRecorder.drain if drains else None)
    for cycle in range(0, 400, 8):
        count = draw.choice((1, 1, 2, 7))
        rows = range(cycle, cycle + count)
        if draw.random() < 0.5:
            recorder.put_packed(packed(*rows))
        else:
            for row in rows:
                recorder.put(row, 0, BLOCK)
        for row in rows if not drains else ():
            kept.append(row)
            lost += len(kept) > capacity
            del kept[:-capacity]
        if not drains:
            assert ([row[0] for row in recorder.last(9)], recorder.lost) == (kept, lost)
        if draw.random() < 0.2:
            recorder.drain()
            kept.clear()
    assert recorder.lost == lost


def test_a_full_recorder_asks_to_be_drained(boot) -> None:
    whole = boot(CALLS)
    expected = whole.board.chip.record_blocks(100)
    whole.run(100)
    taken: list[tuple[int, int, int]] = []
    machine = boot(CALLS)
    recorder = machine.board.chip.record_blocks(2, lambda full: taken.extend(full.drain()))
    machine.run(100)
    assert recorder.lost == 0
    assert taken + recorder.drain() == expected.drain()


def test_an_error_of_whoever_drains_comes_out_of_the_run(boot) -> None:
    machine = boot(CALLS)

    def fail(_recorder: BlockRecorder) -> None:
        raise OSError("disk full")

    machine.board.chip.record_blocks(2, fail)
    with pytest.raises(OSError, match="disk full"):
        machine.run(100)


#: A wait of 20 rounds for a level of port A, more reads of both ports, and accesses that are not told of.
READS = """
mov32 r1, #0x40010800
movs r2, #20
wait: ldr r3, [r1, #8]
subs r2, #1
bne wait
ldrh r3, [r1, #8]
str r3, [r1, #16]
ldr r3, [r1, #12]
mov32 r4, #0x40010C00
ldr r3, [r4, #8]
spin: ldr r3, [r1, #8]
b spin
"""
PINS = [Watchpoint(0x4001_0808, 4, WatchKind.READ), Watchpoint(0x4001_0C08, 4, WatchKind.READ)]


@pytest.mark.parametrize("core", ["native", "python"])
def test_each_access_is_recorded_once_with_the_instruction_that_a_watchpoint_halts_at(
    boot, core: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a halt the core stands behind the access: all of these are of 2 bytes, and of 1 or 2 cycles."""
    monkeypatch.setenv("P2OS_CORE", core)
    recorded, watched = boot(READS), boot(READS)
    rows = recorded.board.chip.record_accesses(PINS)
    recorded.run(40)
    watched.board.chip.engine.watchpoints.update(PINS)
    halts = []
    while (reached := watched.board.advance_to(40_000)).halt is not None:
        halts.append((reached.now, reached.halt.pc - 2))
    assert len(rows) > 40
    assert [pc for _, pc in rows] == [pc for _, pc in halts]
    assert {after - at for (at, _), (after, _) in zip(rows, halts, strict=True)} == {125, 250}


def test_accesses_are_recorded_no_more_than_wanted_and_change_nothing(boot) -> None:
    plain, recorded = boot(READS).run(10), boot(READS).run(10)
    rows = recorded.board.chip.record_accesses(PINS)
    recorded.run(20)
    recorded.board.chip.stop_recording()
    count = len(rows)
    assert rows[0][0] >= 10_000
    assert rows[-1][0] <= 30_000
    plain.run(20)
    plain.run(1000)
    recorded.run(1000)
    assert len(rows) == count > 0
    assert (plain.board.cycle, plain.board.pc) == (recorded.board.cycle, recorded.board.pc)


def test_each_round_of_a_loop_that_waits_is_recorded(boot, monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        machine = boot("mov32 r1, #0x40021018\nmovs r2, #12\nstr r2, [r1, #0]\n" + READS)  # the ports' clocks
        found.append(machine.board.chip.record_accesses(PINS))
        machine.run(5000)
    assert found[0] == found[1]
    assert len(found[0]) > 5000


def test_an_access_in_two_parts_is_one(boot) -> None:
    machine = boot("mov32 r1, #0x40010808\nldmia r1!, {r2, r3}\nspin: b spin")
    rows = machine.board.chip.record_accesses([Watchpoint(0x4001_0808, 8, WatchKind.READ)])
    machine.run(10)
    assert len(rows) == 1
