"""Signals: reset, RS-232 levels, and current that one module feeds into the other."""

from adapter_sim.pinout import Direction, load_pinout
from hardware.pcb.circuit.design import series_wires
from hardware.pcb.circuit.electrical import ohms
from hardware.pcb.circuit.modules import NOT_5V_TOLERANT
from hardware.pcb.circuit.netlist import Design
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.spice.deck import BC817, CLAMP, MAX3232, Deck, limits


def signal_decks(design: Design) -> tuple[Deck, ...]:
    """Return the decks of a variant's signals."""
    return (_reset(design), _rs232(), _rs232_low(), _back_power(design), _back_power_esp(design))


def _reset(design: Design) -> Deck:
    circuit = f"""
{BC817}
V3 v3 0 3.3
Vpin pin 0 PULSE(0 2.9 10m 1u 1u 30m 200m)
* rev B
Rb pin b {ohms(design, "R66"):g}
Rbe b 0 {ohms(design, "R67"):g}
Rup v3 en 10k
Cen en 0 1u
Q1 en b 0 BC817
* the thesis: 2k2 in the emitter and at the collector
Rb2 pin b2 2.2k
Rup2 v3 en2 10k
Rc2 v3 en2 2.2k
Cen2 en2 0 1u
Re2 e2 0 2.2k
Q2 en2 b2 e2 BC817
.tran 20u 100m
"""
    return Deck(
        name="reset", title="Reset: level at the ESP32's EN", circuit=circuit,
        measures=("tran en_low find v(en) at=39m", "tran en_thesis find v(en2) at=39m",
                  "tran en_back find v(en) at=99m",
                  "tran fall trig v(pin) val=1.5 rise=1 targ v(en) val=0.6 fall=1"),
        limits=limits(("en_low", -0.1, 0.3, "V", "EN while PB13 is high"),
                      ("en_thesis", 0.83, 3.3, "V", "the thesis's circuit never gets below the threshold"),
                      ("en_back", 2.9, 3.3, "V", "EN 59 ms after the release"),
                      ("fall", 0, 5e-3, "s", "time until EN is low")),
        traces=(("v(pin)", "PB13"), ("v(en)", "EN, rev B"), ("v(en2)", "EN, thesis")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "It takes the module's pull-up (10k) and capacitor (1 uF) as they are usually fitted; clones "
            "differ."
        ),
    )  # fmt: skip


def _serial(vcc: float) -> str:
    return f"""
.param cpump={PARTS["C 100n"].facts["farad"]:g}
{MAX3232}
Vcc vcc 0 {vcc:g}
Vtx tx 0 PULSE(0 3.3 0.2m 1u 1u 104u 208u)
Vdin2 din2 0 0
X1 vcc vp vm tx dout din2 dtr MAX3232
Cvp vp 0 100n
Cvm vm 0 100n
Rtx dout 0 3k
Ctx dout 0 1n
Rdtr dtr 0 3k
.ic v(vp)=5.4 v(vm)=-5.4
.options method=gear
.tran 0.2u 2m uic
"""


def _rs232() -> Deck:
    return Deck(
        name="rs232", title="RS-232 levels at 3.3 V, 3 kohm at TX and DTR, 9600 baud", circuit=_serial(3.3),
        measures=("tran high max v(dout) from=0.5m to=2m", "tran low min v(dout) from=0.5m to=2m",
                  "tran dtr_low min v(dtr) from=0.5m to=2m"),
        limits=limits(("high", 5.0, 15, "V", "space on TX"),
                      ("low", -15, -5.0, "V", "mark on TX"),
                      ("dtr_low", 5.0, 15, "V", "DTR asserted, at its lowest")),
        traces=(("v(dout)", "TX (DE-9 pin 3)"), ("v(dtr)", "DTR (DE-9 pin 4)"), ("v(tx)", "TXD, logic")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "An averaged pump has no ripple and no spread; the sheet guarantees 5.0 V, the model is fitted to "
            "its typical 5.4 V."
        ),
    )  # fmt: skip


def _rs232_low() -> Deck:
    return Deck(
        name="rs232-low", title="RS-232 levels at 3.0 V", circuit=_serial(3.0),
        measures=("tran high max v(dout) from=0.5m to=2m", "tran low min v(dout) from=0.5m to=2m",
                  "tran dtr_low min v(dtr) from=0.5m to=2m"),
        limits=limits(("high", 3.7, 15, "V", "space on TX: a receiver needs 3 V"),
                      ("low", -15, -3.7, "V", "mark on TX: a receiver needs -3 V"),
                      ("dtr_low", 3.7, 15, "V", "DTR asserted")),
        traces=(("v(dout)", "TX"), ("v(dtr)", "DTR")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "Whether the ESP32 module's regulator really falls to 3.0 V: this is only the lower end of the "
            "transceiver's range."
        ),
    )  # fmt: skip


def _back_power(design: Design) -> Deck:
    lines = "\n".join(
        f"Vd{n} d{n} 0 3.3\nRo{n} d{n} e{n} 30\nRs{n} e{n} p{n} {ohms(design, ref):g}\nDc{n} p{n} rail CLAMP"
        for n, ref in enumerate(_clamped(design))
    )
    circuit = f"""
{CLAMP}
{lines}
{_RAIL}
"""
    return Deck(
        name="back-power", title="ESP32 on, BluePill off: current through the series resistors", circuit=circuit,
        measures=("dc all_pins find v(total) at=0", "dc pin min i(vd0)", "dc rail100 find v(rail) when v(meet)=0"),
        limits=limits(("all_pins", 0, 25, "mA", "into the BluePill in all, its rail held at 0 V"),
                      ("pin", -5e-3, 0, "A", "into the pin with the smallest resistor"),
                      ("rail100", 0, 2.0, "V", "rail with a load of 100 ohm: below where an STM32F103 runs")),
        traces=(("v(total)", "into the BluePill, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered BluePill, V", y_label="mA",
        cannot_say=(
            "What an unpowered chip does with it: its rail is a voltage here; 5 V tolerant pins are taken to "
            "have no clamp."
        ),
    )  # fmt: skip


#: The unpowered rail as a swept source: what enters it, and what a load of 100 ohm would take, both in mA.
_RAIL = """
Vrail rail 0 0
Btotal total 0 V = 1000*I(Vrail)
Bload load 0 V = 1000*V(rail)/100
Bmeet meet 0 V = V(total) - V(load)
.dc Vrail 0 3 0.02
"""


def _clamped(design: Design) -> list[str]:
    found = [
        (ohms(design, f"R{number}"), f"R{number}")
        for number, wire in enumerate(series_wires(load_pinout()), start=1)
        if wire.direction is Direction.TO_BLUEPILL and wire.bluepill in NOT_5V_TOLERANT
    ]
    return [ref for _, ref in sorted(found)]


def _back_power_esp(design: Design) -> Deck:
    lines = "\n".join(f"Rs{n} on p{n} {ohms(design, ref) + 30:g}\nDc{n} p{n} rail CLAMP"
                      for n, ref in enumerate(_driven_by_bluepill()))  # fmt: skip
    circuit = f"""
{CLAMP}
Von on 0 3.3
{lines}
{_RAIL}
"""
    return Deck(
        name="back-power-esp32", title="BluePill on, ESP32 off: current through the series resistors", circuit=circuit,
        measures=("dc all_pins find v(total) at=0", "dc rail100 find v(rail) when v(meet)=0"),
        limits=limits(("all_pins", 0, 25, "mA", "into the ESP32 in all, its rail held at 0 V"),
                      ("rail100", 0, 2.3, "V", "rail with a load of 100 ohm: below the ESP32's brown-out level")),
        traces=(("v(total)", "into the ESP32, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered ESP32, V", y_label="mA",
        cannot_say="The ESP32's sheet gives no injection limit; the STM32's is borrowed.",
    )  # fmt: skip


def _driven_by_bluepill() -> list[str]:
    wires = enumerate(series_wires(load_pinout()), start=1)
    return [f"R{number}" for number, wire in wires if wire.direction is Direction.TO_ADAPTER]
