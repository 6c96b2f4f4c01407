"""A board without electronics: the emulated BluePill and the simulated ESP32, each with its program, in a circuit.

Both modules run the bytes, or the sources, that a real board runs; the circuit between them may have faults.
Time goes in steps as long as most answers take; an edge that the BluePill makes is answered at once, as the circuit
does, and what the adapter changes at the end of a step: it changes nothing but what it is told to, or at a reset.

Invariant: without faults it is the board of docs/board.md, as far as `Circuit` models it.
"""

from collections.abc import Callable
from pathlib import Path

from adapter_sim.pinout import load_pinout
from bluepill_sim import BluePill
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE
from robot_bench import firmware
from robot_bench.wires.board_test.circuit import (
    BLUEPILL_INPUT,
    BLUEPILL_PULL_OHM,
    EN,
    ESP32_INPUT,
    ESP32_PULL_OHM,
    OUTPUT_OHM,
    RAIL_V,
    BoardFault,
    Circuit,
    InputLimits,
    Node,
    Side,
    VoltageSource,
)
from robot_bench.wires.board_test.ends import AdapterEnd, BluePillEnd, ConsoleLine
from robot_bench.wires.board_test.esp32 import CONSOLE, ROBOT, Esp32, library_path
from robot_bench.wires.chip_pins import number_of
from simbase.timing import NS_PER_MS, NS_PER_US, Reason

REVISION = "rev-b"
PROGRAM = Path(firmware.__file__).parent / "board_test.elf"
#: chosen: what a person would wait for, and more than any answer takes.
ANSWER_MS = 200
#: chosen: the longest question and its answer take 7 ms, but for those of pad and line.
STEP_MS = 8
_PIN_DRIVES = tuple(PinDrive)
#: The chip's own drives as sources; one that lets go has none.
_SOURCES = {
    PinDrive.LOW: VoltageSource(0.0, OUTPUT_OHM),
    PinDrive.HIGH: VoltageSource(RAIL_V, OUTPUT_OHM),
    PinDrive.PULL_UP: VoltageSource(RAIL_V, BLUEPILL_PULL_OHM),
    PinDrive.PULL_DOWN: VoltageSource(0.0, BLUEPILL_PULL_OHM),
}


class EmulatedBoard:
    """Both modules on an adapter board.

    Args:
        faults: What is wrong with the board.
        has_loop_plug: Whether pins 2 and 3 of J3 are joined.
        between: What is read of a pad between the limits of low and high.
        revision: Of the board; KeyError where no program was built for it.
    """

    def __init__(
        self,
        faults: tuple[BoardFault, ...] = (),
        *,
        has_loop_plug: bool = True,
        between: bool = False,
        revision: str = REVISION,
    ) -> None:
        self.pinout = load_pinout()
        self._circuit = Circuit(self.pinout, faults)
        self._has_loop_plug = has_loop_plug
        self._between = between
        self.bluepill = BluePill(PROGRAM)
        pins = {wire.name: wire.esp32_pin(revision) or "" for wire in self.pinout.wires}
        self._pads = {name: int(pin.removeprefix("IO")) for name, pin in pins.items() if pin.startswith("IO")}
        #: Wires at a shift register: which of its outputs.
        self._shifted = {name: "ABCDEFGH".index(pin[-1]) for name, pin in pins.items() if pin.startswith("HC595.")}
        own = {one.name: dict(one.esp32).get(revision) for one in self.pinout.auxiliaries}
        self._shift_enable = _gpio(own.get("shift_enable"))
        self.esp32 = Esp32(library_path(revision))
        for name in ("shift_data", "shift_clock", "shift_latch"):
            setattr(self.esp32.state, name, _gpio(own.get(name)))
        self._pins = {wire.name: self.bluepill.pin(wire.bluepill) for wire in self.pinout.wires}
        self._said = {CONSOLE: bytearray(), ROBOT: bytearray()}
        self._seen: object = None
        #: What each pin of the BluePill was last given.
        self._given: dict[str, bool] = {}
        #: How often the BluePill has changed what it drives.
        self._changes = 0
        self._volts: dict[Node, float] = {}
        self._drives = dict.fromkeys(self._pins, PinDrive.NONE)
        names = {wire.bluepill: wire.name for wire in self.pinout.wires}
        self._wire_of_pin = {number_of(pin): name for pin, name in names.items()}
        self.bluepill.subscribe_pins(names, self._bluepill_drives, ends_slice=names)
        self._settle()

    @property
    def bluepill_end(self) -> BluePillEnd:
        """Return the BluePill's console."""
        return BluePillEnd(_EmulatedLine(self, self.bluepill.usart1.receive, self.bluepill.usart1.read))

    @property
    def adapter_end(self) -> AdapterEnd:
        """Return the ESP32's console."""
        line: ConsoleLine = _EmulatedLine(
            self, lambda data: self.esp32.receive(CONSOLE, data), lambda: self.esp32.sent(CONSOLE)
        )
        return AdapterEnd(line, self.pinout)

    def run_ms(self, span_ms: int) -> None:
        """Let time pass."""
        now_ns = self.esp32.now_us * NS_PER_US
        end_ns = now_ns + span_ms * NS_PER_MS
        while now_ns < end_ns:
            now_ns = until_ns = min(now_ns + STEP_MS * NS_PER_MS, end_ns)
            while self.bluepill.advance_to(until_ns).reason is Reason.EDGE:
                self._settle()
            self.esp32.run_until(until_ns // NS_PER_US)
            volts = self._settle()
            self._follow_enable(volts[EN])
            if self._has_loop_plug:
                left = self.esp32.sent_in_time(ROBOT)
                self.esp32.receive(ROBOT, bytes(byte for _, byte in left), [at for at, _ in left])

    def _follow_enable(self, volts: float) -> None:
        is_high = self._reads(volts, ESP32_INPUT)
        if is_high is not self.esp32.is_running:
            (self.esp32.power_on if is_high else self.esp32.power_off)()
            self._settle()

    def _settle(self) -> dict[Node, float]:
        """Put on every pad what the circuit makes of what both chips drive."""
        state = self.esp32.state
        key = (self._changes, len(self.esp32.starts), self.esp32.is_running, state.changes)
        if key == self._seen:
            return self._volts
        self._seen = key
        drives: dict[Node, VoltageSource] = {
            (name, Side.BLUEPILL): _SOURCES[drive] for name, drive in self._drives.items() if drive in _SOURCES
        }
        # Its enable is pulled up: it drives where the program pulls it low, and then all its wires together.
        if self._shifted and state.driven >> self._shift_enable & 1 and not state.out >> self._shift_enable & 1:
            for name, output in self._shifted.items():
                drives[name, Side.ESP32] = VoltageSource(RAIL_V if state.shifted >> output & 1 else 0.0, OUTPUT_OHM)
        for name, pad in self._pads.items():
            if state.driven >> pad & 1:
                drives[name, Side.ESP32] = VoltageSource(RAIL_V if state.out >> pad & 1 else 0.0, OUTPUT_OHM)
            elif (state.pulled_up | state.pulled_down) >> pad & 1:
                drives[name, Side.ESP32] = VoltageSource(RAIL_V if state.pulled_up >> pad & 1 else 0.0, ESP32_PULL_OHM)
        self._volts = self._circuit.volts(drives)
        levels = 0
        for name, pad in self._pads.items():
            levels |= self._reads(self._volts[name, Side.ESP32], ESP32_INPUT) << pad
        self.esp32.put_levels(levels)
        for name, pin in self._pins.items():
            is_high = self._reads(self._volts[name, Side.BLUEPILL], BLUEPILL_INPUT)
            if self._given.get(name) is not is_high:
                self._given[name] = is_high
                # The circuit has the last word, against the chip's own output too.
                pin.short("3V3" if is_high else "GND")
        return self._volts

    def _bluepill_drives(self, rows: bytes) -> None:
        self._changes += 1
        for _, pin, drive, _, _, _ in EDGE.iter_unpack(rows):
            self._drives[self._wire_of_pin[pin]] = _PIN_DRIVES[drive]

    def _reads(self, volts: float, limits: InputLimits) -> bool:
        return self._between if limits.low_v < volts < limits.high_v else volts >= limits.high_v


def _gpio(pin: str | None) -> int:
    """Return a GPIO's number, 0 where a revision has no such pin."""
    return int(pin.removeprefix("IO")) if pin else 0


class _EmulatedLine:
    """A console of an emulated board: virtual time passes until the answer is there."""

    def __init__(self, board: EmulatedBoard, send: Callable[[bytes], None], read: Callable[[], bytes]) -> None:
        self._board, self._send, self._read = board, send, read

    def ask(self, line: str, prefix: str) -> str | None:
        """Send a line and wait for its answer; see `ConsoleLine`."""
        self._read()
        self._send(f"{line}\n".encode())
        said = b""
        for _ in range(0, ANSWER_MS, STEP_MS):
            self._board.run_ms(STEP_MS)
            said += self._read()
            *lines, said = said.split(b"\n")
            for answer in lines:
                if answer.decode("ascii", "replace").startswith(prefix):
                    return answer.decode("ascii", "replace").strip()
        return None
