"""What an ESP32's pins can and cannot do, asked of a pin-out.

Source: reference of the ESP32 D1 mini's pins as the board review found them:
GPIO6..11 carry the module's flash, GPIO34..39 are inputs only, GPIO0, 2, 5, 12
and 15 are straps that decide how the chip boots.

Not here: series resistors, voltages, rise times (the board's own checks).
"""

from adapter_sim.pinout import Direction, Pinout, PinoutError, Role, Status, Wire

#: Pins of the module's own flash chip.
FLASH_GPIO = frozenset(range(6, 12))
#: Pins without an output driver.
INPUT_ONLY_GPIO = frozenset(range(34, 40))
#: Pins read at boot; a BluePill that drives one can keep the ESP32 from booting.
STRAP_GPIO = frozenset({0, 2, 5, 12, 15})
#: Pins of the second input register: read together, they are one atomic sample.
SECOND_REGISTER_GPIO = frozenset(range(32, 40))


def faults_of(pinout: Pinout, revision: str) -> list[str]:
    """Return why a revision of the board cannot work, one line each, in the order of the table.

    Raises:
        KeyError: The pin-out has no such revision.
    """
    faults: list[str] = []
    taken: dict[str, str] = {}
    for wire in pinout.wires:
        pin = wire.esp32_pin(revision)
        faults += _wire_faults(wire, pin)
        if pin is not None and pin in taken:
            faults.append(f"{wire.name}: {pin} is {taken[pin]} already")
        elif pin is not None:
            taken[pin] = wire.name
    for auxiliary in pinout.auxiliaries:
        pin = dict(auxiliary.esp32).get(revision)
        if pin is None:
            continue
        if pin in taken and taken[pin] != auxiliary.shares:
            faults.append(f"{auxiliary.name}: {pin} is {taken[pin]} already")
        taken.setdefault(pin, auxiliary.name)
    motors = [_gpio(wire.esp32_pin(revision)) for wire in pinout.with_role(Role.MOTOR)]
    if any(gpio not in SECOND_REGISTER_GPIO for gpio in motors):
        faults.append("motor wires: not all in IO32..IO39, so no one read samples them at one instant")
    return faults


def require_usable(pinout: Pinout, revision: str) -> None:
    """Refuse a revision that cannot work.

    Raises:
        PinoutError: It does not exist, or has faults; the message has the first, the hint the number.
    """
    known = {entry.name: entry for entry in pinout.revisions}
    if revision not in known:
        raise PinoutError(f"board revision {revision!r} is unknown", hint="one of " + ", ".join(known))
    faults = faults_of(pinout, revision)
    if not faults and known[revision].status is Status.FAULTY:
        faults = [known[revision].note]
    if faults:
        raise PinoutError(
            f"board revision {revision!r} cannot work: {faults[0]}",
            hint=f"{len(faults)} such faults; {pinout.default_revision} has none",
        )


def _wire_faults(wire: Wire, pin: str | None) -> list[str]:
    if pin is None:
        return [f"{wire.name}: no pin of the ESP32"]
    gpio = _gpio(pin)
    if gpio is None:
        return []
    faults = []
    if gpio in FLASH_GPIO:
        faults.append(f"{wire.name}: {pin} carries the module's flash")
    if wire.direction is Direction.TO_BLUEPILL and gpio in INPUT_ONLY_GPIO:
        faults.append(f"{wire.name}: {pin} is an input only, but must be driven")
    if wire.direction is Direction.TO_ADAPTER and gpio in STRAP_GPIO:
        faults.append(f"{wire.name}: {pin} is a boot strap, but the BluePill drives it")
    return faults


def _gpio(pin: str | None) -> int | None:
    return int(pin[2:]) if pin is not None and pin.startswith("IO") else None
