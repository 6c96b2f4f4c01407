"""What the pins of both modules can bear, asked of any revision of the pin map.

adapter_sim/pinout.py knows which wire can work at all; here stand the rules of
the board: flash, straps and what pulls them, input-only pins, double use, JTAG and
SWD, 5 V on pins that bear 3.3 V. The same rules judge the thesis's two maps.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from adapter_sim.pinout import FLASH_GPIO, INPUT_ONLY_GPIO, STRAP_GPIO, Pinout, Pull, Wire, WireDirection
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS, JTAG_ONLY, NOT_5V_TOLERANT, STRAP_LEVEL, SWD


@dataclass(frozen=True, slots=True, kw_only=True)
class PinFinding:
    """One pin that breaks a rule."""

    rule: str
    signal: str
    text: str

    def __str__(self) -> str:
        """Return the line that a person reads."""
        return f"{self.rule}: {self.signal}: {self.text}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PinnedBoard:
    """What a revision of the board does around its pin map, as far as the rules ask."""

    revision: str
    #: Highest level that a connector or a part puts on a signal, volts; by signal, default 3.3.
    volts: tuple[tuple[str, float], ...] = ()
    #: A series resistor stands in every wire between the modules.
    has_series_resistors: bool = True
    #: Every wire has a 20k pull-down, whatever the pin map says (as on the thesis's schematic).
    pulls_all_down: bool = False
    #: Further signals of the ESP32: (name, pin, direction as the ESP32 sees it).
    extra: tuple[tuple[str, str, str], ...] = ()


#: Sensor and encoder headers of the thesis's schematic carry 5 V sensors straight onto the wires; its
#: MAX3232 at 5 V drives ESP32 GPIO16; its mode switch reaches IO19 and IO23 (reference: review A3, A7, A11).
_THESIS_VOLTS = (
    *((f"DD{number}", 5.0) for number in range(1, 9)),
    *((f"encoder{side}_s{bit}", 5.0) for side in (1, 2) for bit in (1, 2, 3)),
    ("p2os_rx", 5.0),
)
#: The firmware of the thesis uses both mode pins as sensor outputs too; its state LED sits on SVP.
_THESIS_EXTRA = (("mode_2", "IO23", "in"), ("led_state", "IO36", "out"), ("fw_DD5", "IO19", "out"))

BOARDS = {
    "rev-b": PinnedBoard(revision="rev-b"),
    "rev-c": PinnedBoard(revision="rev-c"),
    # Table 3 is a pin map alone, judged with the resistors of the schematic; nothing is said to bring 5 V.
    "thesis-table3": PinnedBoard(revision="thesis-table3", has_series_resistors=False, pulls_all_down=True),
    "thesis-board": PinnedBoard(
        revision="thesis-board",
        volts=_THESIS_VOLTS,
        has_series_resistors=False,
        pulls_all_down=True,
        extra=_THESIS_EXTRA,
    ),
}


def findings(pinout: Pinout, board: PinnedBoard) -> list[PinFinding]:
    """Return every rule that a revision breaks, in the order of the pin map.

    Raises:
        KeyError: The pin map has no such revision.
    """
    found: list[PinFinding] = []
    taken: dict[str, str] = {}
    for wire in pinout.wires:
        pin = wire.esp32_pin(board.revision)
        found += _bluepill(wire, dict(board.volts).get(wire.name, LOGIC_V))
        found += _esp32(wire, pin, board)
        if pin is not None:
            found += _double(wire.name, pin, taken)
    for name, pin, direction in [*_auxiliaries(pinout, board.revision), *board.extra]:
        number = gpio(pin)
        volts = dict(board.volts).get(name, LOGIC_V)
        found += _broken(
            name,
            ("input-only", direction == "out" and number in INPUT_ONLY_GPIO, f"{pin} cannot drive"),
            ("5V", volts > ESP32_MAX_V, f"{volts:g} V on {pin}, which bears {ESP32_MAX_V:g} V"),
        )
        shared = {auxiliary.shares for auxiliary in pinout.auxiliaries if auxiliary.name == name}
        if taken.get(pin) not in shared:
            found += _double(name, pin, taken)
    return found


def count_by_rule(found: Iterable[PinFinding]) -> dict[str, int]:
    """Return how often each rule is broken, rules sorted."""
    return dict(sorted(Counter(finding.rule for finding in found).items()))


def gpio(pin: str | None) -> int | None:
    """Return the number of a GPIO, None for EN, for a shift register's output and for no pin."""
    return int(pin[2:]) if pin is not None and pin.startswith("IO") else None


#: Level of every signal of a board that keeps 5 V off its wires.
LOGIC_V = 3.3
#: VDD + 0.3 V (both data sheets, absolute maximum of a pin that is not 5 V tolerant).
ESP32_MAX_V = 3.6


def _auxiliaries(pinout: Pinout, revision: str) -> list[tuple[str, str, str]]:
    rows = [(entry.name, dict(entry.esp32).get(revision), entry.direction) for entry in pinout.auxiliaries]
    return [(name, pin, direction) for name, pin, direction in rows if pin is not None]


def _double(signal: str, pin: str, taken: dict[str, str]) -> list[PinFinding]:
    found = _broken(signal, ("double", pin in taken, f"{pin} is {taken.get(pin)} already"))
    taken.setdefault(pin, signal)
    return found


def _broken(signal: str, *rows: tuple[str, bool, str]) -> list[PinFinding]:
    """Return those of a signal's rules, each with whether it is broken, that are."""
    return [PinFinding(rule=rule, signal=signal, text=text) for rule, is_broken, text in rows if is_broken]


def _bluepill(wire: Wire, volts: float) -> list[PinFinding]:
    pin = wire.bluepill
    is_driven = pin in JTAG_ONLY and wire.direction is WireDirection.TO_ADAPTER
    return _broken(
        wire.name,
        ("no-pin", pin not in BLUEPILL_PINS, f"the BluePill has no pin {pin}"),
        ("swd", pin in SWD, f"{pin} is the debug port"),
        ("jtag", is_driven, f"{pin} is a JTAG output until the program sets AFIO SWJ_CFG"),
        ("5V", volts > LOGIC_V and pin in NOT_5V_TOLERANT, f"{volts:g} V on {pin}, not 5 V tolerant"),
    )


def _esp32(wire: Wire, pin: str | None, board: PinnedBoard) -> list[PinFinding]:
    number = gpio(pin)
    if pin is None or number is None:
        return _broken(wire.name, ("no-pin", pin is None, "no pin of the ESP32"))
    is_down = board.pulls_all_down or wire.pull is Pull.DOWN
    is_driven = wire.direction is WireDirection.TO_ADAPTER
    volts = dict(board.volts).get(wire.name, LOGIC_V)
    has_jtag = wire.bluepill in JTAG_ONLY and not board.has_series_resistors
    return _broken(
        wire.name,
        ("no-pin", pin not in ESP32_PINS, f"the module does not bring out {pin}"),
        ("flash", number in FLASH_GPIO, f"{pin} carries the module's flash"),
        ("input-only", not is_driven and number in INPUT_ONLY_GPIO, f"{pin} cannot drive"),
        ("strap", is_driven and number in STRAP_GPIO, f"{pin} is a strap, but the BluePill drives it"),
        # The board's resistor at a strap must not say the opposite, and IO12 needs one.
        ("strap", is_down and STRAP_LEVEL.get(pin, False), f"{pin} must be high at reset, but is pulled down"),
        ("strap", not is_down and pin == "IO12", "IO12 needs a pull-down: high selects 1.8 V flash"),
        ("5V", volts > ESP32_MAX_V, f"5 V on {pin}, which bears {ESP32_MAX_V:g} V"),
        ("jtag", has_jtag, f"{wire.bluepill} is a JTAG pin after reset and meets {pin} without a resistor"),
    )
