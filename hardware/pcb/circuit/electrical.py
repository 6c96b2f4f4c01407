"""Plain arithmetic on the design: dividers, thresholds, power, completeness.

Each check returns a `Check` with the figure, the limit and the verdict, so that the
table of `make board-check` and the tests read the same values. No simulator here.
"""

from dataclasses import dataclass

from adapter_sim.pinout import WireDirection, load_pinout
from hardware.pcb.circuit.design import PULL_OFFSET, adapter_net, bluepill_net, series_wires
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS, NOT_5V_TOLERANT
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.part_numbers import disagreements
from hardware.pcb.circuit.parts import ACCESSORIES, PARTS, Part


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One figure against its limits."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    note: str = ""

    @property
    def is_good(self) -> bool:
        """Tell whether the figure lies within its limits, boundaries included."""
        return self.low <= self.value <= self.high

    def __str__(self) -> str:
        """Return the line that a person reads."""
        verdict = "ok  " if self.is_good else "FAIL"
        return f"{verdict} {self.name}: {self.value:.4g} {self.unit} (limits {self.low:.4g} to {self.high:.4g})"


def all_checks(design: BoardDesign) -> list[Check]:
    """Return every electrical check of a variant."""
    found = [*mode_divider(design), *logic_levels(design), *injection(design), *power_budget(design)]
    found += [*supply_margins(design), *reset_transistor(design), *ratings(design)]
    found += [*mode_button(design), *stop_loop(design)]
    if design.variant == "lm317":
        found += linear_regulators(design)
    return found


def ohms(design: BoardDesign, ref: str) -> float:
    """Return a resistor's value; KeyError where the reference is none."""
    return design.component(ref).part.facts["ohm"]


def mode_divider(design: BoardDesign) -> list[Check]:
    """Judge the mode jumper: fitted, the pin reads high against the ESP32's pull-down and the board's, if any."""
    esp = PARTS["ESP32"].facts
    at_pin = dict(design.component("R60").pins)["2"]
    pulls = [part for part in design.components if part.part.value == "20k" and ("1", at_pin) in part.pins]
    down = 1 / (1 / esp["pull_ohm"] + sum(1 / part.part.facts["ohm"] for part in pulls))
    level = RAIL_V * down / (down + ohms(design, "R60"))
    return [Check(name="mode jumper fitted, level at the ESP32", value=level, low=esp["vih_v"], high=RAIL_V, unit="V")]


def logic_levels(design: BoardDesign) -> list[Check]:
    """Judge the lowest high and the highest low that a receiver behind the series resistors sees."""
    bluepill, esp = PARTS["BLUEPILL"].facts, PARTS["ESP32"].facts
    highs, lows = [], []
    for index, wire in enumerate(series_wires(load_pinout()), start=1):
        series = ohms(design, f"R{index}")
        pull = f"R{index + PULL_OFFSET}"
        down = ohms(design, pull) if pull in {component.ref for component in design.components} else float("inf")
        divide = 1.0 if wire.direction is WireDirection.TO_BLUEPILL else 1 / (1 + series / down)
        highs.append(DRIVER_HIGH_V * divide)
        if wire.bluepill == "PC13":
            sunk_a = (RAIL_V - LED_V) / (LED_OHM + series)
            lows.append(DRIVER_LOW_V + sunk_a * series)
    return [
        Check(name="lowest high at an ESP32 input", value=min(highs), low=esp["vih_v"], high=RAIL_V, unit="V"),
        Check(name="highest low at the BluePill (PC13, against its LED)", value=max(lows), low=0.0,
              high=bluepill["vil_v"], unit="V"),
    ]  # fmt: skip


def injection(design: BoardDesign) -> list[Check]:
    """Judge what flows into an unpowered BluePill whose rail is held at 0 V: the worst case there is."""
    facts = PARTS["BLUEPILL"].facts
    wires = list(enumerate(series_wires(load_pinout()), start=1))
    into = [
        1e3 * (RAIL_V - CLAMP_V) / ohms(design, f"R{index}")
        for index, wire in wires
        if wire.direction is WireDirection.TO_BLUEPILL and wire.bluepill in NOT_5V_TOLERANT
    ]
    back = [
        1e3 * (RAIL_V - CLAMP_V) / ohms(design, f"R{index}")
        for index, wire in wires
        if wire.direction is WireDirection.TO_ADAPTER
    ]
    return [
        Check(name="injected into one BluePill pin", value=max(into), low=0, high=facts["injection_pin_ma"], unit="mA"),
        Check(name="injected into the BluePill in all", value=sum(into), low=0, high=facts["injection_total_ma"],
              unit="mA"),
        Check(name="injected into the ESP32 in all", value=sum(back), low=0, high=facts["injection_total_ma"],
              unit="mA", note="the ESP32's sheet names no limit: the STM32's is used"),
    ]  # fmt: skip


def load_ma(design: BoardDesign) -> float:
    """Return the greatest load on +5V: both modules at their peaks, transceiver, LEDs."""
    leds = sum(component.part.symbol == "LED" for component in design.components) * LED_MA
    rs232 = 2 * PARTS["MAX3232"].facts["swing_typ_v"] / 3.0 + PARTS["MAX3232"].facts["supply_ma"]
    rail = 0.0 if design.variant == "lm317" else 2 * rs232
    return PARTS["ESP32"].facts["current_max_ma"] + PARTS["BLUEPILL"].facts["current_max_ma"] + leds + rail


def power_budget(design: BoardDesign) -> list[Check]:
    """Judge supply against load; the LM317 is held to its stated average, for heat decides there."""
    checks = []
    if design.variant == "lm317":
        checks.append(
            Check(name="average load of +5V", value=LM317_AVERAGE_MA, low=0, high=LM317_LIMIT_MA, unit="mA",
                  note="memory: ESP32 with Bluetooth 100 mA, BluePill 40 mA, LEDs; peaks last milliseconds")
        )  # fmt: skip
        source_w, efficiency = LM317_LIMIT_MA * 1e-3 * BATTERY_MAX_V, 1.0
    else:
        limit = PARTS["BUCK"].facts["output_max_ma"]
        checks.append(Check(name="greatest load of +5V", value=load_ma(design), low=0, high=0.8 * limit, unit="mA"))
        source_w, efficiency = load_ma(design) * 5e-3, PARTS["BUCK"].facts["efficiency"]
    worst_a = source_w / efficiency / BATTERY_MIN_V
    fuses = [part for part in design.components if part.part.symbol == "FUSE"]
    checks += [
        Check(name=f"input current at the lowest battery through {fuse.ref}", value=worst_a, low=0,
              high=fuse.part.facts["hold_a"] * PTC_HOT, unit="A")
        for fuse in fuses
    ]  # fmt: skip
    return checks


def supply_margins(design: BoardDesign) -> list[Check]:
    """Judge voltages along the supply at the battery's extremes."""
    drop = PARTS["SCHOTTKY"].facts["forward_v"] + 0.5 * PARTS["PTC"].facts["ohm_max"]
    low_drop = PARTS["SCHOTTKY 5V"].facts["forward_v"]
    key = "LM317" if design.variant == "lm317" else "BUCK"
    needed = 5.0 + PARTS["LM317"].facts["dropout_v"] if key == "LM317" else PARTS["BUCK"].facts["input_min_v"]
    clamp, bears = PARTS["TVS12"].facts["clamp_v"], 40.0 if key == "LM317" else PARTS["BUCK"].facts["input_max_v"]
    return [
        Check(name="+12V at the lowest battery", value=BATTERY_MIN_V - drop, low=needed, high=bears, unit="V"),
        Check(name="TVS clamp against the regulator's limit", value=clamp, low=BATTERY_MAX_V, high=bears, unit="V"),
        Check(name="TVS stand-off above the battery", value=PARTS["TVS12"].facts["standoff_v"], low=BATTERY_MAX_V,
              high=bears, unit="V"),
        Check(name="5 V at a module behind its diode", value=5.0 * 0.98 - low_drop, low=MODULE_MIN_V, high=5.5,
              unit="V"),
        Check(name="5 V at a module from a power bank", value=BANK_MIN_V - 2 * low_drop, low=MODULE_MIN_V, high=5.5,
              unit="V", note="two diodes: D3 and the module's own"),
    ]  # fmt: skip


def reset_transistor(design: BoardDesign) -> list[Check]:
    """Judge the base current: enough to saturate with the module's pull-up as load."""
    base_a = (DRIVER_HIGH_V - 0.7) / ohms(design, "R66") - 0.7 / ohms(design, "R67")
    collector_a = RAIL_V / PARTS["ESP32"].facts["en_pull_ohm"]
    drive = base_a * PARTS["BC817"].facts["hfe_min"] / collector_a
    return [Check(name="reset transistor's overdrive", value=drive, low=10, high=1000, unit="x")]


def mode_button(design: BoardDesign) -> list[Check]:
    """Judge IO0, a strap: high at boot by the board's own pull, low while the button is held, whatever pulls."""
    esp = PARTS["ESP32"].facts
    strap = _net_at(design, "U2", "IO0")
    switches = {net for part in design.components if part.part.symbol == "SWITCH" for _, net in part.pins} - {"GND"}
    up = _parallel(_between(design, strap, "+3V3"))
    button = min((ohm for net in switches for ohm in _between(design, strap, net)), default=float("inf"))
    # A module may have a pull-up of its own, as those with a button have.
    against = _parallel([up, esp["en_pull_ohm"], esp["pull_ohm"]])
    return [
        Check(name="strap IO0: pull-up on the board", value=up, low=1e3, high=20e3, unit="ohm"),
        Check(name="strap IO0 with the button held", value=RAIL_V / (1 + against / button), low=0.0, high=esp["vil_v"],
              unit="V"),
        Check(name="IO0 driven high with the button held", value=1e3 * RAIL_V / button, low=0.0, high=20.0, unit="mA"),
    ]  # fmt: skip


def stop_loop(design: BoardDesign) -> list[Check]:
    """Judge the emergency stop: quiet while its loop is closed, and strong enough against what it overrides."""
    closed = RAIL_V * ohms(design, "R78") / (ohms(design, "R78") + ohms(design, "R77"))
    # Open: both bases drive into R78 through resistors of their own.
    bases = _parallel([ohms(design, "R79"), ohms(design, "R82")])
    base_a = (RAIL_V - 0.7) / (bases + ohms(design, "R78")) / 2
    hold_a = RAIL_V / ohms(design, "R62")
    reset_a = (RAIL_V - 0.2 - 0.7) / ohms(design, "R80") - 0.7 / ohms(design, "R81")
    return [
        Check(name="stop loop closed: emitter to base of Q3 and Q4", value=RAIL_V - closed, low=0.0, high=0.35,
              unit="V", note="below 0.45 V a transistor passes nothing at 40 degrees Celsius"),
        Check(name="stop loop closed: current that wets the contact", value=1e3 * closed / ohms(design, "R78"), low=1.0,
              high=10.0, unit="mA"),
        Check(name="stop loop shorted to ground", value=1e3 * RAIL_V / ohms(design, "R77"), low=0.0, high=30.0,
              unit="mA"),
        Check(name="TXD held against an IO17 that is low, overdrive", low=5, high=1000, unit="x",
              value=base_a * PARTS["BC807"].facts["hfe_min"] / hold_a),
        Check(name="EN held low by the stop, overdrive", low=10, high=1000, unit="x",
              value=reset_a * PARTS["BC817"].facts["hfe_min"] / (RAIL_V / PARTS["ESP32"].facts["en_pull_ohm"])),
    ]  # fmt: skip


def _net_at(design: BoardDesign, ref: str, pin: str) -> str | None:
    """Return the net at a module's pin, by its print."""
    names = {"U1": BLUEPILL_PINS, "U2": ESP32_PINS}[ref]
    return dict(design.component(ref).pins)[str(names.index(pin) + 1)]


def _between(design: BoardDesign, one: str | None, other: str | None) -> list[float]:
    """Return the resistors that join two nets."""
    return [
        part.part.facts["ohm"]
        for part in design.components
        if one is not None and "ohm" in part.part.facts and {net for _, net in part.pins} == {one, other}
    ]


def _parallel(ohm: list[float]) -> float:
    return 1 / sum(1 / one for one in ohm) if ohm else float("inf")


def ratings(design: BoardDesign) -> list[Check]:
    """Judge every capacitor's voltage and the hottest resistor's power."""
    worst = 0.0
    for component in design.components:
        if "farad" in component.part.facts:
            volts = max(abs(_NET_V.get(net or "", RAIL_V)) for _, net in component.pins)
            worst = max(worst, volts / component.part.facts["voltage_v"])
    watts = max(
        (RAIL_V**2 / component.part.facts["ohm"] for component in design.components
         if "ohm" in component.part.facts and component.ref not in {"R68", "R69", "R70", "R71"}),
        default=0.0,
    )  # fmt: skip
    return [
        Check(name="capacitor voltage used", value=100 * worst, low=0, high=80, unit="%"),
        Check(name="hottest signal resistor", value=1e3 * watts, low=0, high=62.5, unit="mW", note="half of 125 mW"),
    ]


def linear_regulators(design: BoardDesign) -> list[Check]:
    """Judge both LM317 dividers: level with the adjust current, minimum load without any other load."""
    facts = PARTS["LM317"].facts
    checks = []
    for rail, upper, lower, low, high in (("+5V", "R68", "R69", 4.75, 5.25), ("+3V3", "R70", "R71", 3.135, 3.465)):
        volts = facts["reference_v"] * (1 + ohms(design, lower) / ohms(design, upper))
        volts += facts["adjust_a"] * ohms(design, lower)
        load = 1e3 * facts["reference_v"] / ohms(design, upper)
        checks += [
            Check(name=f"LM317 {rail}", value=volts, low=low, high=high, unit="V"),
            Check(name=f"LM317 {rail} minimum load by its divider", value=load, low=facts["minimum_load_ma"], high=15,
                  unit="mA"),
        ]  # fmt: skip
    return checks


def netlist_faults(design: BoardDesign) -> list[str]:
    """Return what is incomplete in the netlist, one line each."""
    faults = [f"net {net} ends at {members[0]} alone" for net, members in design.nets().items() if len(members) < 2]
    nets = design.nets()
    for wire in series_wires(load_pinout()):
        faults += [f"{net} is missing" for net in (bluepill_net(wire), adapter_net(wire)) if net not in nets]
    for auxiliary in load_pinout().auxiliaries:
        pin = dict(auxiliary.esp32).get(design.revision)
        if auxiliary.name in _BOARD_AUXILIARIES and pin is None:
            faults.append(f"{auxiliary.name} has no pin in {design.revision}")
        elif pin is not None and _net_at(design, "U2", pin) is None:
            faults.append(f"{auxiliary.name} is on {pin}, which reaches nothing on this board")
    return faults


def bom_faults(design: BoardDesign) -> list[str]:
    """Return what is wrong in the bill of materials: missing, unproven without a question, not what its number says."""
    faults = [f"{where}: {fault}" for _, where, part in ACCESSORIES for fault in _order_faults(part)]
    for component in design.components:
        part = component.part
        missing = [name for name in ("value", "symbol", "footprint", "description") if not getattr(part, name)]
        if part.bought:
            missing += [name for name in ("manufacturer", "mpn", "source") if not getattr(part, name)]
        faults += [f"{component.ref}: no {name}" for name in missing]
        faults += [f"{component.ref}: {fault}" for fault in _order_faults(part)] if part.bought else []
    return faults


def _order_faults(part: Part) -> list[str]:
    unproven = "memory" in part.source and not part.ask
    return [*disagreements(part), *(["from memory, and no question to the distributor"] if unproven else [])]


#: The robot's battery: 12 V lead-acid, from empty to charging (reference: 11.2 V is the lower end in use).
BATTERY_MIN_V, BATTERY_MAX_V = 11.0, 14.8
RAIL_V = 3.3
#: Worst levels of a CMOS driver with a few mA of load (STM32F103 and ESP32 data sheets: VDD - 0.4 V, 0.4 V).
DRIVER_HIGH_V, DRIVER_LOW_V = 2.9, 0.1
#: Clamp diode of an input pin, conducting. memory: 0.65 V.
CLAMP_V = 0.65
#: The BluePill's LED on PC13 and its resistor (schematics of the board as sold: 510R to 1k).
LED_V, LED_OHM = 1.8, 510.0
LED_MA = 1.5
#: What an LM317 on SOT-223 may carry on a good heat sink at 40 degrees Celsius, and what the board takes on average
#: (spice/decks.py, thermal-lm317: with this board's own copper 250 mA is for peaks only).
LM317_LIMIT_MA, LM317_AVERAGE_MA = 250.0, 150.0
#: The same with the battery at its charging voltage.
LM317_CHARGING_MA = 150.0
#: A PTC holds about 85 % of its rating at 40 degrees Celsius. memory.
PTC_HOT = 0.85
#: Both modules' 3.3 V regulators need about 1.1 V above their output at most. memory.
MODULE_MIN_V = 4.3

#: What docs/board-build.md asks of a power bank, at 0.6 A.
BANK_MIN_V = 4.9

_BOARD_AUXILIARIES = frozenset({"p2os_rx", "p2os_tx", "mode_jumper", "mode_button"})
_NET_V = {
    "VIN": BATTERY_MAX_V, "VIN_FUSED": BATTERY_MAX_V, "+12V": BATTERY_MAX_V, "5V_REG": 5.0, "+5V": 5.0, "ADJ_5V": 3.75,
    "RS_VP": 5.5, "RS_VM": -5.5, "RS_C1P": 5.5, "RS_C1M": 3.3, "RS_C2P": 5.5, "RS_C2M": -5.5, "GND": 0.0,
}  # fmt: skip
