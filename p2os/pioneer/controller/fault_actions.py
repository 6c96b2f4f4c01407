"""What injecting and clearing a fault does: one small function a fault, and the table of them.

`faults` reads the words and holds what is injected; a fault of a device (battery,
bumper, stop button) is kept in the device's own state.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.faults import MOMENTARY, RobotFault
from simbase.errors import UsageError


@dataclass(frozen=True, slots=True)
class FaultTarget:
    """What faults act on."""

    context: Context
    #: Starts the controller anew; the argument is the reason.
    restart: Callable[[str], None]


Act = Callable[[FaultTarget, RobotFault, bool], None]


def inject_now(target: FaultTarget, fault: RobotFault) -> None:
    """Inject a fault."""
    _ACTS[fault.name](target, fault, True)


def clear_now(target: FaultTarget, fault: RobotFault) -> None:
    """Clear a fault; one that is not injected stays so.

    Raises:
        UsageError: It happens once, so that there is nothing to clear.
    """
    if fault.name in MOMENTARY:
        raise UsageError(f"there is nothing to clear after {fault.name}", hint="the controller boots by itself")
    _ACTS[fault.name](target, fault, False)


def injected_now(context: Context) -> tuple[str, ...]:
    """Return the words of every fault that lasts, as `clear` takes them."""
    faults, battery, pins = context.faults, context.devices.battery, context.devices.pins
    found = [
        RobotFault(f"sonar-{kind}", number=n + 1, value=value) for n, (kind, value) in sorted(faults.sonar.items())
    ]
    sides = (("left", faults.left_blocked), ("right", faults.right_blocked))
    found += [RobotFault("wheel-blocked", side=side) for side, is_blocked in sides if is_blocked]
    if faults.is_loose:
        found.append(RobotFault("loose-connector"))
    if faults.bit_error_rate:
        found.append(RobotFault("line-noise", value=faults.bit_error_rate))
    if battery.pretended_decivolts is not None and not battery.is_test:
        found.append(RobotFault("low-battery", value=battery.pretended_decivolts / 10))
    if context.devices.switches.stop_button:
        found.append(RobotFault("stop-button"))
    for side, pressed in (("front", pins.front_pressed), ("rear", pins.rear_pressed)):
        found += [RobotFault("bumper", side=side, number=bit + 1) for bit in range(7) if pressed >> bit & 1]
    return tuple(fault.text for fault in found)


def _sonar(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    sonar = target.context.faults.sonar
    if is_on:
        sonar[fault.number - 1] = (fault.name.removeprefix("sonar-"), fault.value)
    else:
        sonar.pop(fault.number - 1, None)


def _wheel(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    setattr(target.context.faults, f"{fault.side}_blocked", is_on)


def _connector(target: FaultTarget, _fault: RobotFault, is_on: bool) -> None:
    target.context.faults.is_loose = is_on
    target.context.faults.gap_in = target.context.faults.gap_out = 0


def _noise(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    target.context.faults.bit_error_rate = fault.value if is_on else 0.0


def _voltage(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    battery = target.context.devices.battery
    battery.pretended_decivolts = round(fault.value * 10) if is_on else None
    if is_on:
        battery.is_test = False


def _stop_button(target: FaultTarget, _fault: RobotFault, is_on: bool) -> None:
    target.context.devices.switches.stop_button = is_on
    if is_on:
        target.context.motion.power(on=False)


def _bumper(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    pins, side, bit = target.context.devices.pins, f"{fault.side}_pressed", 1 << fault.number - 1
    others = getattr(pins, side) & ~bit
    setattr(pins, side, others | bit if is_on else others)


def _restart(target: FaultTarget, fault: RobotFault, is_on: bool) -> None:
    del is_on  # there is nothing to clear
    target.restart(fault.name)


_ACTS: Mapping[str, Act] = {
    **dict.fromkeys(("sonar-stuck", "sonar-noisy", "sonar-dead"), _sonar),
    **dict.fromkeys(sorted(MOMENTARY), _restart),
    "wheel-blocked": _wheel,
    "loose-connector": _connector,
    "line-noise": _noise,
    "low-battery": _voltage,
    "stop-button": _stop_button,
    "bumper": _bumper,
}
