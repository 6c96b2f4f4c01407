"""An SPI ahead of the edges that it shows, and waves that stores reshape: the rows that the Python executor tells.

The Python executor acts on each half of a bit at its time; the native core makes the edges of a word when somebody
looks, or changes something, and at its end.
"""

import struct
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.stm32f103 import BASES
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_random_registers import state
from tests.bluepill_sim.native.test_native_warned import PROGRAM, TABLE

RCC, GPIOA, GPIOB, SPI1, TIM3, AFIO = (BASES[name] for name in ("RCC", "GPIOA", "GPIOB", "SPI1", "TIM3", "AFIO"))
CR1, CR2, SR, DR = SPI1, SPI1 + 4, SPI1 + 8, SPI1 + 12
STORE, LOAD, POLL = 1, 4, 5
#: On: a master of 250 kHz whose NSS is a bit, SCK and MOSI, PA6 and PB0 outputs of TIM3 (PA6 is MISO too).
MASTER = 1 << 2 | 1 << 6 | 1 << 8 | 1 << 9
Row = tuple[int, int, int]
SET_UP: tuple[Row, ...] = (
    (STORE, RCC + 0x18, 0x100D),
    (STORE, RCC + 0x1C, 2),
    (STORE, GPIOA, 0xBBB3_4444),
    (STORE, GPIOB, 0x4444_443B),
    (STORE, TIM3 + 0x2C, 99),
    (STORE, TIM3 + 0x18, 0x60),
    (STORE, TIM3 + 0x1C, 0x70),
    (STORE, TIM3 + 0x34, 30),
    (STORE, TIM3 + 0x3C, 60),
    (STORE, TIM3 + 0x20, 0x101),
    (STORE, CR1, MASTER | 4 << 3),
)
MODES = st.sampled_from([0xBBB3_4444, 0xB8B3_4444, 0xF8F3_4444, 0x3834_4444])
WORDS = st.integers(0, 0xFFFF)
CONTROLS = st.builds(
    lambda divider, bits: MASTER | divider << 3 | bits,
    st.integers(2, 6),
    st.sampled_from([0, 1, 2, 3, 1 << 7, 1 << 10, 1 << 11, 1 << 13, 3 << 14, 1 << 15]),
)
SENDS = st.tuples(st.just(STORE), st.just(DR), WORDS)
ROWS = st.lists(
    st.one_of(
        SENDS,
        st.tuples(st.sampled_from([LOAD, POLL]), st.sampled_from([SR, DR, GPIOA + 8, GPIOB + 8, CR1]), st.just(0)),
        st.tuples(st.just(STORE), st.just(CR1), CONTROLS),
        st.tuples(st.just(STORE), st.just(CR2), st.sampled_from([0, 4])),
        st.tuples(st.just(STORE), st.sampled_from([GPIOA + 0x10, GPIOB + 0x10]), st.integers(0, 0xFFFF_FFFF)),
        st.tuples(st.just(STORE), st.just(GPIOA), MODES),
        st.tuples(st.just(STORE), st.just(AFIO + 4), st.sampled_from([0, 1, 0x0200_0001])),
        st.tuples(st.just(STORE), st.just(RCC + 0x0C), st.sampled_from([0, 0x1000])),
        st.tuples(st.just(STORE), st.sampled_from([TIM3 + 0x34, TIM3 + 0x3C]), st.integers(0, 101)),
        st.tuples(st.just(STORE), st.just(TIM3), st.sampled_from([0, 1, 1, 0x11, 0x21])),
        st.tuples(st.just(STORE), st.just(TIM3 + 0x20), st.sampled_from([0x101, 0x303, 0x001])),
    ),
    min_size=1, max_size=12,
)  # fmt: skip
#: A word is under way at each of them.
ACTS = st.tuples(WORDS, ROWS).map(lambda pair: [row for act in pair[1] for row in ((STORE, DR, pair[0]), act)])
SLICES = st.lists(st.integers(100, 60_000), max_size=4)
END_NS = 200_000


class Seen:
    """A board that runs a table, and all that subscribers are told of its pins."""

    def __init__(self, core: str, rows: list[Row], *, stops: frozenset[str] = frozenset()) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            self.board: BluePill = Machine(PROGRAM, {}).deafen().board
        packed = b"".join(struct.pack("<III", *row) for row in (*SET_UP, (STORE, TIM3, 1), *rows))
        self.board.chip.memory.write(TABLE, packed + bytes(4))
        self._reported: list[list[bytes]] = [[], [], []]
        names = [pin.name for pin in self.board.pins]
        for seen, of, waves in zip(self._reported, (Of.DRIVE, Of.WIRE, Of.DRIVE), (False, False, True), strict=True):
            self.board.subscribe_pins(names, seen.append, of=of, waves=waves, ends_slice=stops)

    def ended(self, *slices: int) -> Any:
        """Return what was seen by the end, and how the chip stands there."""
        for length in slices:
            self.board.advance_to(self.board.now_ns + length)
            assert self.board.chip.fabric.last_output_ns <= self.board.now_ns
        self.board.advance_to(END_NS)
        edges = [sorted(EDGE.iter_unpack(b"".join(reported))) for reported in self._reported[:2]]
        return edges, b"".join(self._reported[2]), self.board.chip.fabric.last_output_ns, state(self.board)


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=ACTS, slices=SLICES)
def test_the_edges_are_those_of_each_half_at_its_time(rows: list[Row], slices: list[int], watchdog: None) -> None:
    compare(rows, slices)


@pytest.mark.soak
@settings(max_examples=3_000)
@given(rows=ACTS, slices=SLICES)
def test_many_edges_are_those_of_each_half_at_its_time(rows: list[Row], slices: list[int]) -> None:
    compare(rows, slices)


def compare(rows: list[Row], slices: list[int]) -> None:
    expected = Seen("python", rows).ended()
    assert Seen("native", rows).ended() == expected
    assert Seen("native", rows).ended(*slices) == expected
