"""The questions that the simulator is asked: circuit, measures, limits, and what the answer cannot say.

Values come from the design, so that a changed resistor changes the deck.
"""

from dataclasses import dataclass

from adapter_sim.pinout import Direction, load_pinout
from hardware.pcb.design import build, series_wires
from hardware.pcb.electrical import BATTERY_MAX_V, LM317_AVERAGE_MA, LM317_CHARGING_MA, LM317_LIMIT_MA, load_ma, ohms
from hardware.pcb.modules import NOT_5V_TOLERANT
from hardware.pcb.netlist import Design
from hardware.pcb.parts import PARTS
from hardware.pcb.spice import models


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A measured figure and the range that it must lie in."""

    measure: str
    low: float
    high: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Deck:
    """One simulation."""

    name: str
    title: str
    #: Circuit lines; the analysis line last.
    circuit: str
    #: `meas` lines without the word itself.
    measures: tuple[str, ...]
    limits: tuple[Limit, ...]
    #: Plotted traces: expression and legend.
    traces: tuple[tuple[str, str], ...]
    x_label: str
    y_label: str
    cannot_say: str
    #: Multiplies the sweep's values for the plot's axis.
    x_scale: float = 1.0


def decks() -> tuple[Deck, ...]:
    """Return every simulation of the board, in the order of docs/board-simulation.md."""
    buck, linear = build("rev-b"), build("lm317")
    return (
        _reset(buck), _startup_buck(), _startup_lm317(linear), _step_buck(), _step_lm317(linear), _minimum_load(linear),
        _thermal_lm317(), _thermal_buck(buck), _rs232(), _rs232_low(), _back_power(buck), _back_power_esp(buck),
        _inrush(), _reverse(),
    )  # fmt: skip


def _reset(design: Design) -> Deck:
    circuit = f"""
{models.BC817}
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
        measures=("tran en_low min v(en)", "tran en_thesis min v(en2)", "tran en_back find v(en) at=99m",
                  "tran fall trig v(pin) val=1.5 rise=1 targ v(en) val=0.6 fall=1"),
        limits=(Limit(measure="en_low", low=-0.1, high=0.3, unit="V", meaning="EN while PB13 is high"),
                Limit(measure="en_thesis", low=0.83, high=3.3, unit="V", meaning="the thesis's circuit never gets below the threshold"),
                Limit(measure="en_back", low=2.9, high=3.3, unit="V", meaning="EN 59 ms after the release"),
                Limit(measure="fall", low=0, high=5e-3, unit="s", meaning="time until EN is low")),
        traces=(("v(pin)", "PB13"), ("v(en)", "EN, rev B"), ("v(en2)", "EN, thesis")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="It takes the module's pull-up (10k) and capacitor (1 uF) as they are usually fitted; clones differ.",
    )  # fmt: skip


_INPUT = """
Vbat bat 0 PWL(0 0 1m 0 1.01m 12)
Rbat bat f 0.1
Rptc f a 0.13
D1 a p12 B340A
C1 p12 c1 100u
R1 c1 0 0.15
"""


def _startup_buck() -> Deck:
    circuit = f"""
{models.B340A}
{models.BUCK}
{_INPUT}
X1 p12 0 reg BUCK
C3 reg 0 22u
C4 reg 0 22u
Rload reg 0 25
.tran 5u 12m
"""
    return Deck(
        name="startup-buck", title="Start-up, rev B (buck module)", circuit=circuit,
        measures=("tran end find v(reg) at=11m", "tran top max v(reg)", "tran up trig v(bat) val=6 rise=1 targ v(reg) val=4.75 rise=1"),
        limits=(Limit(measure="end", low=4.9, high=5.1, unit="V", meaning="5 V after start"),
                Limit(measure="top", low=4.9, high=5.25, unit="V", meaning="highest 5 V on the way"),
                Limit(measure="up", low=0, high=10e-3, unit="s", meaning="time to 4.75 V")),
        traces=(("v(p12)", "+12V"), ("v(reg)", "5V_REG")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="The module's true soft start is not in its data sheet: 2 ms is assumed, so only the absence of an overshoot is asked.",
    )  # fmt: skip


def _lm317(design: Design, upper: str, lower: str) -> str:
    return f"""
{models.B340A}
{models.LM317}
{_INPUT}
X1 p12 adj out LM317
R68 out adj {ohms(design, upper):g}
R69 adj 0 {ohms(design, lower):g}
Cadj adj 0 22u
Cout out co 22u
Resr co 0 5m
C4 out c4 22u
Resr4 c4 0 5m
"""


def _startup_lm317(design: Design) -> Deck:
    circuit = f"""
{_lm317(design, "R68", "R69")}
Rload out 0 25
.tran 5u 60m
"""
    return Deck(
        name="startup-lm317", title="Start-up, variant lm317 (5 V)", circuit=circuit,
        measures=("tran end find v(out) at=59m", "tran top max v(out)", "tran up trig v(bat) val=6 rise=1 targ v(out) val=4.75 rise=1"),
        limits=(Limit(measure="end", low=4.75, high=5.25, unit="V", meaning="5 V after start"),
                Limit(measure="top", low=4.75, high=5.3, unit="V", meaning="highest 5 V on the way"),
                Limit(measure="up", low=0, high=50e-3, unit="s", meaning="time to 4.75 V (the ADJ capacitor makes it slow)")),
        traces=(("v(p12)", "+12V"), ("v(out)", "5 V"), ("v(adj)", "ADJ")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Loop stability with ceramic capacitors: the model is stable by construction.",
    )  # fmt: skip


def _step_buck() -> Deck:
    circuit = f"""
{models.BUCK}
Vin p12 0 11.2
X1 p12 0 reg BUCK
C3 reg c3 22u
R3 c3 0 5m
C4 reg c4 22u
R4 c4 0 5m
Iload reg 0 PULSE(20m 500m 8m 1u 1u 2m 10m)
.tran 1u 12m 6m
"""
    return Deck(
        name="step-buck", title="Load step 20 to 500 mA, rev B", circuit=circuit,
        measures=("tran low min v(reg)", "tran top max v(reg)", "tran settled find v(reg) at=9.9m"),
        limits=(Limit(measure="low", low=4.75, high=5.1, unit="V", meaning="lowest 5 V"),
                Limit(measure="top", low=4.9, high=5.25, unit="V", meaning="highest 5 V when the load goes"),
                Limit(measure="settled", low=4.9, high=5.1, unit="V", meaning="5 V after 1.9 ms of load")),
        traces=(("v(reg)", "5V_REG"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Shape and ringing: the model's impedance is fitted to one figure of the data sheet (150 mV for half the load).",
    )  # fmt: skip


def _step_lm317(design: Design) -> Deck:
    circuit = f"""
{models.LM317}
Vin p12 0 11.2
X1 p12 adj out LM317
R68 out adj {ohms(design, "R68"):g}
R69 adj 0 {ohms(design, "R69"):g}
Cadj adj 0 22u
Cout out co 22u
Resr co 0 5m
C4 out c4 22u
Resr4 c4 0 5m
Iload out 0 PULSE(20m {LM317_LIMIT_MA:g}m 100m 1u 1u 2m 10m)
.tran 2u 104m 98m
"""
    return Deck(
        name="step-lm317", title=f"Load step 20 to {LM317_LIMIT_MA:g} mA, variant lm317", circuit=circuit,
        measures=("tran low min v(out)", "tran top max v(out)", "tran settled find v(out) at=101.9m"),
        limits=(Limit(measure="low", low=4.75, high=5.1, unit="V", meaning="lowest 5 V"),
                Limit(measure="top", low=4.9, high=5.25, unit="V", meaning="highest 5 V when the load goes"),
                Limit(measure="settled", low=4.85, high=5.15, unit="V", meaning="5 V after 1.9 ms of load")),
        traces=(("v(out)", "5 V"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Ringing and stability: the loop is not modelled; dips below a microsecond belong to the capacitors' inductance.",
    )  # fmt: skip


def _minimum_load(design: Design) -> Deck:
    circuit = f"""
{models.LM317}
Vin p12 0 11.2
X1 p12 a1 ours LM317
R1 ours a1 {ohms(design, "R70"):g}
R2 a1 0 {ohms(design, "R71"):g}
X2 p12 a2 thesis LM317
R3 thesis a2 3.3k
R4 a2 0 5.1k
Gl1 ours 0 cur 0 1
Gl2 thesis 0 cur 0 1
Vcur cur 0 0
.dc Vcur 0 8m 0.1m
"""
    return Deck(
        name="minimum-load", title="3.3 V rail of the LM317 at light load", circuit=circuit,
        measures=("dc ours_idle find v(ours) at=0", "dc thesis_idle find v(thesis) at=0", "dc thesis_1ma find v(thesis) at=1m",
                  "dc ours_end find v(ours) at=8m"),
        limits=(Limit(measure="ours_idle", low=3.135, high=3.465, unit="V", meaning="ours without any load"),
                Limit(measure="ours_end", low=3.135, high=3.465, unit="V", meaning="ours at 8 mA"),
                Limit(measure="thesis_1ma", low=3.6, high=12, unit="V", meaning="the thesis's divider at 1 mA: above what a 3.3 V pin bears")),
        traces=(("v(ours)", "120R / 200R (ours)"), ("v(thesis)", "3k3 / 5k1 (thesis)")),
        x_label="load, mA", y_label="V", x_scale=1e3,
        cannot_say="It takes the typical minimum load (3.5 mA); our divider draws 10.4 mA and holds for the worst chip (10 mA) too.",
    )  # fmt: skip


def _thermal_lm317() -> Deck:
    facts = PARTS["LM317"].facts
    drop = 0.45
    watts = (11.2 - drop - 5.0) * (LM317_LIMIT_MA + 10.4) * 1e-3
    over = (11.2 - drop - 5.0) * 0.51
    charging = (BATTERY_MAX_V - drop - 5.0) * (LM317_CHARGING_MA + 10.4) * 1e-3
    circuit = f"""
* heat as current, kelvin as volts: ambient in series with the package's resistance
Vamb amb 0 0
Rth tj amb {facts["kelvin_per_watt"]:g}
Ip 0 tj {watts:g}
Rth5 tj5 amb {facts["kelvin_per_watt"]:g}
Ip5 0 tj5 {over:g}
Rthm tjm amb 136
Ipm 0 tjm {watts:g}
Rtho tjo amb 80
Ipo 0 tjo {(11.2 - drop - 5.0) * (LM317_AVERAGE_MA + 10.4) * 1e-3:g}
Rthc tjc amb {facts["kelvin_per_watt"]:g}
Ipc 0 tjc {charging:g}
.dc Vamb 0 60 1
"""
    return Deck(
        name="thermal-lm317", title="LM317 (5 V): junction temperature against ambient, from 11.2 V", circuit=circuit,
        measures=("dc tj25 find v(tj) at=25", "dc tj40 find v(tj) at=40", "dc over40 find v(tj5) at=40", "dc charging40 find v(tjc) at=40",
                  "dc own40 find v(tjo) at=40"),
        limits=(Limit(measure="tj25", low=25, high=facts["junction_max_c"], unit="C", meaning="250 mA at 25 degrees"),
                Limit(measure="tj40", low=40, high=facts["junction_max_c"], unit="C",
                      meaning="250 mA at 40 degrees, battery at 11.2 V: the stated limit"),
                Limit(measure="own40", low=40, high=facts["junction_max_c"], unit="C",
                      meaning="150 mA at 40 degrees with this board's own copper (about 80 K/W)"),
                Limit(measure="charging40", low=40, high=facts["junction_max_c"], unit="C",
                      meaning="150 mA at 40 degrees, battery at 14.8 V (charging)"),
                Limit(measure="over40", low=150, high=400, unit="C", meaning="500 mA at 40 degrees would shut it down")),
        traces=(("v(tj)", "250 mA, 53 K/W"), ("v(tjc)", "150 mA from 14.8 V, 53 K/W"), ("v(tjo)", "150 mA, 80 K/W"), ("v(tj5)", "500 mA, 53 K/W"), ("v(tjm)", "250 mA, minimum pad 136 K/W")),
        x_label="ambient, degrees C", y_label="degrees C",
        cannot_say="53 K/W is a four-layer test board and 80 K/W our guess for this board: measure before drawing more than 150 mA for long.",
    )  # fmt: skip


def _thermal_buck(design: Design) -> Deck:
    amps = load_ma(design) * 1e-3
    loss = 5 * amps * (1 / PARTS["BUCK"].facts["efficiency"] - 1)
    circuit = f"""
* the sheet derates 2.4 %/K above 60 C from 1 A: what the module may carry, against what it must
Vamb amb 0 0
Bmay may 0 V = 1000*min(1, max(0, 1 - 0.024*(V(amb) - 60)))
Bmust must 0 V = {1e3 * amps:g}
Vloss loss 0 {loss:g}
Rl loss 0 1k
.dc Vamb 0 85 1
"""
    return Deck(
        name="thermal-buck", title="Buck module: allowed current against ambient", circuit=circuit,
        measures=("dc may40 find v(may) at=40", "dc may70 find v(may) at=70", "dc loss find v(loss) at=25"),
        limits=(Limit(measure="may40", low=load_ma(design), high=1000, unit="mA", meaning="allowed at 40 degrees"),
                Limit(measure="may70", low=load_ma(design), high=1000, unit="mA", meaning="allowed at 70 degrees: still above the greatest load"),
                Limit(measure="loss", low=0, high=0.6, unit="W", meaning="loss at the greatest load")),
        traces=(("v(may)", "allowed (data sheet)"), ("v(must)", "greatest load")),
        x_label="ambient, degrees C", y_label="mA",
        cannot_say="Nothing about heat from the ESP32 above it: the sheet's curve is for still air around the module.",
    )  # fmt: skip


def _serial(vcc: float) -> str:
    return f"""
.param cpump={PARTS["C 100n"].facts["farad"]:g}
{models.MAX3232}
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
        measures=("tran high max v(dout) from=0.5m to=2m", "tran low min v(dout) from=0.5m to=2m", "tran dtr min v(dtr) from=0.5m to=2m"),
        limits=(Limit(measure="high", low=5.0, high=15, unit="V", meaning="space on TX"),
                Limit(measure="low", low=-15, high=-5.0, unit="V", meaning="mark on TX"),
                Limit(measure="dtr", low=5.0, high=15, unit="V", meaning="DTR asserted, at its lowest")),
        traces=(("v(dout)", "TX (DE-9 pin 3)"), ("v(dtr)", "DTR (DE-9 pin 4)"), ("v(tx)", "TXD, logic")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="An averaged pump has no ripple and no spread; the sheet guarantees 5.0 V, the model is fitted to its typical 5.4 V.",
    )  # fmt: skip


def _rs232_low() -> Deck:
    return Deck(
        name="rs232-low", title="RS-232 levels at 3.0 V", circuit=_serial(3.0),
        measures=("tran high max v(dout) from=0.5m to=2m", "tran low min v(dout) from=0.5m to=2m", "tran dtr min v(dtr) from=0.5m to=2m"),
        limits=(Limit(measure="high", low=3.7, high=15, unit="V", meaning="space on TX: a receiver needs 3 V"),
                Limit(measure="low", low=-15, high=-3.7, unit="V", meaning="mark on TX: a receiver needs -3 V"),
                Limit(measure="dtr", low=3.7, high=15, unit="V", meaning="DTR asserted")),
        traces=(("v(dout)", "TX"), ("v(dtr)", "DTR")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Whether the ESP32 module's regulator really falls to 3.0 V: this is only the lower end of the transceiver's range.",
    )  # fmt: skip


def _back_power(design: Design) -> Deck:
    lines = "\n".join(f"Vd{n} d{n} 0 3.3\nRo{n} d{n} e{n} 30\nRs{n} e{n} p{n} {ohms(design, ref):g}\nDc{n} p{n} rail CLAMP"
                      for n, ref in enumerate(_clamped(design)))  # fmt: skip
    circuit = f"""
{models.CLAMP}
{lines}
{_RAIL}
"""
    return Deck(
        name="back-power", title="ESP32 on, BluePill off: current through the series resistors", circuit=circuit,
        measures=("dc total find v(total) at=0", "dc pin min i(vd0)", "dc rail100 find v(rail) when v(meet)=0"),
        limits=(Limit(measure="total", low=0, high=25, unit="mA", meaning="into the BluePill in all, its rail held at 0 V"),
                Limit(measure="pin", low=-5e-3, high=0, unit="A", meaning="into the pin with the smallest resistor"),
                Limit(measure="rail100", low=0, high=2.0, unit="V", meaning="rail with a load of 100 ohm: below where an STM32F103 runs")),
        traces=(("v(total)", "into the BluePill, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered BluePill, V", y_label="mA",
        cannot_say="What an unpowered chip does with it: its rail is a voltage here; 5 V tolerant pins are taken to have no clamp.",
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
                      for n, ref in enumerate(_driven_by_bluepill(design)))  # fmt: skip
    circuit = f"""
{models.CLAMP}
Von on 0 3.3
{lines}
{_RAIL}
"""
    return Deck(
        name="back-power-esp32", title="BluePill on, ESP32 off: current through the series resistors", circuit=circuit,
        measures=("dc total find v(total) at=0", "dc rail100 find v(rail) when v(meet)=0"),
        limits=(Limit(measure="total", low=0, high=25, unit="mA", meaning="into the ESP32 in all, its rail held at 0 V"),
                Limit(measure="rail100", low=0, high=2.3, unit="V", meaning="rail with a load of 100 ohm: below the ESP32's brown-out level")),
        traces=(("v(total)", "into the ESP32, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered ESP32, V", y_label="mA",
        cannot_say="The ESP32's sheet gives no injection limit; the STM32's is borrowed.",
    )  # fmt: skip


def _driven_by_bluepill(design: Design) -> list[str]:
    wires = enumerate(series_wires(load_pinout()), start=1)
    _ = design
    return [f"R{number}" for number, wire in wires if wire.direction is Direction.TO_ADAPTER]


def _inrush() -> Deck:
    circuit = f"""
{models.B340A}
Vbat bat 0 PWL(0 0 10u 0 11u {BATTERY_MAX_V:g})
Rbat bat w 0.08
Lwire w f 0.7u
Rptc f a {PARTS["PTC"].facts["ohm_min"]:g}
D1 a p12 B340A
C1 p12 c1 100u
R1 c1 0 {PARTS["C 100u"].facts["esr_ohm"]:g}
Bi2 0 q I = I(Vbat)*I(Vbat)
Cq q 0 1
Rq q 0 1g
.tran 0.2u 400u
"""
    return Deck(
        name="inrush", title="Inrush when a full battery is connected (wire 0.7 uH, 0.08 ohm)", circuit=circuit,
        measures=("tran peak min i(vbat)", "tran i2t max v(q)", "tran top max v(p12)"),
        limits=(Limit(measure="peak", low=-60, high=0, unit="A", meaning="peak current (out of the battery: negative); the diode bears 80 A"),
                Limit(measure="i2t", low=0, high=0.5, unit="A2s", meaning="energy: the fuse needs some 30 A2s to trip"),
                Limit(measure="top", low=12, high=24.4, unit="V", meaning="highest +12V: below the suppressor's clamp")),
        traces=(("-i(vbat)", "current, A"), ("v(p12)", "+12V, V")), x_label="time, us", y_label="A, V", x_scale=1e6,
        cannot_say="Contact bounce and the true battery: resistance and wire are assumed, a stiffer source gives more.",
    )  # fmt: skip


def _reverse() -> Deck:
    circuit = f"""
{models.B340A}
{models.SMBJ15A}
Vbat bat 0 PWL(0 -15 3 15)
Rbat bat f 0.1
Rptc f a 0.13
D1 a p12 B340A
D2 0 p12 SMBJ15A
C1 p12 0 100u
Rload p12 0 100
.tran 5m 3
"""
    return Deck(
        name="reverse", title="Battery swept from -15 V (wrong way round) to +15 V", circuit=circuit,
        measures=("tran wrong find v(p12) at=0.02", "tran leak find i(vbat) at=0.02", "tran right find v(p12) at=2.98"),
        limits=(Limit(measure="wrong", low=-0.3, high=0.1, unit="V", meaning="+12V with -14.8 V at the input"),
                Limit(measure="leak", low=-1e-3, high=1e-3, unit="A", meaning="current that flows then"),
                Limit(measure="right", low=13.8, high=14.8, unit="V", meaning="+12V with +14.8 V at the input")),
        traces=(("v(bat)", "battery"), ("v(p12)", "+12V")), x_label="time, s", y_label="V",
        cannot_say="Hot leakage: a Schottky diode at 100 degrees leaks a hundred times more, still milliamperes.",
    )  # fmt: skip
