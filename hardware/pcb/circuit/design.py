"""The circuit of each variant, from the pin map and tables of components.

What each block is for, and why it differs from the thesis's board, stands in
docs/board.md. Invariant: `build` is a function of the variant's name alone.
"""

from adapter_sim.pinout import Pinout, Pull, Wire, WireDirection, WireRole, load_pinout
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS
from hardware.pcb.circuit.netlist import BoardDesign, Component, DesignError, make

#: Variant: (revision of the pin map, title).
VARIANTS = {
    "rev-b": ("rev-b", "BluePill to Pioneer adapter, rev B"),
    "lm317": ("rev-b", "BluePill to Pioneer adapter, rev B with LM317"),
    "rev-c": ("rev-c", "BluePill to Pioneer adapter, rev C"),
}

#: Series resistor between the modules: 1k2 keeps what an unpowered module takes below 5 mA a pin and 25 mA
#: in all (STM32F103 data sheet, injected current), whatever its rail does.
SERIES = "1k2"
#: The BluePill's LED pulls PC13 up through its resistor; 680R still holds a low below VIL.
SERIES_SPECIAL = {"encoder2_s1": "680R"}
#: References: series resistors R1.., pulls R31.. with the same last number.
PULL_OFFSET = 30


def build(variant: str = "rev-b") -> BoardDesign:
    """Return the circuit of a variant.

    Raises:
        DesignError: There is no such variant.
    """
    if variant not in VARIANTS:
        raise DesignError(f"variant {variant!r} is unknown (one of {', '.join(VARIANTS)})")
    revision, title = VARIANTS[variant]
    pinout = load_pinout()
    components = (
        *_modules(pinout, variant), *_signals(pinout), *_test_header(pinout), *_supply(variant), *_serial(),
        *_reset_and_mode(pinout, variant), *_stop(), *_shift_register(pinout, variant), *_old_header(variant),
        *_test_points(),
    )  # fmt: skip
    return BoardDesign(variant=variant, revision=revision, title=title, components=components)


def bluepill_net(wire: Wire) -> str:
    """Return the net on the BluePill's side of a wire's series resistor."""
    return "RST_REQ" if wire.role is WireRole.RESET else f"{wire.name.upper()}_BP"


def adapter_net(wire: Wire) -> str:
    """Return the net on the ESP32's side."""
    return "ESP_EN" if wire.role is WireRole.RESET else wire.name.upper()


def series_wires(pinout: Pinout) -> tuple[Wire, ...]:
    """Return the wires that run through a series resistor: all but the reset line."""
    return tuple(wire for wire in pinout.wires if wire.role is not WireRole.RESET)


def _modules(pinout: Pinout, variant: str) -> list[Component]:
    revision = VARIANTS[variant][0]
    bluepill: dict[str, str | None] = {"5V": "BP_5V", "GND": "GND"}
    bluepill |= {wire.bluepill: bluepill_net(wire) for wire in pinout.wires}
    esp: dict[str, str | None] = {"5V": "ESP_5V", "GND": "GND", "3V3": None if variant == "lm317" else "+3V3"}
    for wire in pinout.wires:
        pin = wire.esp32_pin(revision)
        if pin is not None and not pin.startswith("HC595"):
            esp[pin] = adapter_net(wire)
    for auxiliary in pinout.auxiliaries:
        pin = dict(auxiliary.esp32).get(revision)
        if pin is not None and auxiliary.shares is None:
            esp.setdefault(pin, _AUXILIARY_NETS.get(auxiliary.name))
        elif pin is not None:
            # The jumper's net is the shared wire's own, or one of its own where the wire has moved away.
            esp.setdefault(pin, "MODE")
    return [
        make("U1", "BLUEPILL", [bluepill.get(pin) for pin in BLUEPILL_PINS], "BluePill"),
        make("U2", "ESP32", [esp.get(pin) for pin in ESP32_PINS], "ESP32 D1 mini"),
    ]


def _signals(pinout: Pinout) -> list[Component]:
    parts = []
    for index, wire in enumerate(series_wires(pinout), start=1):
        near, far = bluepill_net(wire), adapter_net(wire)
        parts.append(make(f"R{index}", SERIES_SPECIAL.get(wire.name, SERIES), [near, far], wire.name))
        if wire.pull is not Pull.NONE:
            rail = "GND" if wire.pull is Pull.DOWN else "+3V3"
            parts.append(make(f"R{index + PULL_OFFSET}", "20k", [far, rail], wire.name))
    return parts


def _test_header(pinout: Pinout) -> list[Component]:
    """Build the logic-analyser header: it taps each wire at its receiver, behind the series resistor."""
    taps: list[str | None] = [
        bluepill_net(wire)
        if wire.direction is WireDirection.TO_BLUEPILL or wire.role is WireRole.RESET
        else adapter_net(wire)
        for wire in pinout.wires
    ]
    return [make("J4", "HEADER24", [*taps, "GND", "GND"], "LOGIC 3.3V")]


def _supply(variant: str) -> list[Component]:
    common = [
        make("J1", "TERMINAL", ["VIN", "GND"], "12V IN"),
        make("F1", "PTC", ["VIN", "VIN_FUSED"]),
        make("D1", "SCHOTTKY", {"K": "+12V", "A": "VIN_FUSED"}),
        make("D2", "TVS12", {"K": "+12V", "A": "GND"}),
        make("C1", "C 100u", ["+12V", "GND"]),
        make("C2", "C 100n", ["+12V", "GND"]),
        make("J2", "VH2", ["5V_EXT", "GND"], "5V BANK"),
        make("D3", "SCHOTTKY 5V", {"K": "5V_BANK", "A": "5V_EXT"}),
        make("JP1", "HEADER3", ["5V_REG", "+5V", "5V_BANK"], "12V|5V"),
        make("C4", "C 22u", ["+5V", "GND"]),
        make("D4", "SCHOTTKY 5V", {"K": "BP_5V", "A": "+5V"}),
        make("D5", "SCHOTTKY 5V", {"K": "ESP_5V", "A": "+5V"}),
        make("R61", "2k2", ["+5V", "LED_POWER"]),
        make("D6", "LED green", {"K": "GND", "A": "LED_POWER"}, "POWER"),
        *(make(f"H{number}", "HOLE", []) for number in range(1, 5)),
    ]
    if variant != "lm317":
        return [*common, make("U3", "BUCK", ["+12V", "GND", "5V_REG"]), make("C3", "C 22u", ["5V_REG", "GND"])]
    return [
        *common,
        make("U3", "LM317", {"1": "ADJ_5V", "2": "5V_REG", "3": "+12V"}, "5V 250mA"),
        make("R68", "120R", ["5V_REG", "ADJ_5V"]),
        make("R69", "360R", ["ADJ_5V", "GND"]),
        make("C3", "C 22u", ["5V_REG", "GND"]),
        make("C11", "C 22u", ["ADJ_5V", "GND"]),
        make("U4", "LM317", {"1": "ADJ_3V3", "2": "+3V3", "3": "+12V"}, "3.3V"),
        make("R70", "120R", ["+3V3", "ADJ_3V3"]),
        make("R71", "200R", ["ADJ_3V3", "GND"]),
        make("C12", "C 22u", ["+3V3", "GND"]),
        make("C13", "C 22u", ["ADJ_3V3", "GND"]),
    ]


def _serial() -> list[Component]:
    """Build the RS-232 side: JP2 connects the spare driver as DTR, the spare receiver shows DSR on a test point.

    R73 holds the transmitter at mark while nothing drives IO17: during reset and boot.
    """
    return [
        make("U5", "MAX3232", [
            "RS_C1P", "RS_VP", "RS_C1M", "RS_C2P", "RS_C2M", "RS_VM", "DTR_ON", "RS_DSR",
            "DSR_N", "GND", "TXD", "RXD", "RS_RX", "RS_TX", "GND", "+3V3",
        ]),
        make("C5", "C 100n", ["RS_C1P", "RS_C1M"]),
        make("C6", "C 100n", ["RS_C2P", "RS_C2M"]),
        make("C7", "C 100n", ["RS_VP", "GND"]),
        make("C8", "C 100n", ["RS_VM", "GND"]),
        make("C9", "C 100n", ["+3V3", "GND"]),
        make("J3", "DE9", _DE9_PINS, "HOST"),
        make("JP2", "HEADER2", ["DTR_ON", "RS_DTR"], "DTR"),
        make("R62", "1k", ["ESP_TX", "TXD"]),
        make("R73", "10k", ["+3V3", "ESP_TX"]),
        make("R63", "1k", ["RXD", "ESP_RX"]),
        make("R64", "2k2", ["+3V3", "LED_TX"]),
        make("D7", "LED yellow", {"K": "ESP_TX", "A": "LED_TX"}, "TX"),
        make("R65", "2k2", ["+3V3", "LED_RX"]),
        make("D8", "LED yellow", {"K": "RXD", "A": "LED_RX"}, "RX"),
    ]  # fmt: skip


def _reset_and_mode(pinout: Pinout, variant: str) -> list[Component]:
    mode = adapter_net(pinout.wire("DD7")) if variant != "rev-c" else "MODE"
    return [
        make("Q1", "BC817", ["RST_BASE", "GND", "ESP_EN"]),
        make("R66", "4k7", ["RST_REQ", "RST_BASE"]),
        make("R67", "47k", ["RST_BASE", "GND"]),
        make("J5", "HEADER2", ["+3V3", "MODE_PULL"], "MODE"),
        make("R60", "2k2", ["MODE_PULL", mode]),
        # The module has no button but RESET. R75 holds the strap high at boot; R76 bears a press while IO0 drives.
        make("SW1", "PUSH BUTTON", ["BUTTON", "GND"], "BOOT"),
        make("R75", "10k", ["+3V3", "MODE_BUTTON"]),
        make("R76", "200R", ["MODE_BUTTON", "BUTTON"]),
    ]


def _stop() -> list[Component]:
    """Build the emergency stop's loop: open, cut or at ground it holds EN low (Q2) and the transmitter at mark (Q4).

    A contact that opens, or the jumper where there is none, joins the pins of J7. The two effects share nothing but
    the loop: TXD is held although the ESP32 should go on to drive IO17.
    """
    return [
        make("J7", "HEADER2", ["STOP_FEED", "STOP_OK"], "STOP"),
        make("R77", "200R", ["+3V3", "STOP_FEED"]),
        make("R78", "2k2", ["STOP_OK", "GND"]),
        make("C14", "C 100n", ["STOP_OK", "GND"]),
        make("R79", "4k7", ["STOP_OK", "STOP_SENSE"]),
        make("Q3", "BC807", ["STOP_SENSE", "+3V3", "STOP_ON"]),
        make("R80", "4k7", ["STOP_ON", "STOP_BASE"]),
        make("R81", "47k", ["STOP_BASE", "GND"]),
        make("Q2", "BC817", ["STOP_BASE", "GND", "ESP_EN"]),
        make("R82", "4k7", ["STOP_OK", "STOP_HOLD"]),
        make("Q4", "BC807", ["STOP_HOLD", "+3V3", "TXD"]),
    ]


def _test_points() -> list[Component]:
    return [make(f"TP{number}", "TP", [net], net) for number, net in enumerate(TEST_POINTS, start=1)]


def _shift_register(pinout: Pinout, variant: str) -> list[Component]:
    """Build rev C's distance outputs and a status LED on a pin that is free now.

    R74 holds the outputs released until the ESP32's program asks for them: in reset the pulls decide, as on rev B.
    """
    if variant != "rev-c":
        return []
    outputs = {
        dict(wire.esp32)["rev-c"]: adapter_net(wire) for wire in pinout.with_role(WireRole.DISTANCE)
    }  # fmt: skip
    names = ("QB", "QC", "QD", "QE", "QF", "QG", "QH", None, None, None, None, None, None, None, "QA", None)
    fixed: dict[int, str | None] = {
        8: "GND", 9: None, 10: "+3V3", 11: "SHIFT_CLOCK", 12: "SHIFT_LATCH", 13: "SHIFT_ENABLE", 14: "SHIFT_DATA",
        16: "+3V3",
    }  # fmt: skip
    pins = [
        outputs[f"HC595.{name}"] if name is not None else fixed[number] for number, name in enumerate(names, start=1)
    ]
    return [
        make("U6", "HC595", pins),
        make("C10", "C 100n", ["+3V3", "GND"]),
        make("R74", "10k", ["+3V3", "SHIFT_ENABLE"]),
        make("R72", "2k2", ["STATUS", "LED_STATUS"]),
        make("D9", "LED red", {"K": "GND", "A": "LED_STATUS"}, "STATUS"),
    ]


def _old_header(variant: str) -> list[Component]:
    """Build rev C's header for a straight ribbon from an old Pioneer 2's JP8, pin for pin: RS-232 over three wires.

    Its 12 V reach the board only while jumper JP3 is fitted: what JP8 can give is unknown. D10 keeps a battery at J1
    from feeding the robot, D1 the robot from feeding the battery.
    """
    if variant != "rev-c":
        return []
    return [
        make("J6", "BOX10", ["GND", None, "RS_RX", "JP8_12V", "RS_TX", "GND", None, None, "GND", None], "JP8"),
        make("F2", "PTC 0.5", ["JP8_12V", "JP8_FUSED"]),
        make("JP3", "HEADER2", ["JP8_FUSED", "JP8_FEED"], "JP8 12V"),
        make("D10", "SCHOTTKY", {"K": "+12V", "A": "JP8_FEED"}),
    ]


#: Nets with a test point, in the order of docs/board.md's table of voltages.
TEST_POINTS = ("GND", "+12V", "5V_REG", "+5V", "+3V3", "BP_5V", "ESP_5V", "ESP_EN", "RS_VP", "RS_VM", "RS_DTR", "DSR_N")

_AUXILIARY_NETS = {
    "p2os_rx": "ESP_RX", "p2os_tx": "ESP_TX", "status_led": "STATUS", "mode_button": "MODE_BUTTON",
    "shift_data": "SHIFT_DATA", "shift_clock": "SHIFT_CLOCK", "shift_latch": "SHIFT_LATCH",
    "shift_enable": "SHIFT_ENABLE",
}  # fmt: skip

#: HOST plug as a DTE: pin 2 receives, 3 sends, 4 asserts DTR, 6 listens to DSR; pin 0 is the shell.
_DE9_PINS: dict[str, str | None] = {
    "1": None, "2": "RS_RX", "3": "RS_TX", "4": "RS_DTR", "5": "GND", "6": "RS_DSR", "7": None, "8": None, "9": None,
    "0": "GND",
}  # fmt: skip
