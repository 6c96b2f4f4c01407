"""Characters that the native core sends by itself: the Python executor's, at the same times, in the same states."""

import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_core import state

USART1, EXCEPTION = 0x4001_3800, 16 + 37
TXEIE, TCIE, RXNEIE = 1 << 7, 1 << 6, 1 << 5
ENABLED = 1 << 13 | 1 << 3 | 1 << 2

#: USART1 on PA9, sending one character an interrupt: r4 counts down, then `last` is done; r5 is the character.
PROGRAM = f"""
mov32 r0, #0x40021018
mov32 r1, #0x00004004
str r1, [r0, #0]
mov32 r0, #0x40010804
mov32 r1, #0x444444A4
str r1, [r0, #0]
mov32 r6, #{USART1}
mov32 r1, #{{baud}}
str r1, [r6, #8]
mov32 r1, #{{stop}}
str r1, [r6, #16]
mov32 r0, #0xE000E104
movs r1, #0x20
str r1, [r0, #0]
mov32 r4, #{{count}}
movs r5, #65
mov32 r1, #{{control}}
str r1, [r6, #12]
{{main}}
sleep: wfi
b sleep
handler: ldr r0, [r6, #0]
{{received}}
str r5, [r6, #4]
adds r5, #1
subs r4, #1
bne back
{{last}}
back: bx lr
"""
#: What the handler does after the last character.
LAST = {
    "no more interrupts": f"mov32 r1, #{ENABLED}\nstr r1, [r6, #12]",
    "another speed": "movs r1, #40\nstr r1, [r6, #8]\nmov32 r4, #1000",
    "off": "movs r1, #0\nstr r1, [r6, #12]",
    "a break": f"mov32 r1, #{ENABLED | 1}\nstr r1, [r6, #12]",
    "the pin for something else": "mov32 r0, #0x40010804\nmov32 r1, #0x44444444\nstr r1, [r0, #0]\nmov32 r4, #1000",
}
PROGRAMS = st.fixed_dictionaries(
    {
        "baud": st.sampled_from([16, 17, 69, 833]),
        "stop": st.sampled_from([0, 1 << 12, 2 << 12, 3 << 12]),
        "count": st.integers(1, 12),
        "control": st.sampled_from([TXEIE, TCIE, TXEIE | TCIE, TXEIE | RXNEIE, TXEIE | 1 << 12]).map(
            lambda bits: bits | ENABLED
        ),
        "main": st.sampled_from(["nop", "str r5, [r6, #4]", "strb r5, [r6, #4]", "strh r5, [r6, #4]"]),
        "received": st.sampled_from(["nop", "ldr r0, [r6, #4]"]),
        "last": st.sampled_from(list(LAST.values())),
    }
)


def make(source: str, core: str) -> BluePill:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        return Machine(source, {EXCEPTION: "handler"}).deafen().board


def live(board: BluePill, seed: int, slices: int) -> list[tuple[Any, ...]]:
    """Run in slices of all lengths, some with characters from outside; return all states and what was sent."""
    dice = random.Random(seed)
    found: list[tuple[Any, ...]] = []
    for _ in range(slices):
        if dice.random() < 0.2:
            board.usart1.receive(dice.randbytes(dice.choice([1, 3])))
        board.advance_to(board.now_ns + dice.choice([1, 999, 20_000, 250_000, 1_500_000]))
        sent = bytes(board.usart1.unread), board.activity.last_usart_ns, tuple(board.warnings)
        found.append((state(board), sent))
    return found


@pytest.mark.slow
@settings(max_examples=40)
@given(choices=PROGRAMS, seed=st.integers(0, 1000))
def test_every_slice_ends_alike(choices: dict[str, Any], seed: int) -> None:
    source = PROGRAM.format(**choices)
    native, python = (live(make(source, core), seed, 12) for core in ("native", "python"))
    for number, (one, other) in enumerate(zip(native, python, strict=True)):
        assert one[1] == other[1], number
        for name in one[0]:
            assert one[0][name] == other[0][name], (number, name)


def streaming(count: int = 1_000_000) -> str:
    last = LAST["no more interrupts"]
    return PROGRAM.format(baud=69, stop=0, count=count, control=ENABLED | TXEIE, main="nop", received="nop", last=last)


def test_characters_come_out_while_nobody_listens_and_python_is_not_asked() -> None:
    board = make(streaming(), "native")
    board.advance_to(1_000_000)
    calls = 0
    engine = board.chip.engine

    def counted(*_arguments: int) -> int:
        nonlocal calls
        calls += 1
        return 0

    engine._read_io = engine._write_io = counted
    board.advance_to(200_000_000)
    assert calls == 0
    character_ns = 10 * 69 * 125
    assert abs(len(board.usart1.unread) - 200_000_000 // character_ns) <= 2
    assert board.usart1.unread[:30] == bytes(range(65, 95))


@pytest.mark.parametrize("ends_slice", [False, True])
def test_who_subscribes_hears_each_character_with_its_time(ends_slice: bool) -> None:
    heard: dict[str, list[tuple[int, int]]] = {"native": [], "python": []}
    for core, words in heard.items():
        board = make(streaming(200), core)
        board.usart1.subscribe(words.extend, ends_slice=ends_slice)
        board.run_for(30_000_000)
    assert heard["native"] == heard["python"]
    assert len(heard["native"]) == 200


def test_a_listener_that_fails_loses_no_time_of_the_line() -> None:
    board, twin = make(streaming(), "native"), make(streaming(), "native")

    def fail(_rows: object) -> None:
        raise RuntimeError("the far end is gone")

    close = board.usart1.subscribe(fail)
    with pytest.raises(RuntimeError, match="gone"):
        board.advance_to(3_000_000)
    close()
    for one in (board, twin):
        one.advance_to(8_000_000)
    assert state(board) == state(twin)


def test_a_fork_in_the_middle_of_a_stream_goes_on_alike() -> None:
    native, python = make(streaming(), "native"), make(streaming(), "python")
    native.advance_to(3_456_789)
    python.restore(native.snapshot())
    for board in (native, python):
        board.advance_to(9_876_543)
    assert state(native) == state(python)


def test_more_characters_than_fit_in_a_slice_lose_none() -> None:
    board = make(PROGRAM.format(baud=16, stop=0, count=1_000_000, control=ENABLED | TXEIE, main="nop", received="nop",
                                last="nop"), "native")  # fmt: skip
    words: list[int] = []
    board.advance_to(60_000_000)
    words += board.usart1.read()
    assert len(words) > 2 * 1024
    assert words == [(65 + n) & 0xFF for n in range(len(words))]
