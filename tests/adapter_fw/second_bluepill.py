"""A second BluePill in the adapter's place: the emulated chip runs the core, its USART is the P2OS line.

    first chip ─ nets ─ second chip ─ USART1 at 9600 ─ controller ─ body

The second chip follows the first: it is brought forward in steps of a
millisecond at most, sees the first one's pins as they stand at the begin of
each step, and what it drives carries the time of the instruction that did it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from unittest.mock import patch

from adapter_sim.adapter import AdapterState
from adapter_sim.pinout import Pinout, WireRole
from bluepill_sim import BluePill
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.controller import Pioneer
from robot_bench.bench import Bench
from robot_bench.bench.far_end import FarEnd
from robot_bench.recording.client_view import SipRanges
from robot_bench.recording.recorder import Recorder
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.chip_pins import number_of
from robot_bench.wires.nets import Harness, OwnedPins
from simbase.timing import NS_PER_MS, Nanos, Reached

#: A quarter of what the adapter samples with.
STEP_NS: Nanos = NS_PER_MS // 2
#: Of adapter_fw/bluepill/hardware.hpp, in the order of the input word and of the output word.
INPUTS = ("PB8", "PB9", "PB10", "PB11", "PB12", "PB13", "PB14", "PB15")
OUTPUTS = (*(f"PA{number}" for number in range(8)), "PB0", "PB1", "PB3", "PB4", "PB5", "PB6")
#: Of bluepill/main.cpp: each four bytes.
REPORT = ("passes", "longest_pass_cycles", "sips", "state", "losses", "rejected", "events")


class SecondBluePill:
    """The chip that runs the core, as a part of the bench, with its line to the controller."""

    def __init__(self, elf: Path, pins: OwnedPins, pinout: Pinout, pioneer: Pioneer) -> None:
        self.chip = BluePill(elf, strict=True)
        #: It samples its inputs by itself.
        self.wakes_on: frozenset[str] = frozenset()
        self.pioneer = pioneer
        #: Every byte that has left, with the end of its stop bit.
        self.sent: list[tuple[Nanos, int]] = []
        self.on_packet: Callable[[bytes, Nanos], None] | None = None
        self._pins = pins
        self._on_the_line: list[tuple[Nanos, int]] = []
        self._step_at: Nanos = 0
        names = [name for value in ("motor1", "motor2") for name in pinout.value(value).wires]
        names += [pinout.with_role(role)[0].name for role in (WireRole.CONNECT, WireRole.RESET)]
        self._inputs = list(zip(names, map(self.chip.pin, INPUTS), strict=True))
        outputs = [wire.name for wire in pinout.with_role(WireRole.DISTANCE)]
        outputs += [name for value in ("encoder1", "encoder2") for name in pinout.value(value).wires]
        self._signals = dict(zip(map(number_of, OUTPUTS), outputs, strict=True))
        self.chip.subscribe_pins(OUTPUTS, self._drives)
        self.chip.usart1.subscribe(self._sends)

    @property
    def report(self) -> dict[str, int]:
        """Return what the program tells a debugger."""
        address = self.chip.image.symbols.address_of("adapter_report")
        data = self.chip.read_memory(address, 4 * len(REPORT))
        assert data is not None
        return {
            name: int.from_bytes(data[4 * place : 4 * place + 4], "little") for place, name in enumerate(REPORT)
        }  # fmt: skip

    @property
    def state(self) -> AdapterState:
        return list(AdapterState)[self.report["state"]]

    def next_deadline(self) -> Nanos:
        own = self.pioneer.next_deadline()
        return self._step_at if own is None else min(own, self._step_at)

    def advance_to(self, limit: Nanos) -> Reached:
        for name, pin in self._inputs:
            pin.drive(self._pins.read(name, limit))
        if self.chip.now_ns < limit:
            self.chip.advance_to(limit)
        while self._on_the_line and self._on_the_line[0][0] <= limit:
            at, byte = self._on_the_line.pop(0)
            self.pioneer.receive(bytes([byte]), at)
        self.pioneer.advance_to(limit)
        for frame in self.pioneer.take_output():
            if self.on_packet is not None:
                self.on_packet(frame, limit)
            self.chip.usart1.receive(frame)
        self._step_at = limit + STEP_NS
        return Reached(limit)

    def _drives(self, rows: bytes) -> None:
        for at, number, place, *_ in EDGE.iter_unpack(rows):
            drive = list(PinDrive)[place]
            self._pins.write(self._signals[number], drive.level if drive.is_strong else None, at)

    def _sends(self, rows: Sequence[tuple[int, Nanos]]) -> None:
        sent = [(at, byte) for byte, at in rows]
        self.sent += sent
        self._on_the_line += sent


class SecondBluePillBench(Bench):
    """A bench whose adapter is a second BluePill."""

    elf: Path

    def __init__(self, scenario: Scenario) -> None:
        def far_end(
            scenario: Scenario, pinout: Pinout, body: RobotBody, _chip: object, harness: Harness, recorder: Recorder,
            **_: object,
        ) -> FarEnd:  # fmt: skip
            pioneer = Pioneer(parameters=scenario.parameters, body=body, settings=scenario.controller)
            pioneer.on_event = recorder.listener("pioneer")
            ranges = SipRanges(scenario.parameters, pioneer.profile, on_ranges=recorder.sonar)
            self.second = SecondBluePill(self.elf, OwnedPins(harness, "adapter"), pinout, pioneer)

            def comes_back(frame: bytes, at: Nanos) -> None:
                recorder.wire("r2c", frame, at)
                ranges.take(frame, at)

            self.second.on_packet = comes_back
            return FarEnd(robots=(self.second,), adapter=self.second, controller=pioneer, ranges=ranges)

        with patch("robot_bench.bench.robot_run.make_far_end", far_end):
            super().__init__(scenario)
