"""The chip of a recorded run once more, alone: its input pins are given the levels of the trace, or others.

A chip does the same whenever its pins are given the same levels at the same times, and the trace has all of them;
so the replay is the run, to the instruction, without robot and world. What the chip drives is compared with the
trace: `exact_until` is up to when it is the same.

What an input changes is found by running twice, once with the level that was recorded and once with another. The
robot does not answer to what the chip does otherwise then: later inputs stay those of the trace.

Not replayed: a robot on own pins, whose analog inputs no trace holds.

Invariant: looking at a time leaves the replay of all other times as it was.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias, cast

from adapter_sim.pinout import Pull, Wire, WireDirection, WireRole, load_pinout
from bluepill_sim.core import BLOCK, BlockRow
from bluepill_sim.core.debugging.debug_unit import WatchKind, Watchpoint
from bluepill_sim.core.nvic import exception_name
from bluepill_sim.core.recorder import RECORD
from bluepill_sim.errors import ImageError
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, Of
from bluepill_sim.program.functions import UNKNOWN, FunctionTable
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.program.static_code import StaticCode
from bluepill_sim.stm32f103 import SRAM_BASE, SRAM_BYTES, is_in_sram
from robot_bench.recording.run_record import RunRecord
from robot_bench.wires.power_up import ZEROS, power_up
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, Nanos

#: chosen: at most so much is handed to the chip at once; its queue holds 4096 levels of all pins.
FEED_NS: Nanos = 50 * NS_PER_MS
#: After all that is recorded.
_NEVER: Nanos = 1 << 63
#: chosen: how often is looked whether there are too many blocks, or whether two replays have parted; after as long as
#: that brought a small part of the blocks, twice as long, up to `FEED_NS`.
_RECORDED_NS, _SMALL_PART = 5 * NS_PER_MS, 32
#: chosen: between two saved states at first, and how many are kept; of more every other one is dropped.
STRIDE_NS: Nanos = 250 * NS_PER_MS
MOST_STATES = 128
#: GPIOA, B, C: where each port's registers are, and which of them change a pin (CRL to LCKR).
_GPIO, _GPIO_STRIDE, _GPIO_BYTES = 0x4001_0800, 0x400, 0x1C
#: The key register of the independent watchdog (RM0008 19.4.1).
_IWDG_KR = 0x4000_3000
#: So long before a write its calls are looked for.
_CALLS_NS: Nanos = 40 * NS_PER_MS
#: chosen: so many blocks are recorded of one part, some 10 ms of a program that never sleeps, seconds of one that does.
MOST_ROWS = 120_000
#: More than there can be in `FEED_NS`, at 72 MHz.
_ROOM = 4_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """An input that is held at a level for a time, whatever the trace says; None: at the other one, edge for edge."""

    wire: str
    level: bool | None
    since: Nanos
    until: Nanos


@dataclass(frozen=True, slots=True)
class SourcePlace:
    """Where in a program: the source line, and the functions that it was called through, innermost first."""

    line: str
    function: str
    calls: tuple[str, ...] = ()

    def __str__(self) -> str:
        where = f"{self.line} ({self.function})" if self.line else self.function
        return where + (f", called from {self.calls[0]}" if self.calls else "")


#: When a wire changes, and to what.
_Levels: TypeAlias = tuple[Sequence[Nanos], Sequence[int]]
#: A time, until when inputs have been given, and the chip then.
_State: TypeAlias = tuple[Nanos, Nanos, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """Where the chip has come to with inputs that were held: others go on from it."""

    state: _State
    held: Mapping[str, _Levels]
    #: The levels of the outputs.
    levels: Mapping[str, bool]


@dataclass(slots=True)
class ReplayPart:
    """What the chip did in a part of a replay."""

    #: The levels of the outputs when it began.
    levels: Mapping[str, bool] = field(default_factory=dict)
    #: (ns, wire, level).
    edges: list[tuple[Nanos, str, bool]] = field(default_factory=list)
    #: (ns of its stop bit, character) on USART1.
    text: list[tuple[Nanos, int]] = field(default_factory=list)
    #: Blocks and exceptions, where they were asked for: bytes of `RECORD` each.
    packed_rows: bytes = b""
    #: Whether there were more.
    has_more_rows: bool = False
    #: (ns, the program's variables), where they were asked for.
    memory: list[tuple[Nanos, bytes]] = field(default_factory=list)

    @property
    def rows(self) -> Iterator[BlockRow]:
        """Blocks and exceptions, one after the other."""
        return RECORD.iter_unpack(self.packed_rows)

    def row(self, place: int) -> BlockRow:
        """Return one of them."""
        cycle, address, kind = RECORD.unpack_from(self.packed_rows, place * RECORD.size)
        return cycle, address, kind

    def levels_at(self, at: Nanos) -> dict[str, bool]:
        """Return the levels of the outputs at a time in it."""
        return {**self.levels, **{net: level for t, net, level in self.edges if t <= at}}


@dataclass(frozen=True, slots=True)
class ChipReset:
    """A reset of the chip after power-on."""

    at: Nanos
    cause: str
    place: SourcePlace


class ChipReplay:
    """Replays the chip of a run.

    Args:
        firmware: The program that ran.
        record: The run.

    Raises:
        UsageError: The trace does not hold what the chip was given.
        ImageError: The firmware cannot be read.
        MissingDependencyError: The emulator is not installed.
    """

    def __init__(self, firmware: Path, record: RunRecord) -> None:
        wires = load_pinout().wires
        if missing := [wire.name for wire in wires if wire.name not in record.pins]:
            raise UsageError(f"the trace has not the wires of the pin-out, such as {missing[0]}")
        self.record = record
        meta = record.meta
        self.board = power_up(
            firmware, sram=str(meta.get("sram", ZEROS)), crystal_ppm=int(cast("int", meta.get("crystal_ppm") or 0)),
            latency_cycles=int(cast("int", meta.get("interrupt_latency_cycles") or 0)),
            seed=int(cast("int", meta.get("seed") or 0)),
        )  # fmt: skip
        self.wires: Mapping[str, Wire] = {wire.name: wire for wire in wires}
        self.inputs = [wire.name for wire in wires if wire.direction is WireDirection.TO_BLUEPILL]
        self.outputs = [wire.name for wire in wires if wire.direction is WireDirection.TO_ADAPTER]
        self._net_of = {_number(wire.bluepill): wire.name for wire in wires}
        self._functions = FunctionTable(self.board.image)
        self._code = StaticCode(self.board.chip.memory)
        try:
            self._lines = read_lines(self.board.image)
        except ImageError:
            self._lines = LineTable()
        self._seen = ReplayPart()
        self._held: dict[str, _Levels] = {}
        #: Until when the inputs have been given, and when the next one changes.
        self._given: Nanos = 0
        self._next_input: Nanos = 0
        self.resets: list[ChipReset] = []
        self.end: Nanos = record.last_ns
        self.board.subscribe_pins([self.wires[net].bluepill for net in self.outputs], self._driven, of=Of.WIRE)
        self.board.usart1.subscribe(lambda rows: self._seen.text.extend((at, word & 0xFF) for word, at in rows))
        for net in self.outputs:
            wire = self.wires[net]
            if wire.pull is not Pull.NONE:
                self.board.pin(wire.bluepill).drive(wire.pull is Pull.UP, is_weak=True)
        for net in self.inputs:
            self.board.pin(self.wires[net].bluepill).drive(bool(record.pins[net].levels[0]))
        self._states = [self._state()]
        self.exact_until = self._run_once()

    # What the trace and the program say.

    def role(self, role: WireRole) -> list[str]:
        """Return the wires of a role, in the order of the pin-out."""
        return [net for net, wire in self.wires.items() if wire.role is role]

    def pin(self, net: str) -> str:
        """Return a wire as a person reads it: "DD4 (PA7)"."""
        return f"{net} ({self.wires[net].bluepill})"

    def level(self, net: str, at: Nanos) -> bool:
        """Return the recorded level of a wire at a time."""
        edges = self.record.pins[net]
        return bool(edges.levels[max(0, bisect_right(edges.times, at) - 1)])

    def high_since(self, net: str, at: Nanos) -> Nanos | None:
        """Return since when a wire is high at a time; None where it is low, or was high from the beginning."""
        edges = self.record.pins[net]
        place = bisect_right(edges.times, at) - 1
        return edges.times[place] if place > 0 and edges.levels[place] else None

    def line(self, address: int) -> SourcePlace:
        """Return where an instruction stands in the source."""
        name = self._functions.name(address)
        return SourcePlace(self._lines.place(address), f"0x{address:08x}" if name == UNKNOWN else name)

    def end_line(self, block: int) -> SourcePlace:
        """Return where the last instruction of a block stands, which decides what follows it."""
        found = self._code.block(block)
        return self.line(found.addresses[-1] if found.addresses else block)

    def variable_at(self, offset: int) -> str:
        """Return the variable at an offset into the SRAM, in words; its address where no name is known."""
        address = SRAM_BASE + offset
        for symbol in self.board.image.symbols.symbols:
            if not symbol.is_function and symbol.address <= address < symbol.address + symbol.size:
                return f"variable {symbol.name}"
        return f"what is at 0x{address:08x}"

    @property
    def variables(self) -> list[tuple[str, int, int]]:
        """The program's variables: name, offset into the SRAM, bytes."""
        return [
            (symbol.name, symbol.address - SRAM_BASE, symbol.size)
            for symbol in self.board.image.symbols.symbols
            if not symbol.is_function and symbol.size and is_in_sram(symbol.address)
        ]

    # Running.

    def run(
        self, since: Nanos, until: Nanos, holds: Sequence[Hold] = (), *, rows: bool = False, memory_ns: Nanos = 0,
        branch: Branch | None = None, beside: ReplayPart | None = None, ends_parted: bool = False,
    ) -> ReplayPart:  # fmt: skip
        """Run a part again.

        Args:
            since: From when on is told what the chip does.
            until: To when.
            holds: Inputs that are otherwise; from `since` on at the earliest.
            rows: Whether blocks and exceptions are wanted.
            memory_ns: How often the variables are wanted; 0 for never.
            branch: Where it goes on from, at `since`, with what is held there; None: from the run as it was.
            beside: What it is compared with, of the same time, with `rows` and `memory_ns` alike: soon after the two
                have parted, neither blocks nor variables are told any more.
            ends_parted: Whether the replay ends there.
        """
        if branch is None:
            self._seek(since)
        else:
            self._restore(branch.state, branch.held)
        self._hold(holds)
        levels = branch.levels if branch is not None else {net: self.level(net, since) for net in self.outputs}
        self._seen = seen = ReplayPart(levels=levels)
        try:
            if rows and self._go_on_recording(until, memory_ns, beside):
                memory_ns, until = 0, self.board.now_ns if ends_parted else until
            self._go_on(until, memory_ns)
        finally:
            self._held = {}
        return seen

    def branch(self, since: Nanos, until: Nanos, holds: Sequence[Hold]) -> Branch:
        """Run a part with inputs that are otherwise and return where the chip has come to by then.

        Args:
            since: From when on.
            until: To when.
            holds: Inputs that are otherwise, in runs that go on from there, too.
        """
        self._seek(since)
        self._hold(holds)
        held, self._seen = self._held, ReplayPart(levels={net: self.level(net, since) for net in self.outputs})
        self._go_on(until)
        return Branch(state=self._state(), held=held, levels=self._seen.levels_at(until))

    def writer(self, at: Nanos, port: str) -> SourcePlace | None:
        """Return which instruction drove a pin of a port ("A") at a time; None where no store to the port did."""
        calls: list[str] = []
        for before in (_CALLS_NS, _CALLS_NS // 8, _CALLS_NS // 64):
            seen = self.run(max(0, at - before), at + 1, rows=True)
            if not seen.has_more_rows:
                calls = self._calls(seen.rows)
                break
        hits = self._watch(at - 20_000, at + 2, _of_port(port, WatchKind.WRITE))
        if not hits:
            return None
        place = self.line(hits[-1][1])
        return SourcePlace(place.line, place.function, tuple(call for call in calls if not call.startswith(place.line)))

    def reads(self, since: Nanos, until: Nanos) -> dict[str, list[Nanos]]:
        """Return by which source lines a program reads the levels of ports in a time, and when."""
        found: dict[str, list[Nanos]] = {}
        points = [_of_port(port, WatchKind.READ, first=8, size=4) for port in "ABC"]
        for at, pc in self._watch(since, until, *points):
            found.setdefault(str(self.line(pc)), []).append(at)
        return found

    def feeds(self, since: Nanos, until: Nanos) -> list[tuple[Nanos, SourcePlace]]:
        """Return when, and where, a program writes the key register of the independent watchdog."""
        return [(at, self.line(pc)) for at, pc in self._watch(since, until, Watchpoint(_IWDG_KR, 4, WatchKind.WRITE))]

    def _watch(self, since: Nanos, until: Nanos, *points: Watchpoint) -> list[tuple[Nanos, int]]:
        """Return when, and by which instruction, a program makes an access that is watched for."""
        self._seek(max(0, since))
        board = self.board
        now = board.now_ns
        found = board.chip.record_accesses(points)
        try:
            while now < until:
                limit = min(until, now + FEED_NS)
                self._feed(limit)
                now = board.advance_to(limit).now
        finally:
            board.chip.stop_recording()
        return [(at, pc) for at, pc in found if at < until]

    def _calls(self, rows: Iterable[BlockRow]) -> list[str]:
        """Return the places that the last block was called from, innermost first, as far as the rows tell."""
        stack: list[tuple[str, str]] = []
        last: int | None = None
        for _, address, kind in rows:
            if kind != BLOCK:
                if kind > 0:
                    stack.append((exception_name(kind), ""))
                elif any(not place for _, place in stack):
                    while stack and stack.pop()[1]:
                        pass
                last = None
                continue
            name = self._functions.name(address)
            if last is not None and name != self._functions.name(last):
                if address == self._functions.start_of(address) and self._code.block(last).is_call:
                    stack.append((self._functions.name(last), str(self.end_line(last))))
                else:
                    while stack and stack[-1][1] and stack[-1][0] != name:
                        stack.pop()
                    if stack and stack[-1][1]:
                        stack.pop()
            last = address
        return [place for _, place in reversed(stack) if place]

    def _run_once(self) -> Nanos:
        """Run the whole once, keep states, note resets; return up to when it is the run."""
        board, stride = self.board, STRIDE_NS

        def reset_begins() -> None:
            if board.now_ns > 0:
                before.append((board.now_ns, board.pc))

        before: list[tuple[Nanos, int]] = []
        causes = dict(board.resets)
        board.chip.reset_listeners.append(reset_begins)
        seen = self._seen = ReplayPart()
        try:
            while board.now_ns < self.end:
                self._go_on(min(self.end, board.now_ns + stride))
                for cause, count in board.resets.items():
                    for _ in range(count - causes.get(cause, 0)):
                        at, pc = before.pop(0) if before else (board.now_ns, board.pc)
                        self.resets.append(ChipReset(at, cause.name, self.line(pc)))
                causes = dict(board.resets)
                self._states.append(self._state())
                if len(self._states) > MOST_STATES:
                    self._states, stride = self._states[::2], stride * 2
        finally:
            board.chip.reset_listeners.remove(reset_begins)
        return self._same_until(seen)

    def _same_until(self, seen: ReplayPart) -> Nanos:
        same = self.end
        for net in self.outputs:
            rows = self.record.pins[net]
            ours = changes(bool(rows.levels[0]), [(at, up) for at, wire, up in seen.edges if wire == net])
            theirs = [at for at in rows.times if at > 0]
            if ours != theirs:
                pairs = zip([*ours, self.end + 1], [*theirs, self.end + 1], strict=False)
                same = min(same, next((min(a, b) for a, b in pairs if a != b), self.end + 1) - 1)
        return max(0, same)

    def _seek(self, at: Nanos) -> None:
        self._restore(self._states[bisect_right(self._states, at, key=itemgetter(0)) - 1])
        self._go_on(at)

    def _state(self) -> _State:
        return self.board.now_ns, self._given, self.board.snapshot()

    def _restore(self, state: _State, held: Mapping[str, _Levels] = MappingProxyType({})) -> None:
        _, self._given, chip = state
        self.board.restore(chip)
        self._held = dict(held)
        self._next_input = 0

    def _go_on_recording(self, until: Nanos, memory_ns: Nanos, beside: ReplayPart | None) -> bool:
        """Run on with the blocks recorded, until there are too many; return whether it has parted from another run."""
        board, seen = self.board, self._seen
        rows, slice_ns, has_parted = bytearray(), _RECORDED_NS, False
        recorder = board.chip.record_blocks(_ROOM)
        try:
            while board.now_ns < until and not has_parted and len(rows) < MOST_ROWS // 2 * RECORD.size:
                self._go_on(min(until, board.now_ns + slice_ns), memory_ns)
                new = recorder.drain_packed()
                rows += new
                has_parted = beside is not None and _have_parted(beside, rows, len(new), seen.memory)
                is_slow = len(new) * _SMALL_PART < MOST_ROWS * RECORD.size
                slice_ns = min(FEED_NS, 2 * slice_ns) if is_slow else _RECORDED_NS
        finally:
            board.chip.stop_recording()
        seen.has_more_rows = board.now_ns < until or len(rows) > MOST_ROWS * RECORD.size
        seen.packed_rows = bytes(rows[: MOST_ROWS * RECORD.size])
        return has_parted

    def _go_on(self, until: Nanos, memory_ns: Nanos = 0) -> None:
        board, seen = self.board, self._seen
        step = min(memory_ns or FEED_NS, FEED_NS)
        now = board.now_ns
        while now < until:
            limit = min(until, now + step)
            self._feed(limit)
            now = board.advance_to(limit).now
            if memory_ns:
                seen.memory.append((now, board.read_memory(SRAM_BASE, self._variable_bytes) or b""))

    @cached_property
    def _variable_bytes(self) -> int:
        # Of a program without symbols all of the SRAM, its stack too: so it notices at least what it would with them.
        return max((offset + size for _, offset, size in self.variables), default=SRAM_BYTES)

    def _feed(self, limit: Nanos) -> None:
        """Give the input pins what is recorded, or held, until `limit`."""
        given, self._given = self._given, limit
        if limit < self._next_input:
            return
        following = [_NEVER]
        for net in self.inputs:
            times, levels = self._held.get(net) or (self.record.pins[net].times, self.record.pins[net].levels)
            first, end = bisect_right(times, given), bisect_right(times, limit)
            following.extend(times[end : end + 1])
            if first < end:
                rows = [(times[place], int(levels[place])) for place in range(first, end)]
                self.board.pin(self.wires[net].bluepill).drive_later(rows)
        self._next_input = min(following)

    def _hold(self, holds: Sequence[Hold]) -> None:
        """Make the levels of the inputs that are held; a hold acts from the next instant on."""
        now, self._next_input = self.board.now_ns, 0
        for hold in holds:
            edges = self.record.pins[hold.wire]
            times, levels = self._held.get(hold.wire) or (edges.times, edges.levels)
            since = max(hold.since, now + 1)
            before, after = bisect_left(times, since), bisect_right(times, hold.until)
            rows = [(since, int(bool(hold.level)))]
            if hold.level is None:
                inside = bisect_right(times, since)
                rows = [(since, int(not levels[max(0, inside - 1)]))]
                rows += [(times[place], int(not levels[place])) for place in range(inside, after)]
            rows.append((hold.until, levels[max(0, after - 1)]))
            self._held[hold.wire] = (
                [*times[:before], *(at for at, _ in rows), *times[after:]],
                [*levels[:before], *(level for _, level in rows), *levels[after:]],
            )

    def _driven(self, rows: bytes) -> None:
        for at, pin, _, level, *_ in self._edges(rows):
            self._seen.edges.append((at, self._net_of[pin], level == HIGH))

    @staticmethod
    def _edges(rows: bytes) -> Iterator[tuple[int, ...]]:
        return EDGE.iter_unpack(rows)


def changes(level: bool, rows: Sequence[tuple[Nanos, bool]]) -> list[Nanos]:
    """Return when a wire changes, of the levels reported of it; a pin that drives what the wire is anyway does not."""
    found = []
    for at, after in rows:
        if after is not level:
            found.append(at)
        level = after
    return found


def _have_parted(beside: ReplayPart, rows: bytearray, new: int, memory: Sequence[tuple[Nanos, bytes]]) -> bool:
    """Tell whether a replay's last `new` bytes of rows, or its variables, differ from those of another one."""
    since, theirs = len(rows) - new, beside.packed_rows
    end = min(len(rows), len(theirs)) if beside.has_more_rows else len(rows)
    return rows[since:end] != theirs[since:end] or any(
        ours != others for (_, ours), (_, others) in zip(memory, beside.memory, strict=False)
    )


def _of_port(port: str, kind: WatchKind, *, first: int = 0, size: int = _GPIO_BYTES) -> Watchpoint:
    """Return what stops at an access to registers of a port ("A")."""
    return Watchpoint(_GPIO + _GPIO_STRIDE * (ord(port) - ord("A")) + first, size, kind)


def _number(pin: str) -> int:
    return 16 * (ord(pin[1]) - ord("A")) + int(pin[2:])
