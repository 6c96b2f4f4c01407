"""Heat: junction of the LM317 and allowed current of the buck module against ambient."""

from hardware.pcb.circuit.electrical import BATTERY_MAX_V, LM317_AVERAGE_MA, LM317_CHARGING_MA, LM317_LIMIT_MA, load_ma
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.spice.deck import Deck, limits


def thermal_decks(buck: BoardDesign) -> tuple[Deck, ...]:
    """Return the decks of heat; `buck` is rev-b."""
    return (_thermal_lm317(), _thermal_buck(buck))


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
        measures=("dc tj25 find v(tj) at=25", "dc tj40 find v(tj) at=40", "dc over40 find v(tj5) at=40",
                  "dc charging40 find v(tjc) at=40",
                  "dc own40 find v(tjo) at=40"),
        limits=limits(("tj25", 25, facts["junction_max_c"], "C", "250 mA at 25 degrees"),
                      ("tj40", 40, facts["junction_max_c"], "C",
                      "250 mA at 40 degrees, battery at 11.2 V: the stated limit"),
                      ("own40", 40, facts["junction_max_c"], "C",
                      "150 mA at 40 degrees with this board's own copper (about 80 K/W)"),
                      ("charging40", 40, facts["junction_max_c"], "C",
                      "150 mA at 40 degrees, battery at 14.8 V (charging)"),
                      ("over40", 150, 400, "C", "500 mA at 40 degrees would shut it down")),
        traces=(("v(tj)", "250 mA, 53 K/W"), ("v(tjc)", "150 mA from 14.8 V, 53 K/W"), ("v(tjo)", "150 mA, 80 K/W"),
                ("v(tj5)", "500 mA, 53 K/W"), ("v(tjm)", "250 mA, minimum pad 136 K/W")),
        x_label="ambient, degrees C", y_label="degrees C",
        cannot_say=(
            "53 K/W is a four-layer test board and 80 K/W our guess for this board: measure before drawing more "
            "than 150 mA for long."
        ),
    )  # fmt: skip


def _thermal_buck(design: BoardDesign) -> Deck:
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
        measures=("dc may40 find v(may) at=40", "dc may70 find v(may) at=70", "dc lost find v(loss) at=25"),
        limits=limits(("may40", load_ma(design), 1000, "mA", "allowed at 40 degrees"),
                      ("may70", load_ma(design), 1000, "mA", "allowed at 70 degrees: still above the greatest load"),
                      ("lost", 0, 0.6, "W", "loss at the greatest load")),
        traces=(("v(may)", "allowed (data sheet)"), ("v(must)", "greatest load")),
        x_label="ambient, degrees C", y_label="mA",
        cannot_say="Nothing about heat from the ESP32 above it: the sheet's curve is for still air around the module.",
    )  # fmt: skip
