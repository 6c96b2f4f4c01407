"""Which adapter stands between the wires and the robot: the Python model, the firmware's own core, or the user's.

The core is the C++ of adapter_fw: a shared library with a plain C interface
(adapter_fw/capi/adapter_capi.h), built with the package where a C++17 compiler is
there, and loaded by ctypes. `FirmwareAdapter` takes the calls of `adapter_sim.Adapter`,
and its events and status have the model's words, so that logs can be compared.

Invariant: nothing is decided here; pins, bytes, times and settings go through as
they are.
"""

import ctypes
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, cast

from adapter_sim.adapter import RUNNING_STATES, Adapter, AdapterState, AdapterStatus
from adapter_sim.codec import BitOrder
from adapter_sim.distances import threshold_um
from adapter_sim.masters import Master
from adapter_sim.mixing import CommandedSpeeds
from adapter_sim.pinout import Pinout, Safe, WireRole
from adapter_sim.pins import MOTOR_VALUES, AdapterPins, EventCallback, duty_wires, released_codes
from adapter_sim.receiver import Receiver
from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorCommand, MotorMeaning
from p2os.gamepad import PadReport
from p2os.robots.parameters import RobotParameters
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.line_ends import ENDS, AdapterPart
from simbase.c_library import built, guarded, loaded
from simbase.errors import MissingDependencyError, UsageError
from simbase.timing import NS_PER_S, Nanos, Reached

#: The firmware's core, as a module.
PART = "robot_bench._adapter_firmware"
#: Of adapter_capi.h.
VERSION = 4
_MAX_FRAME_BYTES = 9
#: What helps when a state cannot be taken up.
RUN_ANEW = "run the scenario anew, and save it again"

_Read = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p, ctypes.c_int64)
_Duty = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_int32, ctypes.c_int64)
_Drive = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_int64)
_Happened = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int32, ctypes.c_int32
)


class _Callbacks(ctypes.Structure):
    _fields_ = (("user", ctypes.c_void_p), ("read", _Read), ("duty", _Duty), ("drive", _Drive), ("happened", _Happened))


#: Settings that are one of several, in the order of the firmware's enumerations.
_CHOICES: dict[str, tuple[str, ...]] = {
    "motor_command": tuple(MotorCommand),
    "bit_order": tuple(BitOrder),
    "motor_meaning": tuple(MotorMeaning),
    "encoder_at_open": tuple(EncoderAtOpen),
}

#: Result and arguments of each function, as `simbase.c_library` spells them.
_FUNCTIONS = {
    "adapter_version": "i",
    "adapter_new": "ppppplp",
    "adapter_free": "vp",
    "adapter_setting_name": "si",
    "adapter_robot_name": "si",
    "adapter_wire_name": "si",
    "adapter_status_name": "si",
    "adapter_receive": "vppzl",
    "adapter_receive_pad": "vpiiiil",
    "adapter_set_master": "vpil",
    "adapter_shutdown": "vpsl",
    "adapter_advance_to": "vpl",
    "adapter_next_deadline": "lp",
    "adapter_wait_for_edges": "vp",
    "adapter_is_suspended": "ip",
    "adapter_take_output": "zpp",
    "adapter_status": "vpp",
    "adapter_state": "sp",
    "adapter_reason": "sp",
    "adapter_robot_text": "spi",
    "adapter_state_size": "z",
    "adapter_save": "vpp",
    "adapter_restore": "vpp",
}


def is_available() -> bool:
    """Tell whether the firmware's library was built with this package."""
    return built(PART) is not None


@dataclass(frozen=True, slots=True)
class FirmwareState:
    """What a firmware adapter saves; only the same build can read it back."""

    #: SHA-256 of the library.
    build: str
    data: bytes
    #: Of what measures the duties, and of the UART.
    duties: tuple[object, ...]
    receiver: object


class FirmwareAdapter:
    """The firmware core as a passive part in virtual time; see `adapter_sim.Adapter`.

    Args:
        pins: Its ends of the wires.
        pinout: Names, widths and levels of the wires.
        parameters: The robot's own numbers.
        settings: None takes the defaults.
        on_event: Called at each transition.
        now: When power comes, in nanoseconds.
        receiver: The UART in front of it; None: bytes are seen when they arrive.

    Raises:
        MissingDependencyError: The library was not built.
        UsageError: The firmware refuses a number.
    """

    def __init__(
        self,
        *,
        pins: AdapterPins,
        pinout: Pinout,
        parameters: RobotParameters,
        settings: AdapterSettings | None = None,
        on_event: EventCallback | None = None,
        now: Nanos = 0,
        receiver: Receiver | None = None,
    ) -> None:
        self._library = library = _library()
        self.pinout = pinout
        self.parameters = parameters
        self.settings = settings = settings or AdapterSettings()
        self.on_event = on_event
        self._receiver = receiver
        if receiver is not None:
            receiver.restart(now)
        self._pins = pins
        motors = [name for value in MOTOR_VALUES for name in pinout.value(value).wires]
        ends = [pinout.with_role(role)[0].name for role in (WireRole.CONNECT, WireRole.RESET)]
        self._inputs = [(name, 1 << bit) for bit, name in enumerate([*motors, *ends])]
        #: Names of rst, and of all input wires, by whether it waits for edges instead of sampling.
        self._wakes_on = (frozenset(ends[1:]), frozenset((*motors, *ends)))
        self._outputs = [wire.name for wire in pinout.with_role(WireRole.DISTANCE)]
        self._outputs += [name for value in ("encoder1", "encoder2") for name in pinout.value(value).wires]
        self._status_names = _names(library.adapter_status_name)
        self._failure: BaseException | None = None
        self._frame = ctypes.create_string_buffer(_MAX_FRAME_BYTES)
        values = [pinout.value(name) for name in MOTOR_VALUES]
        #: What measures the duties: the part of the hardware that the core does not have.
        self._duties = dict(zip((0, values[0].width), duty_wires(pins, values, settings), strict=True))
        self._callbacks = _Callbacks(
            None,
            _Read(guarded(self._read, 0, self._fail)),
            _Duty(guarded(self._duty, 0, self._fail)),
            _Drive(guarded(self._drive, None, self._fail)),
            _Happened(guarded(self._happened, None, self._fail)),
        )
        fault = ctypes.c_char_p()
        self._handle = library.adapter_new(
            _numbers(_names(library.adapter_setting_name), setting_numbers(settings, parameters)),
            _numbers(_names(library.adapter_robot_name), robot_numbers(parameters)),
            _numbers(_names(library.adapter_wire_name), wire_numbers(pinout)),
            ctypes.byref(self._callbacks), now, ctypes.byref(fault),
        )  # fmt: skip
        if not self._handle:
            raise UsageError(f"the adapter's firmware refuses its numbers: {(fault.value or b'').decode()}")

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.adapter_free(self._handle)

    @property
    def state(self) -> AdapterState:
        """Return what the adapter is doing."""
        return AdapterState(self._library.adapter_state(self._handle).decode())

    @property
    def master(self) -> Master:
        """Return who commands."""
        return list(Master)[self.numbers["master"]]

    @property
    def baud(self) -> int:
        """Return the line speed that is being tried or used."""
        return self.numbers["baud"]

    @property
    def numbers(self) -> dict[str, int]:
        """Return everything the firmware counts and knows, by name."""
        values = (ctypes.c_int64 * len(self._status_names))()
        self._library.adapter_status(self._handle, values)
        return dict(zip(self._status_names, values, strict=True))

    @property
    def status(self) -> AdapterStatus:
        """Return what the adapter knows at this moment; single ranges stay in the firmware."""
        numbers = self.numbers
        count = len(self.pinout.with_role(WireRole.DISTANCE))
        return AdapterStatus(
            state=self.state,
            reason=self._library.adapter_reason(self._handle).decode(),
            motors=(numbers["motor1"], numbers["motor2"]),
            speeds=CommandedSpeeds(numbers["forward_mm_s"], numbers["turn_deg_s"]),
            distances=tuple(bool(numbers["levels"] >> bit & 1) for bit in range(count)),
            ranges_um=(None,) * count,
            counts=(numbers["left_count"], numbers["right_count"]),
            counts_shown=(numbers["left_shown"], numbers["right_shown"]),
            sips=numbers["sips"],
            odometry_jumps=numbers["jumps"],
        )

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`."""
        if self._receiver is None:
            self._see_bytes(data, now)
            return
        self._receive_until(now - 1)
        if self.state in RUNNING_STATES:
            self._receiver.arrive(data, now)

    def first_sight(self, at: Nanos) -> Nanos:
        """Return the earliest time at which it acts on bytes that arrive at a time."""
        return at if self._receiver is None else self._receiver.first_sight(at)

    def receive_pad(self, report: PadReport, now: Nanos) -> None:
        """Take a pad's report that came at `now`."""
        self._receive_until(now - 1)
        buttons = report.up | report.down << 1
        self._library.adapter_receive_pad(self._handle, buttons, report.forward, report.backward, report.turn, now)
        self._raise_failure()

    def set_master(self, master: Master, now: Nanos) -> None:
        """Give the robot to another master."""
        self._receive_until(now - 1)
        self._library.adapter_set_master(self._handle, list(Master).index(master), now)
        self._raise_failure()

    def shutdown(self, reason: str, now: Nanos) -> None:
        """Stop the robot, drive every output to its safe level, and wait for the connect request to be withdrawn."""
        self._receive_until(now - 1)
        self._library.adapter_shutdown(self._handle, reason.encode(), now)
        self._raise_failure()

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        frame, frames = self._frame, []
        while size := self._library.adapter_take_output(self._handle, frame):
            frames.append(frame.raw[:size])
        return frames

    def wait_for_edges(self) -> None:
        """Sample no settled wires from now on: whoever runs it brings it to every edge of the wires in `wakes_on`."""
        self._library.adapter_wait_for_edges(self._handle)

    @property
    def wakes_on(self) -> frozenset[str]:
        """Names of the wires whose edges it has to be brought to: rst, and all inputs while it does not sample them."""
        return self._wakes_on[self._library.adapter_is_suspended(self._handle)]

    def next_deadline(self) -> Nanos | None:
        """Return the next sample instant or deadline, in nanoseconds."""
        deadline = cast("int", self._library.adapter_next_deadline(self._handle))
        due_at = self._receiver.due_at if self._receiver is not None else None
        return deadline if due_at is None else min(deadline, due_at)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, then look at rst."""
        self._receive_until(limit)
        self._library.adapter_advance_to(self._handle, limit)
        self._raise_failure()
        return Reached(limit)

    def snapshot(self) -> FirmwareState:
        """Return all that decides the future: one value, laid out by the firmware itself."""
        state = ctypes.create_string_buffer(self._library.adapter_state_size())
        self._library.adapter_save(self._handle, state)
        receiver = self._receiver.snapshot() if self._receiver is not None else None
        return FirmwareState(_build(), state.raw, tuple(wire.snapshot() for wire in self._duties.values()), receiver)

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned.

        Raises:
            TypeError: It is no snapshot of a firmware adapter.
            UsageError: Another build of the firmware made it.
        """
        if not isinstance(snapshot, FirmwareState):
            raise TypeError("not a snapshot of FirmwareAdapter")
        if snapshot.build != _build():
            raise UsageError("the state was saved by another build of the adapter's firmware", hint=RUN_ANEW)
        self._library.adapter_restore(self._handle, snapshot.data)
        for wire, duty in zip(self._duties.values(), snapshot.duties, strict=True):
            wire.restore(duty)
        if self._receiver is not None:
            self._receiver.restore(snapshot.receiver)

    # What the firmware calls. An exception must not cross the C code: it is kept, and raised behind it.

    def _read(self, _user: object, at: int) -> int:
        read, word = self._pins.read, 0
        for name, weight in self._inputs:
            if read(name, at):
                word |= weight
        return word

    def _duty(self, _user: object, bit: int, at: int) -> int:
        return self._duties[bit].duty(at)

    def _drive(self, _user: object, mask: int, levels: int, now: int) -> None:
        for bit, name in enumerate(self._outputs):
            if not mask:
                self._pins.write(name, None, now)
            elif mask >> bit & 1:
                self._pins.write(name, bool(levels >> bit & 1), now)

    def _receive_until(self, limit: Nanos) -> None:
        """Give the core what its loop has seen by a time."""
        receiver = self._receiver
        while receiver is not None and (due_at := receiver.due_at) is not None and due_at <= limit:
            for data in receiver.take(due_at):
                self._see_bytes(data, due_at)

    def _see_bytes(self, data: bytes, now: Nanos) -> None:
        self._library.adapter_receive(self._handle, data, len(data), now)
        self._raise_failure()

    def _happened(self, _user: object, now: int, what: bytes, detail: bytes, first: int, second: int) -> None:
        if what == b"booting" and self._receiver is not None:
            self._receiver.restart(now)
        if self.on_event is not None:
            self.on_event(now, what.decode(), self._detail(what.decode(), detail.decode(), first, second))

    def _fail(self, failure: BaseException) -> None:
        self._failure = failure  # raised again by _raise_failure

    def _detail(self, what: str, detail: str, first: int, second: int) -> str:
        if what == "command":
            numbers = self.numbers
            return f"VEL {first}, RVEL {second} (motors {numbers['motor1']}, {numbers['motor2']})"
        if what == "stall":
            return f"left {first}, right {second}"
        if what == "connected":
            name, *kinds = (
                self._library.adapter_robot_text(self._handle, place).decode("latin-1") for place in range(3)
            )
            return " ".join(part for part in (*kinds, name) if part)
        if what == "no connection":
            return f"{detail}; tries again in {first * 10**6 / NS_PER_S:.1f} s"
        return detail

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure


AnyAdapter: TypeAlias = Adapter | FirmwareAdapter
_SHIPPED: Mapping[str, type[AnyAdapter]] = {"model": Adapter, "firmware": FirmwareAdapter}


def make_adapter(scenario: Scenario, pins: AdapterPins, pinout: Pinout) -> AdapterPart:
    """Return the adapter that a scenario wants.

    Raises:
        UsageError: One of the user's is wanted, and cannot be made.
        MissingDependencyError: The firmware's core is wanted and was not built.
    """
    if scenario.adapter_core in _SHIPPED:
        return make_shipped_adapter(scenario, pins, pinout, Receiver())
    return cast(
        "AdapterPart",
        ENDS["adapter"].make(
            scenario.adapter_core, pins=pins, pinout=pinout, parameters=scenario.parameters, settings=scenario.adapter
        ),
    )


def make_shipped_adapter(
    scenario: Scenario, pins: AdapterPins, pinout: Pinout, receiver: Receiver | None = None
) -> AnyAdapter:
    """Return the adapter that a scenario wants, also for a real robot: its stops are tested, those of others are not.

    Args:
        scenario: The scenario.
        pins: The adapter's ends of the wires.
        pinout: Their names.
        receiver: The ESP32's UART; None where a machine's own stands in front of the adapter.

    Raises:
        UsageError: The scenario wants one of the user's.
        MissingDependencyError: The firmware's core is wanted and was not built.
    """
    kind = _SHIPPED.get(scenario.adapter_core)
    if kind is None:
        raise UsageError(
            f"the adapter {scenario.adapter_core} drives no real robot: nobody has tested how it stops one",
            hint=f"--adapter {' or '.join(_SHIPPED)}",
        )
    return kind(pins=pins, pinout=pinout, parameters=scenario.parameters, settings=scenario.adapter, receiver=receiver)


def setting_numbers(settings: AdapterSettings, parameters: RobotParameters) -> dict[str, int]:
    """Return a model's settings as the firmware's numbers."""
    numbers = {}
    for name in _names(_library().adapter_setting_name):
        if name.startswith("baud"):
            place = int(name.removeprefix("baud"))
            numbers[name] = settings.bauds[place] if place < len(settings.bauds) else 0
            continue
        value = getattr(settings, name)
        if name == "threshold_um":
            value = threshold_um(value, parameters)
        if name in _CHOICES:
            value = _CHOICES[name].index(value)
        numbers[name] = -1 if value is None else int(value)
    return numbers


def robot_numbers(parameters: RobotParameters) -> dict[str, int]:
    """Return a robot's numbers as the firmware wants them."""
    return {
        "distance_nm_per_count": parameters.distance_nm_per_count,
        "angle_counts_per_turn": parameters.angle_counts_per_turn,
        "velocity_um_s_per_count": parameters.velocity_um_s_per_count,
        "range_um_per_count": parameters.range_um_per_count,
        "track_mm": parameters.track_mm,
        "wheel_diameter_um": round(parameters.body.wheel_diameter_m * 10**6),
        "ceiling_mm_s": parameters.max_velocity_mm_s,
        "max_velocity_mm_s": min(parameters.max_velocity_mm_s, parameters.motion.max_velocity_mm_s),
        "max_rotation_deg_s": min(parameters.max_rotation_deg_s, parameters.motion.max_rotation_deg_s),
        "half_sonar_range_um": threshold_um(None, parameters),
    }


def wire_numbers(pinout: Pinout) -> dict[str, int]:
    """Return a pin-out's widths and levels as the firmware wants them."""
    distances = pinout.with_role(WireRole.DISTANCE)
    left, right = released_codes(pinout)
    return {
        "distances": len(distances),
        "motor1_width": pinout.value("motor1").width,
        "motor2_width": pinout.value("motor2").width,
        "encoder_width": pinout.value("encoder1").width,
        "safe_mask": sum(1 << bit for bit, wire in enumerate(distances) if wire.safe is not Safe.HOLD),
        "safe_levels": sum(1 << bit for bit, wire in enumerate(distances) if wire.safe is Safe.HIGH),
        "released_codes": left | right << pinout.value("encoder1").width,
    }


# The shared library.


@cache
def _library() -> Any:
    library = loaded(built(PART), _FUNCTIONS, "the adapter's firmware core", PART)
    if library.adapter_version() != VERSION:
        raise MissingDependencyError(
            f"the adapter's firmware core has interface {library.adapter_version()}, expected {VERSION}",
            hint="install the package again",
        )
    return library


@cache
def _build() -> str:
    return hashlib.sha256(Path(_library()._name).read_bytes()).hexdigest()  # noqa: SLF001 - where CDLL keeps its path


def _names(function: Callable[[int], bytes | None]) -> list[str]:
    names: list[str] = []
    while (name := function(len(names))) is not None:
        names.append(name.decode())
    return names


def _numbers(names: list[str], values: dict[str, int]) -> Any:
    return (ctypes.c_int64 * len(names))(*(values[name] for name in names))
