"""Races of a binary with its interrupts: whether what it puts out hangs on a few cycles of their latency.

Theory of operation. A program is run as it is, and again under latencies that are drawn (`InterruptLatency`). Where a
run puts out something else, the interrupts before that are put off one by one, the last first, a cycle more each time:
a pair of runs is looked for that are the same up to one interrupt, which one of them takes an instruction later than
the other, and that part there. So the two orders of interrupt and instruction are known, and nothing else differs.

What is compared is which levels each pin shows one after the other, which characters each USART sends, and the order
of all these; times are not. A handler that comes later moves what the program does by its own length, and what a
program counts from a handler on moves with each latency. So from one thing to the next of a pin the time may be
another by two stretches of handlers and a latency for each interrupt between (`Slack`); what is off by more is one
thing too many or too few. And two things of different pins are in the other order only where they are farther apart
than a stretch and all latencies so far.

Not seen: what leaves by no pin and no USART; a race that needs a longer delay, or an interrupt that comes earlier.
Invariant: the same program, span, seed and stimuli give the same findings.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import merge

from bluepill_sim.board import BluePill
from bluepill_sim.core import EXCEPTION_RETURN, BlockRecorder, BlockRow
from bluepill_sim.core.nvic import exception_name
from bluepill_sim.core.recorder import RECORD
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE
from bluepill_sim.native.interrupt_latency import ALL, MOST_CYCLES
from bluepill_sim.peripherals.usart import PINS
from bluepill_sim.program.image import Image
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.stm32f103 import BONDED_PINS
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: Returns what brings a board to a time, with what is done to it from outside.
Play = Callable[[BluePill], Callable[[Nanos], object]]
#: chosen: so many findings are kept apart; each takes some thirty runs.
MOST_FINDINGS = 4
#: chosen: so many things of each order a finding shows.
SHOWN = 4
#: chosen: rows that a look at one interrupt keeps; a stretch of `_LOOK_NS` has fewer.
_ROOM = 1 << 18
_LOOK_NS: Nanos = NS_PER_MS
#: chosen: so many interrupts before a parting are tried, the last first.
_TRIED = 4
_LEVELS = {PinDrive.NONE: "released", PinDrive.LOW: "low", PinDrive.HIGH: "high", PinDrive.PULL_UP: "pulled up"}
_USARTS = (1, 2, 3)
#: Of the words of a row, the one that says its kind.
KIND_PLACE = 3


@dataclass(slots=True)
class Channel:
    """What one pin, or one USART, put out: when, and what, oldest first."""

    times: list[Nanos] = field(default_factory=list)
    values: list[int] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutputs:
    """All that a run put out up to its end."""

    channels: Mapping[str, Channel]
    end: Nanos
    #: How many interrupts came that could be put off; 0 where none was.
    interrupts: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Slack:
    """By how much two runs may differ in time that only differ in latencies."""

    #: One latency at the most.
    latency_ns: Nanos
    #: For so long handlers ran in one go, at the most.
    stretch_ns: Nanos
    #: When each exception was entered.
    entries: Sequence[Nanos]

    def between(self, begin: Nanos, end: Nanos) -> Nanos:
        """Return by how much the time from one thing to the next, at these times, may be another."""
        return 2 * self.near + self.latency_ns * (bisect_right(self.entries, end) - bisect_right(self.entries, begin))

    def order(self, at: Nanos) -> Nanos:
        """Return how far apart two things of one run have to be at a time for their order to count."""
        return self.near + self.latency_ns * bisect_right(self.entries, at)

    @property
    def near(self) -> Nanos:
        """By how much one late interrupt moves what a program does."""
        return self.latency_ns + self.stretch_ns


@dataclass(frozen=True, slots=True)
class OutputParting:
    """Where two runs first put out something else: of which channel, from which of its items on."""

    at: Nanos
    channel: str
    place: int
    #: Of another channel, where the two are in the other order.
    other: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Latencies:
    """What `InterruptLatency.vary` is given."""

    seed: int
    most: int
    until: int = ALL
    last: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class InterruptOrder:
    """Where an interrupt is taken, and what the run then puts out from the parting on."""

    #: Of the instruction in front of which it is taken.
    address: int
    cycle: int
    puts_out: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Race:
    """Two orders of an interrupt and an instruction of which one puts out something else."""

    exception: int
    #: In front of the instruction, and behind it.
    before: InterruptOrder
    behind: InterruptOrder
    parting: OutputParting
    latencies: Latencies

    @property
    def name(self) -> str:
        """What the interrupt is called."""
        return exception_name(self.exception)


@dataclass(frozen=True, slots=True, kw_only=True)
class RaceReport:
    """What came of a search."""

    runs: int
    #: How many of them put out something else.
    differing: int
    races: tuple[Race, ...]
    #: Of the program as it is.
    interrupts: int
    stretch_ns: Nanos
    lines: LineTable
    image: Image

    def place(self, address: int) -> str:
        """Return an address with symbol and source line."""
        return f"{self.image.symbols.where(address)} {self.lines.place(address)}".rstrip()


class RaceSearch:
    """Looks for races of a program.

    Args:
        image: The program.
        span_ns: So long it runs.
        play: How it is run, and what is done to it.
        most: Cycles by which an interrupt may be late.
        look: Called between two runs; may raise to end it.
    """

    def __init__(
        self, image: Image, span_ns: Nanos, play: Play, *, most: int = MOST_CYCLES,
        look: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self._image, self._span_ns, self._play, self._most, self._look = image, span_ns, play, most, look
        self._slack: Slack
        self._as_it_is: RunOutputs

    def search(self, seeds: Sequence[int]) -> RaceReport:
        """Run the program once as it is and once under the latencies of each seed, and narrow down what differs.

        Raises:
            BluePillError: The core does not take interrupts at the instruction.
        """
        self._observe()
        found: dict[tuple[int, int], Race] = {}
        differing = 0
        for seed in seeds:
            drawn = Latencies(seed=seed, most=self._most)
            outputs = self._run(drawn, self._span_ns)
            parting = self._parting(outputs)
            if parting is None:
                continue
            differing += 1
            if len(found) < MOST_FINDINGS:
                race = self._narrowed(drawn, parting)
                if race is not None:
                    found.setdefault((race.exception, race.before.address), race)
        return RaceReport(
            runs=len(seeds), differing=differing, races=tuple(found.values()), interrupts=self._as_it_is.interrupts,
            stretch_ns=self._slack.stretch_ns, lines=_lines_of(self._image), image=self._image,
        )  # fmt: skip

    def _observe(self) -> None:
        """Run the program as it is, and see how long its handlers take."""
        board, advance = self._board(Latencies(seed=0, most=0))
        recording, stretches = OutputRecording(board), HandlerStretches()
        board.chip.engine.recorder = stretches
        advance(self._span_ns)
        board.chip.stop_recording()
        self._as_it_is = recording.taken(self._span_ns)
        hz = board.hclk_hz
        self._slack = Slack(
            latency_ns=-(-self._most * NS_PER_S // hz), stretch_ns=-(-stretches.longest * NS_PER_S // hz),
            entries=[max(board.chip.ns_of(cycle), 0) for cycle in stretches.entries],
        )  # fmt: skip

    def _board(self, latencies: Latencies) -> tuple[BluePill, Callable[[Nanos], object]]:
        self._look()
        board = BluePill(self._image)
        board.chip.latency.vary(
            seed=latencies.seed, most=latencies.most, until=latencies.until, last=latencies.last
        )  # fmt: skip
        return board, self._play(board)

    def _run(self, latencies: Latencies, end: Nanos) -> RunOutputs:
        board, advance = self._board(latencies)
        recording = OutputRecording(board)
        advance(end)
        return recording.taken(end)

    def _parting(self, outputs: RunOutputs) -> OutputParting | None:
        return parting_of(self._as_it_is, outputs, self._slack)

    def _narrowed(self, drawn: Latencies, parting: OutputParting) -> Race | None:
        """Return the two orders of one interrupt and one instruction that make the difference of a run.

        Of the interrupts before the parting, the last first, each is put off by one cycle more and more, those before
        it as they were drawn. None: none of the last few decides by itself.
        """
        end = min(self._span_ns, parting.at + 2 * self._slack.between(0, parting.at) + _LOOK_NS)
        board, advance = self._board(drawn)
        advance(parting.at + self._slack.near)
        count = board.chip.latency.count
        for until in range(count - 1, max(count - 1 - _TRIED, -1), -1):
            before = self._run(self._single(drawn, until, 0), end)
            for late in range(1, drawn.most + 1):
                behind = self._run(self._single(drawn, until, late), end)
                parted = parting_of(before, behind, self._slack)
                if parted is not None:
                    pair = self._single(drawn, until, late - 1), self._single(drawn, until, late)
                    first, second = self._entries(*pair)
                    if first[1] != second[1]:
                        return Race(
                            exception=first[2], parting=parted, latencies=pair[1],
                            before=self._order(first, before, parted), behind=self._order(second, behind, parted),
                        )  # fmt: skip
                before = behind
        return None

    @staticmethod
    def _single(drawn: Latencies, until: int, last: int) -> Latencies:
        return Latencies(seed=drawn.seed, most=drawn.most, until=until, last=last)

    def _order(self, entry: BlockRow, run: RunOutputs, parting: OutputParting) -> InterruptOrder:
        return InterruptOrder(address=entry[1], cycle=entry[0], puts_out=_shown(run, parting, self._slack))

    def _entries(self, one: Latencies, other: Latencies) -> tuple[BlockRow, BlockRow]:
        """Return the rows of the entry in which two runs differ that are the same before."""
        (board, advance), begin = self._board(one), 0
        while board.chip.latency.count <= one.until and begin < self._span_ns:
            begin += _LOOK_NS
            advance(begin)
        found = []
        for latencies in (one, other):
            board, advance = self._board(latencies)
            advance(max(begin - 2 * _LOOK_NS, 0))
            recorder = board.chip.record_blocks(_ROOM)
            advance(begin + _LOOK_NS)
            found.append(recorder.drain())
        place = next((n for n, (a, b) in enumerate(zip(*found, strict=False)) if a != b), 0)
        first, second = (next(row for row in rows[place:] if row[2] > 0) for rows in found)
        return first, second


class OutputRecording:
    """Takes what a board puts out from now on."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        self._rows = bytearray()
        self._characters: dict[str, Channel] = {f"USART{number}": Channel() for number in _USARTS}
        board.subscribe_pins(BONDED_PINS, self._rows.extend)
        for number in _USARTS:
            board.serial_ports[f"usart{number}"].subscribe(self._taker(self._characters[f"USART{number}"]))

    def taken(self, end: Nanos) -> RunOutputs:
        """Return what has been put out up to a time; of a USART that has sent, its characters stand for its pin."""
        channels = {name: channel for name, channel in self._characters.items() if channel.times}
        remaps = self._board.chip.pins.remaps
        spoken = {pins[0] for name in channels if (pins := PINS[name].get(remaps.get(name, 0))) is not None}
        for at, pin, drive, *_ in EDGE.iter_unpack(self._rows):
            channel = channels.setdefault(f"P{'ABCDE'[pin // 16]}{pin % 16}", Channel())
            channel.times.append(at)
            channel.values.append(drive)
        for name in spoken:
            channels.pop(name, None)
        return RunOutputs(channels=channels, end=end, interrupts=self._board.chip.latency.count)

    @staticmethod
    def _taker(channel: Channel) -> Callable[[Sequence[tuple[int, Nanos]]], None]:
        def take(sent: Sequence[tuple[int, Nanos]]) -> None:
            channel.times += [at for _, at in sent]
            channel.values += [word for word, _ in sent]

        return take


class HandlerStretches(BlockRecorder):
    """Takes how long handlers run in one go, with those that interrupt others or follow at once; passes blocks by."""

    def __init__(self) -> None:
        super().__init__(1)
        #: In cycles.
        self.longest = 0
        #: The cycle of each entry.
        self.entries: list[int] = []
        self._depth = 0
        self._began = self._left = -1

    def put(self, cycle: int, address: int, kind: int) -> None:
        """Take a row."""
        del address
        if kind > 0:
            self.entries.append(cycle)
            if not self._depth and cycle != self._left:
                self._began = cycle
            self._depth += 1
        elif kind == EXCEPTION_RETURN:
            self._depth = max(self._depth - 1, 0)
            if not self._depth:
                self._left = cycle
                self.longest = max(self.longest, cycle - self._began)

    def put_packed(self, data: bytes) -> None:
        """Take rows as bytes; nearly all are of blocks, and not looked at one by one."""
        kinds = memoryview(data).cast("i")[KIND_PLACE :: RECORD.size // 4].tolist()
        for row in [row for row, kind in enumerate(kinds) if kind]:
            self.put(*RECORD.unpack_from(data, row * RECORD.size))


def parting_of(one: RunOutputs, other: RunOutputs, slack: Slack) -> OutputParting | None:
    """Return where two runs first put out something else; None: nowhere, as far as both have come."""
    end = min(one.end, other.end)
    found: list[OutputParting] = []
    for name in one.channels.keys() | other.channels.keys():
        place = _parting_in(one.channels.get(name, Channel()), other.channels.get(name, Channel()), slack, end)
        if place is not None:
            found.append(OutputParting(place[0], name, place[1]))
    swapped = _swapped(one, other, slack, min((parting.at for parting in found), default=end))
    return min([*found, *swapped], key=lambda parting: (parting.at, parting.channel, parting.place), default=None)


def _parting_in(one: Channel, other: Channel, slack: Slack, end: Nanos) -> tuple[Nanos, int] | None:
    """Return when two runs of a channel part, and at which item."""
    before = before_other = place = 0
    for at, at_other, value, value_other in zip(one.times, other.times, one.values, other.values, strict=False):
        off = (at_other - before_other) - (at - before)
        if value != value_other or abs(off) > slack.between(before, max(at, at_other)):
            break
        before, before_other, place = at, at_other, place + 1
    left = [
        (times[place], times[place] - was)
        for times, was in ((one.times, before), (other.times, before_other)) if len(times) > place
    ]  # fmt: skip
    if not left:
        return None
    # What one of them lacks may be still to come: so long after what was before it, and so much later.
    at, since = min(left)
    due = max(before, before_other) + since + slack.between(at - since, at)
    return (at, place) if due < end else None


def _swapped(one: RunOutputs, other: RunOutputs, slack: Slack, end: Nanos) -> Iterator[OutputParting]:
    """Yield what of different channels comes in the other order, the first of each run's, though far apart in one."""
    for this, that in ((one, other), (other, one)):
        latest, latest_name = -1, ""
        for at, name, place in merge(*(_items(name, channel) for name, channel in this.channels.items())):
            times = that.channels[name].times if name in that.channels else []
            if at >= end:
                break
            if place >= len(times):
                continue
            there = times[place]
            if there < latest - slack.order(at) and name != latest_name:
                yield OutputParting(at, name, place, latest_name)
                break
            if there > latest:
                latest, latest_name = there, name


def _items(name: str, channel: Channel) -> Iterator[tuple[Nanos, str, int]]:
    return ((at, name, place) for place, at in enumerate(channel.times))


def _shown(run: RunOutputs, parting: OutputParting, slack: Slack) -> tuple[str, ...]:
    """Return what a run puts out from a parting on, as words."""
    since = parting.at - slack.near
    rows = sorted(
        (at, name, run.channels[name].values[place])
        for channel in (parting.channel, parting.other) if channel in run.channels
        for at, name, place in _items(channel, run.channels[channel])
        if (at >= since if parting.other else place >= parting.place)
    )  # fmt: skip
    return tuple(f"{name} {_word(name, value)} at {at / NS_PER_MS:.6f} ms" for at, name, value in rows[:SHOWN])


def _word(name: str, value: int) -> str:
    if name.startswith("USART"):
        return repr(chr(value)) if value < 128 else f"{value:#x}"
    drive = list(PinDrive)[value]
    return _LEVELS.get(drive, "pulled down")


def _lines_of(image: Image) -> LineTable:
    try:
        return read_lines(image)
    except P2osError:
        return LineTable()
