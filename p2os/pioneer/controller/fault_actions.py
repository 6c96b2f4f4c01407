"""What injecting and clearing a fault does: one small function each, and the two tables of them.

`faults` reads the words and holds what is injected; a fault of a device (battery,
bumper, stop button) is kept in the device's own state.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.faults import MOMENTARY, Fault
from simbase.errors import UsageError


@dataclass(frozen=True, slots=True)
class FaultTarget:
    """What faults act on."""

    context: Context
    #: Starts the controller anew; the argument is the reason.
    restart: Callable[[str], None]


Act = Callable[[FaultTarget, Fault], None]


def inject_now(target: FaultTarget, fault: Fault) -> None:
    """Inject a fault."""
    _INJECT[fault.name](target, fault)


def clear_now(target: FaultTarget, fault: Fault) -> None:
    """Clear a fault; one that is not injected stays so.

    Raises:
        UsageError: It happens once, so that there is nothing to clear.
    """
    if fault.name in MOMENTARY:
        raise UsageError(f"there is nothing to clear after {fault.name}", hint="the controller boots by itself")
    _CLEAR[fault.name](target, fault)


def injected_now(context: Context) -> tuple[str, ...]:
    """Return the words of every fault that lasts, as `clear` takes them."""
    faults, battery, pins = context.faults, context.devices.battery, context.devices.pins
    found = [Fault(f"sonar-{kind}", number=n + 1, value=value) for n, (kind, value) in sorted(faults.sonar.items())]
    sides = (("left", faults.left_blocked), ("right", faults.right_blocked))
    found += [Fault("wheel-blocked", side=side) for side, is_blocked in sides if is_blocked]
    if faults.is_loose:
        found.append(Fault("loose-connector"))
    if faults.bit_error_rate:
        found.append(Fault("line-noise", value=faults.bit_error_rate))
    if battery.pretended_decivolts is not None and not battery.is_test:
        found.append(Fault("low-battery", value=battery.pretended_decivolts / 10))
    if context.devices.switches.stop_button:
        found.append(Fault("stop-button"))
    for side, pressed in (("front", pins.front_pressed), ("rear", pins.rear_pressed)):
        found += [Fault("bumper", side=side, number=bit + 1) for bit in range(7) if pressed >> bit & 1]
    return tuple(fault.text for fault in found)


def _inject_sonar(target: FaultTarget, fault: Fault) -> None:
    target.context.faults.sonar[fault.number - 1] = (fault.name.removeprefix("sonar-"), fault.value)


def _clear_sonar(target: FaultTarget, fault: Fault) -> None:
    target.context.faults.sonar.pop(fault.number - 1, None)


def _block_wheel(*, blocked: bool) -> Act:
    return lambda target, fault: setattr(target.context.faults, f"{fault.side}_blocked", blocked)


def _loosen_connector(*, is_loose: bool) -> Act:
    def act(target: FaultTarget, _fault: Fault) -> None:
        target.context.faults.is_loose = is_loose
        target.context.faults.gap_in = target.context.faults.gap_out = 0

    return act


def _inject_noise(target: FaultTarget, fault: Fault) -> None:
    target.context.faults.bit_error_rate = fault.value


def _clear_noise(target: FaultTarget, _fault: Fault) -> None:
    target.context.faults.bit_error_rate = 0.0


def _pretend_voltage(target: FaultTarget, fault: Fault) -> None:
    battery = target.context.devices.battery
    battery.pretended_decivolts, battery.is_test = round(fault.value * 10), False


def _clear_voltage(target: FaultTarget, _fault: Fault) -> None:
    target.context.devices.battery.pretended_decivolts = None


def _press_stop(target: FaultTarget, _fault: Fault) -> None:
    target.context.devices.switches.stop_button = True
    target.context.motion.power(on=False)


def _release_stop(target: FaultTarget, _fault: Fault) -> None:
    target.context.devices.switches.stop_button = False


def _press_bumper(target: FaultTarget, fault: Fault) -> None:
    pins, bit = target.context.devices.pins, 1 << fault.number - 1
    if fault.side == "front":
        pins.front_pressed |= bit
    else:
        pins.rear_pressed |= bit


def _release_bumper(target: FaultTarget, fault: Fault) -> None:
    pins, bit = target.context.devices.pins, 1 << fault.number - 1
    if fault.side == "front":
        pins.front_pressed &= ~bit
    else:
        pins.rear_pressed &= ~bit


_INJECT: Mapping[str, Act] = {
    "sonar-stuck": _inject_sonar,
    "sonar-noisy": _inject_sonar,
    "sonar-dead": _inject_sonar,
    "wheel-blocked": _block_wheel(blocked=True),
    "loose-connector": _loosen_connector(is_loose=True),
    "line-noise": _inject_noise,
    "low-battery": _pretend_voltage,
    "brown-out": lambda target, _fault: target.restart("brown-out"),
    "reboot": lambda target, _fault: target.restart("reboot"),
    "stop-button": _press_stop,
    "bumper": _press_bumper,
}
_CLEAR: Mapping[str, Act] = {
    "sonar-stuck": _clear_sonar,
    "sonar-noisy": _clear_sonar,
    "sonar-dead": _clear_sonar,
    "wheel-blocked": _block_wheel(blocked=False),
    "loose-connector": _loosen_connector(is_loose=False),
    "line-noise": _clear_noise,
    "low-battery": _clear_voltage,
    "stop-button": _release_stop,
    "bumper": _release_bumper,
}
