"""What the pins of both modules can bear, asked of any revision of the pin map.

adapter_sim/pinout.py knows which wire can work at all; here stand the rules of
the board: flash, straps and what pulls them, input-only pins, double use, JTAG and
SWD, 5 V on pins that bear 3.3 V. The same rules judge the thesis's two maps.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from adapter_sim.pinout import FLASH_GPIO, INPUT_ONLY_GPIO, STRAP_GPIO, Direction, Pinout, Pull, Wire
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS, JTAG_ONLY, NOT_5V_TOLERANT, STRAP_LEVEL, SWD


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One pin that breaks a rule."""

    rule: str
    signal: str
    text: str

    def __str__(self) -> str:
        """Return the line that a person reads."""
        return f"{self.rule}: {self.signal}: {self.text}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
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
    "rev-b": Board(revision="rev-b"),
    "rev-c": Board(revision="rev-c"),
    # Table 3 is a pin map alone, judged with the resistors of the schematic; nothing is said to bring 5 V.
    "thesis-table3": Board(revision="thesis-table3", has_series_resistors=False, pulls_all_down=True),
    "thesis-board": Board(
        revision="thesis-board",
        volts=_THESIS_VOLTS,
        has_series_resistors=False,
        pulls_all_down=True,
        extra=_THESIS_EXTRA,
    ),
}


def findings(pinout: Pinout, board: Board) -> list[Finding]:
    """Return every rule that a revision breaks, in the order of the pin map.

    Raises:
        KeyError: The pin map has no such revision.
    """
    found: list[Finding] = []
    taken: dict[str, str] = {}
    for wire in pinout.wires:
        pin = wire.esp32_pin(board.revision)
        found += _bluepill(wire, dict(board.volts).get(wire.name, LOGIC_V))
        found += _esp32(wire, pin, board)
        if pin is not None:
            found += _double(wire.name, pin, taken)
    for name, pin, direction in [*_auxiliaries(pinout, board.revision), *board.extra]:
        number = gpio(pin)
        if number is not None and direction == "out" and number in INPUT_ONLY_GPIO:
            found.append(Finding(rule="input-only", signal=name, text=f"{pin} cannot drive"))
        if dict(board.volts).get(name, LOGIC_V) > ESP32_MAX_V:
            volts = dict(board.volts)[name]
            found.append(Finding(rule="5V", signal=name, text=f"{volts:g} V on {pin}, which bears {ESP32_MAX_V:g} V"))
        shared = {auxiliary.shares for auxiliary in pinout.auxiliaries if auxiliary.name == name}
        if taken.get(pin) not in shared:
            found += _double(name, pin, taken)
    return found


def count_by_rule(found: Iterable[Finding]) -> dict[str, int]:
    """Return how often each rule is broken, rules sorted."""
    counts: dict[str, int] = {}
    for finding in found:
        counts[finding.rule] = counts.get(finding.rule, 0) + 1
    return dict(sorted(counts.items()))


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


def _double(signal: str, pin: str, taken: dict[str, str]) -> list[Finding]:
    if pin in taken:
        return [Finding(rule="double", signal=signal, text=f"{pin} is {taken[pin]} already")]
    taken[pin] = signal
    return []


def _bluepill(wire: Wire, volts: float) -> list[Finding]:
    found = []
    if wire.bluepill not in BLUEPILL_PINS:
        found.append(Finding(rule="no-pin", signal=wire.name, text=f"the BluePill has no pin {wire.bluepill}"))
    if wire.bluepill in SWD:
        found.append(Finding(rule="swd", signal=wire.name, text=f"{wire.bluepill} is the debug port"))
    if wire.bluepill in JTAG_ONLY and wire.direction is Direction.TO_ADAPTER:
        text = f"{wire.bluepill} is a JTAG output until the program sets AFIO SWJ_CFG"
        found.append(Finding(rule="jtag", signal=wire.name, text=text))
    if volts > LOGIC_V and wire.bluepill in NOT_5V_TOLERANT:
        found.append(Finding(rule="5V", signal=wire.name, text=f"{volts:g} V on {wire.bluepill}, not 5 V tolerant"))
    return found


def _esp32(wire: Wire, pin: str | None, board: Board) -> list[Finding]:
    if pin is None:
        return [Finding(rule="no-pin", signal=wire.name, text="no pin of the ESP32")]
    number = gpio(pin)
    if number is None:
        return []
    found = []
    if pin not in ESP32_PINS:
        found.append(Finding(rule="no-pin", signal=wire.name, text=f"the module does not bring out {pin}"))
    if number in FLASH_GPIO:
        found.append(Finding(rule="flash", signal=wire.name, text=f"{pin} carries the module's flash"))
    if wire.direction is Direction.TO_BLUEPILL and number in INPUT_ONLY_GPIO:
        found.append(Finding(rule="input-only", signal=wire.name, text=f"{pin} cannot drive"))
    if wire.direction is Direction.TO_ADAPTER and number in STRAP_GPIO:
        found.append(Finding(rule="strap", signal=wire.name, text=f"{pin} is a strap, but the BluePill drives it"))
    if pin in STRAP_LEVEL:
        found += _strap_pull(wire, pin, is_down=board.pulls_all_down or wire.pull is Pull.DOWN)
    if dict(board.volts).get(wire.name, LOGIC_V) > ESP32_MAX_V:
        found.append(Finding(rule="5V", signal=wire.name, text=f"5 V on {pin}, which bears {ESP32_MAX_V:g} V"))
    if wire.bluepill in JTAG_ONLY and not board.has_series_resistors:
        text = f"{wire.bluepill} is a JTAG pin after reset and meets {pin} without a resistor"
        found.append(Finding(rule="jtag", signal=wire.name, text=text))
    return found


def _strap_pull(wire: Wire, pin: str, *, is_down: bool) -> list[Finding]:
    """Judge the board's resistor at a strap: it must not say the opposite, and IO12 needs one."""
    level = STRAP_LEVEL[pin]
    if level and is_down:
        return [Finding(rule="strap", signal=wire.name, text=f"{pin} must be high at reset, but is pulled down")]
    if pin == "IO12" and not is_down:
        return [Finding(rule="strap", signal=wire.name, text="IO12 needs a pull-down: high selects 1.8 V flash")]
    return []
