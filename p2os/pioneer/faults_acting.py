"""What breaking and mending does: one small function a fault, and the table of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from p2os.errors import UsageError
from p2os.pioneer.faults import MOMENTARY, Fault, Faults
from p2os.pioneer.works import Works


@dataclass(frozen=True, slots=True)
class Patient:
    """What faults act on."""

    faults: Faults
    works: Works
    #: Starts the controller anew; the argument says why.
    restart: Callable[[str], None]


Act = Callable[[Patient, Fault], None]


def break_now(patient: Patient, fault: Fault) -> None:
    """Break something."""
    _BREAK[fault.name](patient, fault)


def mend_now(patient: Patient, fault: Fault) -> None:
    """Mend it; what is not broken stays so.

    Raises:
        UsageError: It happens once, so that there is nothing to mend.
    """
    if fault.name in MOMENTARY:
        raise UsageError(f"there is nothing to mend after {fault.name}", hint="the controller boots by itself")
    _MEND[fault.name](patient, fault)


def broken_now(works: Works) -> tuple[str, ...]:
    """Return the words of every fault that lasts, as `mend` takes them."""
    faults, battery, pins = works.faults, works.rack.battery, works.rack.pins
    found = [Fault(f"sonar-{kind}", number=n + 1, value=value) for n, (kind, value) in sorted(faults.sonar.items())]
    sides = (("left", faults.left_blocked), ("right", faults.right_blocked))
    found += [Fault("wheel-blocked", side=side) for side, is_blocked in sides if is_blocked]
    if faults.is_loose:
        found.append(Fault("loose-connector"))
    if faults.bit_error_rate:
        found.append(Fault("line-noise", value=faults.bit_error_rate))
    if battery.pretended_decivolts is not None and not battery.is_test:
        found.append(Fault("low-battery", value=battery.pretended_decivolts / 10))
    if works.rack.switches.stop_button:
        found.append(Fault("stop-button"))
    for side, pressed in (("front", pins.front_pressed), ("rear", pins.rear_pressed)):
        found += [Fault("bumper", side=side, number=bit + 1) for bit in range(7) if pressed >> bit & 1]
    return tuple(fault.text for fault in found)


def _sonar(patient: Patient, fault: Fault) -> None:
    patient.faults.sonar[fault.number - 1] = (fault.name.removeprefix("sonar-"), fault.value)


def _sonar_well(patient: Patient, fault: Fault) -> None:
    patient.faults.sonar.pop(fault.number - 1, None)


def _wheel(*, blocked: bool) -> Act:
    return lambda patient, fault: setattr(patient.faults, f"{fault.side}_blocked", blocked)


def _loose(*, is_loose: bool) -> Act:
    def act(patient: Patient, _fault: Fault) -> None:
        patient.faults.is_loose = is_loose
        patient.faults.gap_in = patient.faults.gap_out = 0

    return act


def _noise(patient: Patient, fault: Fault) -> None:
    patient.faults.bit_error_rate = fault.value


def _quiet(patient: Patient, _fault: Fault) -> None:
    patient.faults.bit_error_rate = 0.0


def _volts(patient: Patient, fault: Fault) -> None:
    battery = patient.works.rack.battery
    battery.pretended_decivolts, battery.is_test = round(fault.value * 10), False


def _true_volts(patient: Patient, _fault: Fault) -> None:
    patient.works.rack.battery.pretended_decivolts = None


def _press(patient: Patient, _fault: Fault) -> None:
    patient.works.rack.switches.stop_button = True
    patient.works.motion.power(on=False)


def _release(patient: Patient, _fault: Fault) -> None:
    patient.works.rack.switches.stop_button = False


def _bump(patient: Patient, fault: Fault) -> None:
    pins, bit = patient.works.rack.pins, 1 << fault.number - 1
    if fault.side == "front":
        pins.front_pressed |= bit
    else:
        pins.rear_pressed |= bit


def _unbump(patient: Patient, fault: Fault) -> None:
    pins, bit = patient.works.rack.pins, 1 << fault.number - 1
    if fault.side == "front":
        pins.front_pressed &= ~bit
    else:
        pins.rear_pressed &= ~bit


_BREAK: Mapping[str, Act] = {
    "sonar-stuck": _sonar,
    "sonar-noisy": _sonar,
    "sonar-dead": _sonar,
    "wheel-blocked": _wheel(blocked=True),
    "loose-connector": _loose(is_loose=True),
    "line-noise": _noise,
    "low-battery": _volts,
    "brown-out": lambda patient, _fault: patient.restart("brown-out"),
    "reboot": lambda patient, _fault: patient.restart("reboot"),
    "stop-button": _press,
    "bumper": _bump,
}
_MEND: Mapping[str, Act] = {
    "sonar-stuck": _sonar_well,
    "sonar-noisy": _sonar_well,
    "sonar-dead": _sonar_well,
    "wheel-blocked": _wheel(blocked=False),
    "loose-connector": _loose(is_loose=False),
    "line-noise": _quiet,
    "low-battery": _true_volts,
    "stop-button": _release,
    "bumper": _unbump,
}
