"""Boards put to the test at random: ESP32s that take turns, ends that answer anything, and whole emulated boards."""

import re
from collections.abc import Iterator
from random import Random

from adapter_sim.pinout import load_pinout
from robot_bench.wires.board_test.circuit import BoardFault, Side, WireFault
from robot_bench.wires.board_test.emulated import REVISION, EmulatedBoard
from robot_bench.wires.board_test.ends import HeardPad
from robot_bench.wires.board_test.esp32 import CONSOLE, PARTS, PORTS, ROBOT, Esp32, NvsFault, library_path
from robot_bench.wires.board_test.verdicts import judge
from robot_bench.wires.board_test.walk import PATTERN, BoardMeasurement, BoardWalk
from tests.tools.suite.approved import Trace, judge_of, said, tried

PINOUT = load_pinout()
NAMES = [wire.name for wire in PINOUT.wires]
TYPED = ("status", "test on", "wires", "wires 15 5", "wires 0 0", "link 55aa00ff", "link", "test off", "pad", "help",
         "pad pair", "set watchdog_ms 900", "save", "reboot", "nonsense", "")  # fmt: skip
VERSION = re.compile(r"adapter \d+\.\d+\.\d+")
#: The pads that are shown.
LOW_PADS = (1 << 40) - 1


def state_of(one: Esp32) -> str:
    """Return all that a machine shows."""
    state = one.state
    return said([
        one.now_us, one.is_running, [reason.name for reason in one.starts], one.panic, one.nvs_fault, sorted(one.nvs),
        [one.handed_over(port) for port in range(PORTS)], list(state.baud), list(state.lost), state.now_us,
        [[*arriving][:4] for arriving in one._arriving],
        [f"{word & LOW_PADS:x}" for word in (state.levels, state.out, state.driven, state.inputs, state.pulled_up,
                                             state.pulled_down)],
    ])  # fmt: skip


def left_at(one: Esp32) -> str:
    sent = said([one.sent_in_time(port) if port == ROBOT else one.sent(port) for port in range(PORTS)])
    return VERSION.sub("adapter VERSION", sent)


def power_cycle(one: Esp32) -> Iterator[str]:
    """Take the power from a machine and give it back; each time a pad asks for it, and both ports are sent bytes."""
    for power in (one.power_off, one.power_on):
        power()
        yield said([one.is_running, one.connect_pad(1, is_found=True), one.connect_pad(2, is_found=False)])
        one.disconnect_pad()
        one.receive(CONSOLE, b"ab")
        one.receive(ROBOT, bytes(40))
        yield said([[*arriving] for arriving in one._arriving])
        one.run_until(one.now_us + 2_000)
        yield f"{state_of(one)} {left_at(one)}"


def machines(draw: Random) -> Iterator[str]:  # noqa: C901 - one thing that may happen after the other
    """Let machines take turns: type, send, stall, pull EN, change pads, break the flash, and let a pad come and go."""
    boards = [Esp32(), Esp32(), Esp32(library_path(max(PARTS)))]
    yield from map(state_of, boards)
    for _ in range(150):
        one = draw.choice(boards)
        what, now = draw.randrange(12), one.now_us
        if what < 3:
            one.receive(CONSOLE, f"{draw.choice(TYPED)}\r".encode())
        elif what == 3:
            one.receive(ROBOT, bytes(draw.randrange(256) for _ in range(draw.choice((0, 1, 30)))))
        elif what == 4:
            one.receive(ROBOT, b"\xfa\xfb\x03", [now + at for at in draw.choice(((0, 0, 0), (5, 900, 90_000)))])
        elif what == 5:
            (one.power_off if draw.random() < 0.5 else one.power_on)()
        elif what == 6:
            one.put_levels(draw.choice((0, 1 << 4, LOW_PADS, draw.getrandbits(40))))
        elif what == 7:
            one.state.stall_us = draw.choice((0, 500, 900_000, 1_100_000))
        elif what == 8:
            one.nvs_fault = draw.choice([*NvsFault][:3])
        elif what == 9:
            found = one.connect_pad(draw.randrange(3), is_found=draw.random() < 0.7)
            yield f"pad {found} {one.pad(up=True, forward=300, turn=-20)} {one.pad(down=True, backward=512)}"
        elif what == 10:
            one.disconnect_pad()
            yield f"pad {one.pad()}"
        yield said([[*arriving][-3:] for arriving in one._arriving])
        one.run_until(now + draw.choice((0, 1, 87, 1_000, 9_999, 10_000, 150_000, 1_500_000)))
        yield f"{boards.index(one)} {what} {state_of(one)} {left_at(one)}"
    yield said([one.stack_used > 0 for one in boards if one.is_running])
    for one in boards:
        yield from power_cycle(one)
    yield tried(library_path, "rev-z")


class AnyEnds:
    """Both ends of a board in one, that answer by a board with some wires wrong; or, seldom, anything."""

    def __init__(self, draw: Random) -> None:
        self._draw, self.calls = draw, list[str]()
        self._ours = self._theirs = self._levels = self._their_levels = self._pulled = 0
        self._wrong = {draw.randrange(len(NAMES)): draw.choice(("open", "low", "high", "deaf")) for _ in range(5)}
        self._odd, self._mute = draw.choice((0.0, 0.0, 0.03)), draw.choice((0.0, 0.0, 0.3))
        self._resets = draw.choice((-1, NAMES.index("rst"), NAMES.index("rst"), draw.randrange(len(NAMES))))
        self._left = b""

    def _word(self, *, is_near: bool) -> int:
        word = (self._levels & self._ours) | (self._their_levels & self._theirs)
        word |= self._levels & self._pulled & ~self._theirs
        for place, how in self._wrong.items():
            is_high = how == "high" or (how == "open" and is_near and bool(self._levels >> place & 1))
            word = word & ~(1 << place) | is_high << place
        return word ^ (1 << self._draw.randrange(len(NAMES)) if self._draw.random() < self._odd else 0)

    def _is_reset(self) -> bool:
        return self._resets >= 0 and bool(self._levels & self._ours & 1 << self._resets)

    def greet(self) -> int | None:
        self.calls.append("greet")
        return None if self._draw.random() < 0.4 else 0x1C00_0000

    def has_crystal(self) -> bool | None:
        return self._draw.choice((True, True, False, None))

    def pulse(self, driven: int, levels: int) -> int | None:
        self.calls.append(f"pulse {driven:x} {levels:x}")
        held = sum(1 << place for place, how in self._wrong.items() if how == "high")
        low = sum(1 << place for place, how in self._wrong.items() if how == "low")
        return None if self._draw.random() < self._odd else (levels & driven | held) & ~low

    def begin(self) -> str | None:
        self.calls.append("begin")
        if self._is_reset() or self._draw.random() < self._mute:
            return None
        return self._draw.choice(("power-on", "power-on", "brown-out"))

    def end(self) -> None:
        self.calls.append("end")

    def read(self) -> int | None:
        return None if self._is_reset() else self._word(is_near=False)

    def send(self, data: bytes) -> None:
        self.calls.append(f"send {data.hex()}")
        self._left = self._draw.choice((data, b"\xfa" + data, data[1:], b""))

    def received(self) -> bytes:
        self.calls.append("received")
        found, self._left = self._left[:3], self._left[3:]
        return found

    def pad(self) -> HeardPad | None:
        return self._draw.choice((None, HeardPad(None, ""), HeardPad(0, ""), HeardPad(7, "up")))

    def bluepill_hold(self, driven: int, levels: int, pulled: int) -> int | None:
        self.calls.append(f"chip {driven:x} {levels:x} {pulled:x}")
        self._ours, self._levels, self._pulled = driven, levels, pulled
        return None if self._draw.random() < self._odd / 9 else self._word(is_near=True)

    def adapter_hold(self, driven: int, levels: int) -> bool:
        self.calls.append(f"esp {driven:x} {levels:x}")
        self._theirs, self._their_levels = driven, levels
        return not self._is_reset() and self._draw.random() >= self._mute / 9


class ChipSide:
    """The BluePill's end of them."""

    def __init__(self, ends: AnyEnds) -> None:
        self.greet, self.has_crystal, self.pulse = ends.greet, ends.has_crystal, ends.pulse
        self._hold = ends.bluepill_hold

    def hold(self, *, driven: int = 0, levels: int = 0, pulled: int = 0) -> int | None:
        return self._hold(driven, levels, pulled)


class AdapterSide:
    """The adapter's end of them."""

    def __init__(self, ends: AnyEnds) -> None:
        self.begin, self.end, self.read, self.send = ends.begin, ends.end, ends.read, ends.send
        self.received, self.pad, self.hold = ends.received, ends.pad, ends.adapter_hold


def shown(found: BoardMeasurement) -> Iterator[str]:
    yield said(found)
    for row in judge(found, PINOUT, REVISION):
        yield f"  {said(row)} {row.is_fault}"


def measured(draw: Random) -> Iterator[str]:
    """Measure boards whose ends answer well, wrongly, late or not, and judge what was measured."""
    for _ in range(40):
        ends = AnyEnds(draw)
        walk = BoardWalk(ChipSide(ends), AdapterSide(ends), PINOUT)  # type: ignore[arg-type]  # as far as it asks
        found: list[BoardMeasurement] = []
        yield tried(lambda walk=walk, found=found: found.append(walk.measure()))
        yield " ".join(ends.calls)
        for one in found:
            yield from shown(one)


def emulated(draw: Random) -> Iterator[str]:
    """Put emulated boards with faults to the test, and let time pass on them."""
    for number in range(3):
        kinds = draw.sample([WireFault.OPEN, WireFault.GND, WireFault.RAIL, WireFault.UNSOLDERED], 2)
        faults = [BoardFault(kind, draw.choice(NAMES), side=draw.choice([*Side])) for kind in kinds]
        faults.append(BoardFault(draw.choice((WireFault.SHORT, WireFault.SWAPPED)), *draw.sample(NAMES, 2)))  # type: ignore[arg-type]  # two
        board = EmulatedBoard(
            tuple(faults), has_loop_plug=number != 1, between=number == 2, revision=sorted(PARTS)[number % 2]
        )
        for ask in ("i", "x", "s ffffff a5a5a5 0", "nothing"):
            yield said(board.bluepill_end._line.ask(ask, "r " if ask[0] == "s" else ""))
        for ask in ("test on", "wires", f"link {PATTERN.hex()}", "link", "test off"):
            yield said([board.adapter_end._line.ask(ask, ask.split()[0]), board.esp32.now_us])
        board.run_ms(draw.choice((1, 7, 20)))
        yield state_of(board.esp32)
        yield said(sorted((name, round(volts, 4)) for name, volts in board._settle().items()))
        yield said([sorted(board._given.items()), board._changes])
        found = BoardWalk(board.bluepill_end, board.adapter_end, PINOUT).measure()
        yield from shown(found)


TRACES: dict[str, Trace] = {"machines": machines, "measured": measured, "emulated": emulated}
test_what_boards_are_found_to_be_is_what_was_approved = judge_of(__file__, TRACES)
