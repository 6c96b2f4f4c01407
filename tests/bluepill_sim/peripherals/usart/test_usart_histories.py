"""USART, any history: no character is invented, lost or swapped."""

import itertools
from collections.abc import Callable
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from tests.bluepill_sim.peripherals.usart.usart_line import CHARACTER_NS, ORE, RXNE, TXE, set_up, status

QUICK = settings(max_examples=40)


class UsartMachine(RuleBasedStateMachine):
    """USART1 against a model that counts characters: what goes out, what comes in, what is lost."""

    def __init__(self, chip: Any) -> None:
        super().__init__()
        self.chip = chip
        self.sent = set_up(chip)
        self.base = len(self.sent)
        self.written: list[int] = []
        self.arriving: list[tuple[int, int]] = []
        self.waiting: int | None = None
        self.overrun = self.seen_overrun = False

    @initialize()
    def settle(self) -> None:
        self.chip.advance(self.chip.now_ns + 1)

    @precondition(lambda self: status(self.chip) & TXE)
    @rule(word=st.integers(0, 255))
    def write(self, word: int) -> None:
        self.chip.write("USART1.DR", word)
        self.written.append(word)

    @rule(data=st.binary(min_size=1, max_size=3))
    def receive(self, data: bytes) -> None:
        at_ns = self.arriving[-1][1] if self.arriving else self.chip.now_ns
        for word in data:
            at_ns += CHARACTER_NS
            self.arriving.append((word, at_ns))
        self.chip.parts.usart(1).receive(data)

    @rule(share=st.sampled_from([1, 1000, CHARACTER_NS - 1, CHARACTER_NS, 3 * CHARACTER_NS]))
    def wait(self, share: int) -> None:
        now_ns = self.chip.now_ns + share
        self.chip.advance(now_ns)
        while self.arriving and self.arriving[0][1] <= now_ns:
            word, _ = self.arriving.pop(0)
            if self.waiting is None:
                self.waiting = word
            else:
                self.overrun = True

    @rule()
    def read_status(self) -> None:
        self.seen_overrun = bool(self.chip.read("USART1.SR") & ORE)
        assert self.seen_overrun is self.overrun

    @rule()
    def read_data(self) -> None:
        word = self.chip.read("USART1.DR")
        if self.waiting is not None:
            assert word == self.waiting
        self.waiting = None
        if self.seen_overrun:
            self.overrun = self.seen_overrun = False

    @rule()
    def copy_and_go_on(self) -> None:
        self.chip.parts.restore(self.chip.parts.snapshot())

    @invariant()
    def what_came_out_is_a_prefix_of_what_was_written(self) -> None:
        words = [word for word, _ in self.sent]
        assert words == self.written[: len(words)]
        assert len(self.written) - len(words) <= 2
        assert bool(status(self.chip) & RXNE) is (self.waiting is not None)

    def teardown(self) -> None:
        self.chip.advance(self.chip.now_ns + 3 * CHARACTER_NS)
        assert [word for word, _ in self.sent] == self.written
        times = [at for _, at in self.sent]
        assert all(later - earlier >= CHARACTER_NS for earlier, later in itertools.pairwise(times))


def test_no_character_is_invented_lost_or_swapped(make_fake_chip: Callable[[], Any]) -> None:
    run_state_machine_as_test(lambda: UsartMachine(make_fake_chip()), settings=QUICK)
