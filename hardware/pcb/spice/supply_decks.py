"""Supplies: start-up, load steps, light load, inrush and a battery the wrong way round."""

import re

from hardware.pcb.circuit.electrical import BATTERY_MAX_V, LM317_LIMIT_MA, load_ma
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.spice.deck import MODELS, Deck, limits
from hardware.pcb.spice.netlist import circuit, node


def supply_decks(buck: BoardDesign, linear: BoardDesign, ribbon: BoardDesign) -> tuple[Deck, ...]:
    """Return the decks of both supplies; `linear` is the variant lm317, `ribbon` has a header for JP8."""
    return (
        _startup_buck(buck), _startup_lm317(linear), _step_buck(buck), _step_lm317(linear), _bank(buck),
        _minimum_load(linear), _inrush(buck), _reverse(buck), _jp8(ribbon),
    )  # fmt: skip


#: JP1 in its two places.
_FROM_12V, _FROM_BANK = ("JP1.1", "JP1.2"), ("JP1.2", "JP1.3")
#: Supply decks ask nothing of the transceiver.
_QUIET = ("MAX3232",)


def _supplied(design: BoardDesign) -> str:
    """Return the board with a battery at J1 that comes at 1 ms, and both modules' loads."""
    return f"""
{MODELS}
{circuit(design, closed=[_FROM_12V], without=_QUIET)}
Vbat bat 0 PWL(0 0 1m 0 1.01m 12)
Rbat bat {node(design, "J1.1")} 0.1
* 80 mA and 120 mA at the modules' 5V pins
Rbluepill {node(design, "U1.5V")} 0 60
Resp {node(design, "U2.5V")} 0 40
"""


_MODULES = (("bluepill", 4.3, 5.2, "V", "5V at the BluePill"), ("esp", 4.3, 5.2, "V", "5V at the ESP32"))


def _at_modules(design: BoardDesign, at: str) -> tuple[str, str]:
    return (
        f"tran bluepill find v({node(design, 'U1.5V')}) at={at}",
        f"tran esp find v({node(design, 'U2.5V')}) at={at}",
    )


def _startup_buck(design: BoardDesign) -> Deck:
    out, rail = node(design, "JP1.1"), node(design, "U3.1")
    return Deck(
        name="startup-buck", title="Start-up, rev B (buck module)", circuit=f"{_supplied(design)}.tran 5u 12m\n",
        measures=(f"tran end find v({out}) at=11m", f"tran top max v({out})",
                  f"tran up trig v(bat) val=6 rise=1 targ v({out}) val=4.75 rise=1", *_at_modules(design, "11m")),
        limits=limits(("end", 4.9, 5.1, "V", "5 V after start"),
                      ("top", 4.9, 5.25, "V", "highest 5 V on the way"),
                      ("up", 0, 10e-3, "s", "time to 4.75 V"), *_MODULES),
        traces=((f"v({rail})", "+12V"), (f"v({out})", "5V_REG"), (f"v({node(design, 'U2.5V')})", "5V of the ESP32")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "The module's true soft start is not in its data sheet: 2 ms is assumed, so only the absence of an "
            "overshoot is asked."
        ),
    )  # fmt: skip


def _startup_lm317(design: BoardDesign) -> Deck:
    out, rail, adjust = node(design, "JP1.1"), node(design, "U3.3"), node(design, "U3.1")
    return Deck(
        name="startup-lm317", title="Start-up, variant lm317 (5 V)", circuit=f"{_supplied(design)}.tran 5u 60m\n",
        measures=(f"tran end find v({out}) at=59m", f"tran top max v({out})",
                  f"tran up trig v(bat) val=6 rise=1 targ v({out}) val=4.75 rise=1", *_at_modules(design, "59m")),
        limits=limits(("end", 4.75, 5.25, "V", "5 V after start"),
                      ("top", 4.75, 5.3, "V", "highest 5 V on the way"),
                      ("up", 0, 50e-3, "s", "time to 4.75 V (the ADJ capacitor makes it slow)"), *_MODULES),
        traces=((f"v({rail})", "+12V"), (f"v({out})", "5 V"), (f"v({adjust})", "ADJ")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Loop stability with ceramic capacitors: the model is stable by construction.",
    )  # fmt: skip


def _stepped(design: BoardDesign, most_ma: float, start: str, analysis: str) -> str:
    """Return the board at a steady low battery, with a step of load at the choice of source."""
    return f"""
{MODELS}
{circuit(design, closed=[_FROM_12V], without=_QUIET)}
Vbat {node(design, "J1.1")} 0 11.8
Istep {node(design, "JP1.2")} 0 PULSE(20m {most_ma:g}m {start} 1u 1u 2m 10m)
{analysis}
"""


def _step_buck(design: BoardDesign) -> Deck:
    out = node(design, "JP1.2")
    return Deck(
        name="step-buck", title="Load step 20 to 500 mA, rev B", circuit=_stepped(design, 500, "8m", ".tran 1u 12m 6m"),
        measures=(f"tran low min v({out})", f"tran top max v({out})", f"tran settled find v({out}) at=9.9m"),
        limits=limits(("low", 4.75, 5.1, "V", "lowest 5 V"),
                      ("top", 4.9, 5.25, "V", "highest 5 V when the load goes"),
                      ("settled", 4.9, 5.1, "V", "5 V after 1.9 ms of load")),
        traces=((f"v({out})", "+5V"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "Shape and ringing: the model's impedance is fitted to one figure of the data sheet (150 mV for half "
            "the load)."
        ),
    )  # fmt: skip


def _step_lm317(design: BoardDesign) -> Deck:
    out = node(design, "JP1.2")
    return Deck(
        name="step-lm317", title=f"Load step 20 to {LM317_LIMIT_MA:g} mA, variant lm317",
        circuit=_stepped(design, LM317_LIMIT_MA, "100m", ".tran 2u 104m 98m"),
        measures=(f"tran low min v({out})", f"tran top max v({out})", f"tran settled find v({out}) at=101.9m"),
        limits=limits(("low", 4.75, 5.1, "V", "lowest 5 V"),
                      ("top", 4.9, 5.25, "V", "highest 5 V when the load goes"),
                      ("settled", 4.85, 5.15, "V", "5 V after 1.9 ms of load")),
        traces=((f"v({out})", "+5V"),), x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "Ringing and stability: the loop is not modelled; dips below a microsecond belong to the capacitors' "
            "inductance."
        ),
    )  # fmt: skip


def _bank(design: BoardDesign) -> Deck:
    text = f"""
{MODELS}
{circuit(design, closed=[_FROM_BANK], without=(*_QUIET, "REGULATOR3"))}
Vbank bank 0 0
Rbank bank {node(design, "J2.1")} 0.05
Rbluepill {node(design, "U1.5V")} 0 60
Resp {node(design, "U2.5V")} 0 10
.dc Vbank -5 5.2 0.05
"""
    esp, terminal = node(design, "U2.5V"), node(design, "J1.1")
    return Deck(
        name="bank", title="Power bank at J2 from -5 V to 5.2 V, ESP32 at its peak", circuit=text,
        measures=(f"dc good find v({esp}) at=4.9", f"dc wrong find v({esp}) at=-5", f"dc back max v({terminal})"),
        limits=limits(("good", 4.3, 5.2, "V", "5V at the ESP32 with 4.9 V at J2, 0.5 A"),
                      ("wrong", -0.3, 0.1, "V", "the same with the bank the wrong way round"),
                      ("back", -0.1, 0.1, "V", "what reaches the 12 V terminal")),
        traces=(("v(bank)", "bank"), (f"v({esp})", "5V of the ESP32")), x_label="bank, V", y_label="V",
        cannot_say="A bank's own limits and cable: the deck's source gives the demands on it.",
    )  # fmt: skip


def _minimum_load(design: BoardDesign) -> Deck:
    out = node(design, "U4.2")
    text = f"""
{MODELS}
{circuit(design, without=_QUIET)}
Vin {node(design, "U4.3")} 0 11.2
Xthesis {node(design, "U4.3")} a2 thesis LM317
Rthesis_up thesis a2 3.3k
Rthesis_down a2 0 5.1k
Gl1 {out} 0 cur 0 1
Gl2 thesis 0 cur 0 1
Vcur cur 0 0
.dc Vcur 0 8m 0.1m
"""
    return Deck(
        name="minimum-load", title="3.3 V rail of the LM317 at light load", circuit=text,
        measures=(f"dc ours_idle find v({out}) at=0", "dc thesis_idle find v(thesis) at=0",
                  "dc thesis_1ma find v(thesis) at=1m",
                  f"dc ours_end find v({out}) at=8m"),
        limits=limits(("ours_idle", 3.135, 3.465, "V", "ours without any load"),
                      ("ours_end", 3.135, 3.465, "V", "ours at 8 mA"),
                      ("thesis_idle", 3.6, 12, "V", "the thesis's divider without any load"),
                      ("thesis_1ma", 3.6, 12, "V", "the thesis's divider at 1 mA: above what a 3.3 V pin bears")),
        traces=((f"v({out})", "120R / 200R (ours)"), ("v(thesis)", "3k3 / 5k1 (thesis)")),
        x_label="load, mA", y_label="V", x_scale=1e3,
        cannot_say=(
            "It takes the typical minimum load (3.5 mA); our divider draws 10.4 mA and holds for the worst chip "
            "(10 mA) too."
        ),
    )  # fmt: skip


def _inrush(design: BoardDesign) -> Deck:
    rail = node(design, "U3.1")
    text = f"""
{MODELS}
{circuit(design, without=(*_QUIET, "REGULATOR3"), fuse_ohm=PARTS["PTC"].facts["ohm_min"])}
Vbat bat 0 PWL(0 0 10u 0 11u {BATTERY_MAX_V:g})
Rbat bat w 0.08
Lwire w {node(design, "J1.1")} 0.7u
Bi2 0 q I = I(Vbat)*I(Vbat)
Cq q 0 1
Rq q 0 1g
.tran 0.2u 400u
"""
    return Deck(
        name="inrush", title="Inrush when a full battery is connected (wire 0.7 uH, 0.08 ohm)", circuit=text,
        measures=("tran peak min i(vbat)", "tran i2t max v(q)", f"tran top max v({rail})"),
        limits=limits(("peak", -60, 0, "A", "peak current (out of the battery: negative); the diode bears 80 A"),
                      ("i2t", 0, 0.5, "A2s", "energy: the fuse needs some 30 A2s to trip"),
                      ("top", 12, 24.4, "V", "highest +12V: below the suppressor's clamp")),
        traces=(("-i(vbat)", "current, A"), (f"v({rail})", "+12V, V")), x_label="time, us", y_label="A, V",
        x_scale=1e6,
        cannot_say="Contact bounce and the true battery: resistance and wire are assumed, a stiffer source gives more.",
    )  # fmt: skip


def _reverse(design: BoardDesign) -> Deck:
    rail = node(design, "U3.1")
    text = f"""
{MODELS}
{circuit(design, without=(*_QUIET, "REGULATOR3"))}
Vbat bat 0 PWL(0 -15 3 15)
Rbat bat {node(design, "J1.1")} 0.1
Rload {rail} 0 100
.tran 5m 3
"""
    return Deck(
        name="reverse", title="Battery swept from -15 V (wrong way round) to +15 V", circuit=text,
        measures=(f"tran wrong find v({rail}) at=0.02", "tran leak find i(vbat) at=0.02",
                  f"tran right find v({rail}) at=2.98"),
        limits=limits(("wrong", -0.3, 0.1, "V", "+12V with -14.8 V at the input"),
                      ("leak", -1e-3, 1e-3, "A", "current that flows then"),
                      ("right", 13.8, 14.8, "V", "+12V with +14.8 V at the input")),
        traces=(("v(bat)", "battery"), (f"v({rail})", "+12V")), x_label="time, s", y_label="V",
        cannot_say="Hot leakage: a Schottky diode at 100 degrees leaks a hundred times more, still milliamperes.",
    )  # fmt: skip


def _jp8(design: BoardDesign) -> Deck:
    """Sweep JP8's 12 V, its jumper fitted, with a battery of 12 V at J1 and without: who feeds whom, and with what."""
    without = (*_QUIET, "REGULATOR3")
    joined = circuit(design, closed=[("JP3.1", "JP3.2")], without=without)
    # The same board a second time, without a battery: its nodes have names of their own.
    alone = re.sub(r"\bn_", "n_alone_", re.sub(r"(?m)^([A-Z])", r"\1alone", joined))
    terminal, pin4, rail = node(design, "J1.1"), node(design, "J6.4"), node(design, "D10.K")
    other_pin4, other_rail = (name.replace("n_", "n_alone_", 1) for name in (pin4, rail))
    facts = PARTS["BUCK"].facts
    least, watts = facts["input_min_v"], load_ma(design) * 1e-3 * facts["output_v"] / facts["efficiency"]
    text = f"""
{MODELS}
{joined}
{alone}
* what the regulator takes with both modules at their peaks, less below its least voltage
Bboth {rail} 0 I = {watts:g}/max({least}, V({rail}))*min(1, max(0, V({rail})/{least}))
Balone {other_rail} 0 I = {watts:g}/max({least}, V({other_rail}))*min(1, max(0, V({other_rail})/{least}))
Vjp8 jp8 0 0
Vto_both jp8 {pin4} 0
Vto_alone jp8 {other_pin4} 0
Vbat bat 0 12
Vto_board bat {terminal} 0
.options reltol=1e-6
.dc Vjp8 0 15 0.05
"""
    return Deck(
        name="jp8", title="JP8's 12 V by J6 and JP3, from 0 to 15 V, both modules at their peaks", circuit=text,
        measures=(f"dc low_rail find v({other_rail}) at=11", "dc taken find i(vto_alone) at=11",
                  "dc back min i(vto_both)", "dc low find i(vto_both) at=10", "dc high_bat find i(vto_board) at=15",
                  f"dc high_rail find v({other_rail}) at=14.8"),
        limits=limits(("low_rail", least, 11, "V", "+12V from JP8 alone at 11 V: the regulator needs 6.5 V"),
                      ("taken", 0.1, 0.35, "A", "what JP8 gives then: F2 holds 0.5 A"),
                      ("back", -1e-3, 1, "A", "with a battery at J1: nothing flows back into JP8"),
                      ("low", -1e-3, 1e-3, "A", "JP8 at 10 V, battery at 12 V: the battery feeds alone"),
                      ("high_bat", -1e-3, 1e-3, "A", "JP8 at 15 V, battery at 12 V: nothing flows into the battery"),
                      ("high_rail", 13.8, 14.8, "V", "+12V with JP8 at 14.8 V")),
        traces=(("i(vto_alone)", "from JP8, alone"), ("i(vto_both)", "from JP8, battery at J1"),
                ("i(vto_board)", "from the battery")),
        x_label="JP8 pin 4, V", y_label="A",
        cannot_say="What JP8 can give, how stiff it is and what protects it: nobody has measured one.",
    )  # fmt: skip
