"""The measurement: one wire after the other is driven from the end that drives it, low and high, and every pad is read.

Theory of operation. Never more than one output of both modules together drives a wire, so that no short sets two
drivers against each other; all other wires follow their pulls. A pad that is low while the wire is driven low, and
high while it is driven high, follows. On a sound board exactly the two pads of the wire follow. The pad at the
BluePill's end of a wire that the adapter drives is pulled the other way by the chip's 40 kΩ, so that an open wire
shows as one that follows that pull. Where a wire does not follow, the pads are asked once more whether a rail holds
them: the BluePill drives its own for a microsecond only, which a pin in a short bears.

Invariant: what is measured does not depend on the wires measured before it.
"""

from dataclasses import dataclass, field

from adapter_sim.pinout import Pinout, WireDirection, WireRole
from robot_bench.wires.board_test.ends import AdapterEnd, BluePillEnd, BoardTestError

GREETINGS = 3
#: Tries of `test on` after a reset. chosen: with a console that waits 0.2 s or more, longer than an ESP32 boots.
BOOT_TRIES = 15
#: chosen: each takes a millisecond at the least, and the pattern 9 ms at 9600 baud.
LINK_TRIES = 40
#: Sent on the robot's line, which returns it where its pins 2 and 3 are joined. No header of a P2OS frame is in it.
PATTERN = bytes.fromhex("55aa00ff0f5a33cc")


@dataclass(slots=True)
class Response:
    """What one wire did when it was driven."""

    #: Words of the wires whose pads follow, at each module.
    bluepill: int = 0
    adapter: int = 0
    #: The levels that drove the adapter into reset: its console was silent.
    silent_at: set[bool] = field(default_factory=set)
    #: Levels at which the pad of the driving end, and of the far end, were wrong.
    near_wrong: set[bool] = field(default_factory=set)
    far_wrong: set[bool] = field(default_factory=set)
    #: The rail that holds the pad of the BluePill's end, against its own driver.
    held_at: bool | None = None
    #: What its pad reads while its own 40 kΩ pull it up, and down.
    pulled: dict[bool, bool] = field(default_factory=dict)


@dataclass(slots=True)
class BoardMeasurement:
    """All that was measured of a board."""

    #: None where the adapter is silent from the start.
    started_by: str | None
    csr: int
    has_crystal: bool
    #: Every pad while nobody drives; None where the adapter was silent.
    idle_bluepill: int
    idle_adapter: int | None
    wires: dict[str, Response] = field(default_factory=dict)
    #: What came back on the robot's line; None where the adapter is silent.
    link: bytes | None = None
    pad_reports: int | None = None
    has_pad: bool = False


class BoardWalk:
    """Walks through a board.

    Args:
        bluepill: Its end.
        adapter: Its end.
        pinout: The wires.
    """

    def __init__(self, bluepill: BluePillEnd, adapter: AdapterEnd, pinout: Pinout) -> None:
        self._bluepill = bluepill
        self._adapter = adapter
        self._wires = pinout.wires

    def measure(self) -> BoardMeasurement:
        """Walk through wires, line and pad; both modules have let go of every wire at the end.

        Raises:
            BoardTestError: The BluePill's program does not answer.
        """
        # The first word may be lost to a program that is beginning, or to what stood in its line.
        csr = next((csr for csr in (self._bluepill.greet() for _ in range(GREETINGS)) if csr is not None), None)
        if csr is None:
            raise BoardTestError(
                "the BluePill does not answer",
                hint="is board_test.elf flashed, and PA9 at the RX of its port? 57600 baud",
            )
        idle = self._read_bluepill()
        result = BoardMeasurement(
            started_by=self._begin(tries=2),
            csr=csr,
            has_crystal=bool(self._bluepill.has_crystal()),
            idle_bluepill=idle,
            idle_adapter=None,
        )
        try:
            if result.started_by is not None:
                self._adapter.hold(0, 0)
                result.idle_adapter = self._adapter.read()
                self._measure_wires(result)
        finally:
            self._bluepill.hold()
            self._adapter.end()
        return result

    def _measure_wires(self, result: BoardMeasurement) -> None:
        for place, wire in enumerate(self._wires):
            if wire.role is not WireRole.RESET:
                response = self._drive(place, wire.direction)
                follows = response.bluepill & response.adapter & 1 << place
                if not follows or response.silent_at:
                    self._ask_again(place, wire.direction, response)
                result.wires[wire.name] = response
        # Before the reset, for after it the adapter has its own STOP to say on the line.
        self._measure_line(result)
        # Last, for it takes the adapter with it.
        for place, wire in enumerate(self._wires):
            if wire.role is WireRole.RESET:
                result.wires[wire.name] = response = self._drive(place, wire.direction)
                if response.silent_at != {True}:
                    self._ask_again(place, wire.direction, response)

    def _drive(self, place: int, direction: WireDirection) -> Response:
        """Drive a wire low and high, and compare every pad."""
        response = Response()
        if direction is WireDirection.TO_ADAPTER:
            response.held_at = self._rail_at(place)
            if response.held_at is not None:
                response.near_wrong.add(not response.held_at)
                return response
        seen: dict[bool, tuple[int, int | None]] = {}
        for level in (False, True):
            if direction is WireDirection.TO_BLUEPILL:
                is_there = self._adapter.hold(1 << place, level << place)
                near = self._read_bluepill(levels=(not level) << place, pulled=1 << place)
            else:
                is_there = True
                near = self._read_bluepill(driven=1 << place, levels=level << place)
            pads = self._adapter.read() if is_there else None
            seen[level] = near, pads
            if pads is None:
                response.silent_at.add(level)
            self._let_go(was_silent=pads is None)
        low, high = seen[False], seen[True]
        response.bluepill = ~low[0] & high[0]
        if low[1] is not None and high[1] is not None:
            response.adapter = ~low[1] & high[1]
        for level, (bluepill, adapter) in seen.items():
            ends = (adapter, bluepill) if direction is WireDirection.TO_BLUEPILL else (bluepill, adapter)
            for word, wrong in zip(ends, (response.near_wrong, response.far_wrong), strict=True):
                if word is None or bool(word >> place & 1) is not level:
                    wrong.add(level)
        return response

    def _ask_again(self, place: int, direction: WireDirection, response: Response) -> None:
        """Ask the pad at the BluePill's end whether a rail holds it, and what its own pulls make of it."""
        if direction is WireDirection.TO_BLUEPILL:
            response.held_at = self._rail_at(place)
        for level in (False, True):
            word = self._read_bluepill(levels=level << place, pulled=1 << place)
            response.pulled[level] = bool(word >> place & 1)
        self._let_go(was_silent=direction is WireDirection.TO_ADAPTER and bool(response.silent_at))

    def _rail_at(self, place: int) -> bool | None:
        """Return the level that a BluePill's pad keeps against its own driver; None where it follows."""
        wrong = [
            level
            for level in (False, True)
            if bool((self._bluepill.pulse(1 << place, level << place) or 0) >> place & 1) is not level
        ]
        return not wrong[0] if len(wrong) == 1 else None

    def _measure_line(self, result: BoardMeasurement) -> None:
        self._adapter.received()
        self._adapter.send(PATTERN)
        result.link = b""
        for _ in range(LINK_TRIES):
            result.link += self._adapter.received()
            if PATTERN in result.link:
                break
        pad = self._adapter.pad()
        if pad is not None and pad.reports is not None:
            result.has_pad, result.pad_reports = True, pad.reports

    def _let_go(self, *, was_silent: bool) -> None:
        self._bluepill.hold()
        if was_silent or not self._adapter.hold(0, 0):
            self._begin(tries=BOOT_TRIES)

    def _begin(self, *, tries: int) -> str | None:
        """Take the hardware from the adapter, which may be booting; return why it had begun, None: silent."""
        for _ in range(tries):
            started_by = self._adapter.begin()
            if started_by is not None:
                self._adapter.hold(0, 0)
                return started_by
        return None

    def _read_bluepill(self, *, driven: int = 0, levels: int = 0, pulled: int = 0) -> int:
        word = self._bluepill.hold(driven=driven, levels=levels, pulled=pulled)
        if word is None:
            raise BoardTestError("the BluePill has fallen silent", hint="its supply, or the cable to its port")
        return word
