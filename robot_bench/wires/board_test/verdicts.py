"""What a measurement of a board means: a row a wire, and rows for supply, crystal, reset, line and pad.

What follows a wire                          is named
    its two pads and no other                sound
    its two pads and those of another        joined to it
    at the far end another's pad instead     swapped with it
    its own pad not even at the near end     held at a rail, at the near end
    only its own pad at the near end         held at a rail at the far end where that can be told, else open
    the adapter's console falls silent       joined to rst, or to EN, which is the far end of rst

Not told apart: a pin of the ESP32 that is not soldered, of a wire that the BluePill drives, from one held at GND; and
whatever is wrong at an output of rev C's shift register, which nothing reads: its wire is named, as open, where a rail
holds it, and where it is joined to another output and the level between both reads so.
"""

from dataclasses import dataclass
from enum import Enum

from adapter_sim.pinout import Pinout, Pull, Wire, WireDirection, WireRole
from robot_bench.wires.board_test.walk import PATTERN, BoardMeasurement, Response


class BoardVerdict(Enum):
    """How something was found."""

    SOUND = "ok"
    OPEN = "open"
    HELD = "short to rail"
    JOINED = "short"
    SWAPPED = "swapped"
    #: Could not be tested.
    UNKNOWN = "not tested"
    #: Not as it should be, in its own words.
    WRONG = "wrong"


@dataclass(frozen=True, slots=True)
class VerdictRow:
    """One row of the table."""

    name: str
    #: Its pads, such as "PA4 - IO23".
    path: str
    verdict: BoardVerdict
    detail: str = ""
    #: Wires that take part, or the rail: "GND" or "3V3".
    others: tuple[str, ...] = ()

    @property
    def is_fault(self) -> bool:
        """Tell whether the board is not sound."""
        return self.verdict not in {BoardVerdict.SOUND, BoardVerdict.UNKNOWN}


def judge(measured: BoardMeasurement, pinout: Pinout, revision: str) -> list[VerdictRow]:
    """Return a row for each wire and for all else, in the order of the table."""
    findings = [_supply(measured, pinout), _crystal(measured)]
    for place, wire in enumerate(pinout.wires):
        path = f"{wire.bluepill} - {wire.esp32_pin(revision)}"
        verdict, detail, others = _wire(measured, pinout, place, wire)
        findings.append(VerdictRow(wire.name, path, verdict, detail, others))
    return [*findings, _link(measured), _pad(measured)]


_Judged = tuple[BoardVerdict, str, tuple[str, ...]]
_SOUND: _Judged = (BoardVerdict.SOUND, "", ())
_SILENT: _Judged = (BoardVerdict.UNKNOWN, "the adapter is silent", ())
_HELD_IN_RESET: _Judged = (BoardVerdict.HELD, "3V3: the adapter stays in reset", ("3V3",))


def _rail(level: bool) -> str:
    return "3V3" if level else "GND"


def _wire(measured: BoardMeasurement, pinout: Pinout, place: int, wire: Wire) -> _Judged:
    if measured.started_by is None:
        is_held = wire.role is WireRole.RESET and measured.idle_bluepill >> place & 1
        return _HELD_IN_RESET if is_held else _SILENT
    response = measured.wires[wire.name]
    others = _names(pinout, (response.bluepill | response.adapter) & ~(1 << place))
    if wire.role is WireRole.RESET:
        return _reset(response, place, others)
    if response.silent_at:
        return _resets_adapter(response, pinout)
    far = response.bluepill if wire.direction is WireDirection.TO_BLUEPILL else response.adapter
    if far >> place & 1:
        return _SOUND if not others else (BoardVerdict.JOINED, f"joined to {' and '.join(others)}", others)
    far_others = _names(pinout, far & ~(1 << place))
    if far_others:
        return BoardVerdict.SWAPPED, f"arrives as {' and '.join(far_others)}", far_others
    return _held_or_open(response, wire)


def _reset(response: Response, place: int, others: tuple[str, ...]) -> _Judged:
    if response.silent_at == {True}:
        return (BoardVerdict.JOINED, f"joined to {' and '.join(others)}", others) if others else _SOUND
    if others and not response.silent_at:
        return BoardVerdict.SWAPPED, f"arrives as {' and '.join(others)}", others
    if response.held_at is not None:
        rail = _rail(response.held_at)
        return BoardVerdict.HELD, f"held at {rail} at the BluePill's end", (rail,)
    if not response.silent_at and response.pulled.get(True) is False:
        return BoardVerdict.HELD, "held at GND at the base of Q1", ("GND",)
    if not response.silent_at and response.bluepill >> place & 1:
        return BoardVerdict.OPEN, "the adapter runs on while it is high", ()
    return BoardVerdict.WRONG, "silent at both levels", ()


def _resets_adapter(response: Response, pinout: Pinout) -> _Judged:
    """Judge a wire that drives the adapter into reset."""
    reset = next(number for number, wire in enumerate(pinout.wires) if wire.role is WireRole.RESET)
    name = pinout.wires[reset].name
    if response.silent_at == {True}:
        if response.bluepill >> reset & 1:
            return BoardVerdict.JOINED, f"joined to {name}: high resets", (name,)
        return BoardVerdict.SWAPPED, f"arrives as {name}: high resets", (name,)
    if response.silent_at == {False}:
        return BoardVerdict.JOINED, "joined to EN: low resets", ("EN",)
    return BoardVerdict.WRONG, "resets at both levels", ()


def _held_or_open(response: Response, wire: Wire) -> _Judged:
    near, far = ("adapter's", "BluePill's")
    if wire.direction is WireDirection.TO_ADAPTER:
        near, far = far, near
    if len(response.near_wrong) == 1:
        rail = _rail(not next(iter(response.near_wrong)))
        return BoardVerdict.HELD, f"held at {rail} at the {near} end", (rail,)
    if wire.direction is WireDirection.TO_BLUEPILL:
        if response.held_at is not None:
            rail = _rail(response.held_at)
            return BoardVerdict.HELD, f"held at {rail} at the {far} end", (rail,)
        return BoardVerdict.OPEN, "the BluePill's pad follows its pull", ()
    # The BluePill drives: through 1k2 a rail at the adapter's end is stronger than the chip's own pull against it.
    if response.far_wrong == {False} and response.pulled.get(False) is True:
        return BoardVerdict.HELD, f"held at 3V3 at the {far} end", ("3V3",)
    if response.far_wrong == {True} and wire.pull is Pull.DOWN and response.pulled.get(True) is False:
        return BoardVerdict.HELD, f"held at GND at the {far} end", ("GND",)
    return BoardVerdict.OPEN, f"does not reach the {far} end", ()


def _names(pinout: Pinout, word: int) -> tuple[str, ...]:
    return tuple(wire.name for place, wire in enumerate(pinout.wires) if word >> place & 1)


def _supply(measured: BoardMeasurement, pinout: Pinout) -> VerdictRow:
    """Judge the supply by what it does: both modules run, neither has browned out, and the pulls have their rail."""
    path = "+3V3, +5V"
    if measured.idle_adapter is None:
        return VerdictRow("supply", path, BoardVerdict.WRONG, "adapter silent: power, firmware, EN?")
    if measured.started_by == "brown-out":
        return VerdictRow("supply", path, BoardVerdict.WRONG, "the adapter began after a brown-out")
    low = [
        wire.name
        for place, wire in enumerate(pinout.wires)
        if wire.pull is Pull.UP and not measured.idle_adapter >> place & 1
    ]
    if len(low) > 1:
        return VerdictRow("supply", path, BoardVerdict.WRONG, f"{' and '.join(low)} have no +3V3 at their pull-ups")
    return VerdictRow("supply", path, BoardVerdict.SOUND, f"the adapter since {measured.started_by}")


def _crystal(measured: BoardMeasurement) -> VerdictRow:
    verdict = BoardVerdict.SOUND if measured.has_crystal else BoardVerdict.WRONG
    return VerdictRow("crystal", "8 MHz", verdict, "" if measured.has_crystal else "the BluePill's does not start")


def _link(measured: BoardMeasurement) -> VerdictRow:
    path = "IO17 - J3 - IO16"
    if not measured.link:
        return VerdictRow("link", path, BoardVerdict.UNKNOWN, "join pins 2 and 3 of J3 to test it")
    # The adapter's own STOP may come back beside it.
    if PATTERN in measured.link:
        return VerdictRow("link", path, BoardVerdict.SOUND, f"{len(PATTERN)} bytes came back")
    return VerdictRow("link", path, BoardVerdict.WRONG, f"sent {PATTERN.hex()}, {measured.link.hex()} came back")


def _pad(measured: BoardMeasurement) -> VerdictRow:
    if not measured.has_pad:
        return VerdictRow("pad", "radio", BoardVerdict.UNKNOWN, "this firmware has none" if measured.started_by else "")
    if not measured.pad_reports:
        return VerdictRow("pad", "radio", BoardVerdict.UNKNOWN, "no report: pair it, and move a stick")
    return VerdictRow("pad", "radio", BoardVerdict.SOUND, f"{measured.pad_reports} reports")
