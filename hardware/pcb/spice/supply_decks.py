"""Supplies: start-up, load steps, light load, inrush and a battery the wrong way round."""

from hardware.pcb.circuit.electrical import BATTERY_MAX_V, LM317_LIMIT_MA, ohms
from hardware.pcb.circuit.netlist import Design
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.spice.deck import B340A, BUCK, LM317, SMBJ15A, Deck, limits


def supply_decks(linear: Design) -> tuple[Deck, ...]:
    """Return the decks of both supplies; `linear` is the variant lm317."""
    return (
        _startup_buck(), _startup_lm317(linear), _step_buck(), _step_lm317(linear), _minimum_load(linear),
        _inrush(), _reverse(),
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
{B340A}
{BUCK}
{_INPUT}
X1 p12 0 reg BUCK
C3 reg 0 22u
C4 reg 0 22u
Rload reg 0 25
.tran 5u 12m
"""
    return Deck(
        name="startup-buck", title="Start-up, rev B (buck module)", circuit=circuit,
        measures=("tran end find v(reg) at=11m", "tran top max v(reg)",
                  "tran up trig v(bat) val=6 rise=1 targ v(reg) val=4.75 rise=1"),
        limits=limits(("end", 4.9, 5.1, "V", "5 V after start"),
                      ("top", 4.9, 5.25, "V", "highest 5 V on the way"),
                      ("up", 0, 10e-3, "s", "time to 4.75 V")),
        traces=(("v(p12)", "+12V"), ("v(reg)", "5V_REG")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "The module's true soft start is not in its data sheet: 2 ms is assumed, so only the absence of an "
            "overshoot is asked."
        ),
    )  # fmt: skip


def _lm317(design: Design, upper: str, lower: str) -> str:
    return f"""
{B340A}
{LM317}
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
        measures=("tran end find v(out) at=59m", "tran top max v(out)",
                  "tran up trig v(bat) val=6 rise=1 targ v(out) val=4.75 rise=1"),
        limits=limits(("end", 4.75, 5.25, "V", "5 V after start"),
                      ("top", 4.75, 5.3, "V", "highest 5 V on the way"),
                      ("up", 0, 50e-3, "s", "time to 4.75 V (the ADJ capacitor makes it slow)")),
        traces=(("v(p12)", "+12V"), ("v(out)", "5 V"), ("v(adj)", "ADJ")), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Loop stability with ceramic capacitors: the model is stable by construction.",
    )  # fmt: skip


def _step_buck() -> Deck:
    circuit = f"""
{BUCK}
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
        limits=limits(("low", 4.75, 5.1, "V", "lowest 5 V"),
                      ("top", 4.9, 5.25, "V", "highest 5 V when the load goes"),
                      ("settled", 4.9, 5.1, "V", "5 V after 1.9 ms of load")),
        traces=(("v(reg)", "5V_REG"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "Shape and ringing: the model's impedance is fitted to one figure of the data sheet (150 mV for half "
            "the load)."
        ),
    )  # fmt: skip


def _step_lm317(design: Design) -> Deck:
    circuit = f"""
{LM317}
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
        limits=limits(("low", 4.75, 5.1, "V", "lowest 5 V"),
                      ("top", 4.9, 5.25, "V", "highest 5 V when the load goes"),
                      ("settled", 4.85, 5.15, "V", "5 V after 1.9 ms of load")),
        traces=(("v(out)", "5 V"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "Ringing and stability: the loop is not modelled; dips below a microsecond belong to the capacitors' "
            "inductance."
        ),
    )  # fmt: skip


def _minimum_load(design: Design) -> Deck:
    circuit = f"""
{LM317}
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
        measures=("dc ours_idle find v(ours) at=0", "dc thesis_idle find v(thesis) at=0",
                  "dc thesis_1ma find v(thesis) at=1m",
                  "dc ours_end find v(ours) at=8m"),
        limits=limits(("ours_idle", 3.135, 3.465, "V", "ours without any load"),
                      ("ours_end", 3.135, 3.465, "V", "ours at 8 mA"),
                      ("thesis_idle", 3.6, 12, "V", "the thesis's divider without any load"),
                      ("thesis_1ma", 3.6, 12, "V", "the thesis's divider at 1 mA: above what a 3.3 V pin bears")),
        traces=(("v(ours)", "120R / 200R (ours)"), ("v(thesis)", "3k3 / 5k1 (thesis)")),
        x_label="load, mA", y_label="V", x_scale=1e3,
        cannot_say=(
            "It takes the typical minimum load (3.5 mA); our divider draws 10.4 mA and holds for the worst chip "
            "(10 mA) too."
        ),
    )  # fmt: skip


def _inrush() -> Deck:
    circuit = f"""
{B340A}
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
        limits=limits(("peak", -60, 0, "A", "peak current (out of the battery: negative); the diode bears 80 A"),
                      ("i2t", 0, 0.5, "A2s", "energy: the fuse needs some 30 A2s to trip"),
                      ("top", 12, 24.4, "V", "highest +12V: below the suppressor's clamp")),
        traces=(("-i(vbat)", "current, A"), ("v(p12)", "+12V, V")), x_label="time, us", y_label="A, V", x_scale=1e6,
        cannot_say="Contact bounce and the true battery: resistance and wire are assumed, a stiffer source gives more.",
    )  # fmt: skip


def _reverse() -> Deck:
    circuit = f"""
{B340A}
{SMBJ15A}
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
        limits=limits(("wrong", -0.3, 0.1, "V", "+12V with -14.8 V at the input"),
                      ("leak", -1e-3, 1e-3, "A", "current that flows then"),
                      ("right", 13.8, 14.8, "V", "+12V with +14.8 V at the input")),
        traces=(("v(bat)", "battery"), ("v(p12)", "+12V")), x_label="time, s", y_label="V",
        cannot_say="Hot leakage: a Schottky diode at 100 degrees leaks a hundred times more, still milliamperes.",
    )  # fmt: skip
