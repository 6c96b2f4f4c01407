"""Signals: reset, boot, every wire, RS-232 levels, and current that one module feeds into the other."""

from adapter_sim.pinout import Wire, WireDirection, WireRole, load_pinout
from hardware.pcb.circuit.design import series_wires
from hardware.pcb.circuit.modules import NOT_5V_TOLERANT
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.spice.deck import CLAMP, MODELS, Deck, limits
from hardware.pcb.spice.netlist import circuit, node


def signal_decks(design: BoardDesign) -> tuple[Deck, ...]:
    """Return the decks of a variant's signals."""
    return (_reset(design), _stop(design), _boot(design), _wires(design), _rs232(design), _rs232_low(design),
            _back_power(design), _back_power_esp(design))  # fmt: skip


#: Jumpers as the board is delivered: DTR asserted, the stop's loop closed.
_DTR, _LOOP = ("JP2.1", "JP2.2"), ("J7.1", "J7.2")


def _board(design: BoardDesign, *without: str) -> str:
    """Return models and board without its regulator, its jumpers as delivered."""
    return f"{MODELS}\n" + circuit(design, closed=[_DTR, _LOOP], without=("REGULATOR3", *without))


def _rail(design: BoardDesign, volts: float = 3.3) -> str:
    return f"Vrail33 {node(design, 'U2.3V3')} 0 {volts:g}"


def _reset(design: BoardDesign) -> Deck:
    esp, en, pin = PARTS["ESP32"].facts, node(design, "U2.EN"), node(design, "U1.PB13")
    text = f"""
{_board(design, "MAX3232")}
{_rail(design)}
Vpin pin 0 PULSE(0 2.9 10m 1u 1u 30m 200m)
Rpin pin {pin} 1
* the ESP32 module's own pull-up and capacitor
Rup {node(design, "U2.3V3")} {en} {esp["en_pull_ohm"]:g}
Cen {en} 0 {esp["en_farad"]:g}
* the thesis: 2k2 in the emitter and at the collector
Rthesis_b pin b2 2.2k
Rthesis_up {node(design, "U2.3V3")} en2 10k
Rthesis_c {node(design, "U2.3V3")} en2 2.2k
Cthesis en2 0 1u
Rthesis_e e2 0 2.2k
Qthesis en2 b2 e2 BC817
.tran 20u 100m
"""
    return Deck(
        name="reset", title="Reset: level at the ESP32's EN", circuit=text,
        measures=(f"tran en_low find v({en}) at=39m", "tran en_thesis find v(en2) at=39m",
                  f"tran en_back find v({en}) at=99m",
                  f"tran fall trig v(pin) val=1.5 rise=1 targ v({en}) val=0.6 fall=1"),
        limits=limits(("en_low", -0.1, 0.3, "V", "EN while PB13 is high"),
                      ("en_thesis", 0.83, 3.3, "V", "the thesis's circuit never gets below the threshold"),
                      ("en_back", 2.9, 3.3, "V", "EN 59 ms after the release"),
                      ("fall", 0, 5e-3, "s", "time until EN is low")),
        traces=(("v(pin)", "PB13"), (f"v({en})", "EN, rev B"), ("v(en2)", "EN, thesis")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "It takes the module's pull-up (10k) and capacitor (1 uF) as they are usually fitted; clones "
            "differ."
        ),
    )  # fmt: skip


def _stop(design: BoardDesign) -> Deck:
    """Open the stop's loop while IO17 holds the line at space: the worst that a program can do."""
    esp, en, din, line = PARTS["ESP32"].facts, *(node(design, pin) for pin in ("U2.EN", "U5.11", "J3.3"))
    text = f"""
{MODELS}
{circuit(design, closed=[_DTR], without=("REGULATOR3",))}
{_rail(design)}
Rup {node(design, "U2.3V3")} {en} {esp["en_pull_ohm"]:g}
Cen {en} 0 {esp["en_farad"]:g}
* PB13 low, IO17 low whatever EN does, a robot at the plug
Rpb13 {node(design, "U1.PB13")} 0 1
Rio17 {node(design, "U2.IO17")} 0 30
Rline {line} 0 3k
* the contact: closed, open from 40 ms, at ground on J7's far pin from 120 ms
Sloop {node(design, "J7.1")} {node(design, "J7.2")} shut 0 CONTACT
Vshut shut 0 PWL(0 1 40m 1 40.01m 0 80m 0 80.01m 1)
Sground {node(design, "J7.2")} 0 earth 0 CONTACT
Vearth earth 0 PWL(0 0 120m 0 120.01m 1)
.model CONTACT SW(VT=0.5 VH=0.1 RON=0.1 ROFF=100meg)
.tran 20u 160m
"""
    return Deck(
        name="stop", circuit=text,
        title="Emergency stop: loop opened at 40 ms, closed at 80 ms, shorted to ground at 120 ms",
        measures=(f"tran run_line find v({line}) at=39m", f"tran run_en find v({en}) at=39m",
                  f"tran stop_line find v({line}) at=79m", f"tran stop_en find v({en}) at=79m",
                  f"tran after trig v(shut) val=0.5 fall=1 targ v({en}) val=0.6 fall=1",
                  f"tran back_line find v({line}) at=119m", f"tran back_en find v({en}) at=119m",
                  f"tran ground_line find v({line}) at=159m", f"tran ground_en find v({en}) at=159m",
                  f"tran run_din find v({din}) at=39m"),
        limits=limits(("run_line", 3.7, 15, "V", "loop closed: the line follows IO17, here to space"),
                      ("run_en", 2.9, 3.4, "V", "loop closed: EN"),
                      ("stop_line", -15, -3.7, "V", "loop open: the line is at mark although IO17 is low"),
                      ("stop_en", -0.1, 0.3, "V", "loop open: EN"),
                      ("after", 0, 10e-3, "s", "from the opening to EN low"),
                      ("back_line", 3.7, 15, "V", "closed again: as before"),
                      ("back_en", 2.475, 3.4, "V", "closed again: EN 39 ms later"),
                      ("ground_line", -15, -3.7, "V", "a cable at ground stops too"),
                      ("ground_en", -0.1, 0.3, "V", "a cable at ground: EN"),
                      ("run_din", -0.1, 0.3, "V", "loop closed: a low of IO17 is a low at the driver")),
        traces=((f"v({line})", "TX at the plug"), (f"v({en})", "EN"), ("v(shut)", "loop closed")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say=(
            "What the robot does: its own watchdog stops it, 2 s after the last byte. A contact that is welded, or two "
            "wires of the cable that touch each other, are a closed loop."
        ),
    )  # fmt: skip


def _boot(design: BoardDesign) -> Deck:
    """Sweep the ESP32's own pull-downs in while nothing drives its pins: 0 is high-impedance, 1 is 45k each."""
    esp = PARTS["ESP32"].facts
    pins = ("IO17", "IO5", "IO15", "IO26", "IO12", "IO2", "IO23")
    own = "\n".join(
        f"Bown_{pin} {node(design, f'U2.{pin}')} 0 I = V(own)*V({node(design, f'U2.{pin}')})/{esp['pull_ohm']:g}"
        for pin in pins
    )
    jumper = [_DTR, _LOOP, ("J5.1", "J5.2")]
    text = f"""
{MODELS}
{circuit(design, closed=jumper, without=("REGULATOR3",))}
{_rail(design)}
Vown own 0 0
Rline {node(design, "J3.3")} 0 3k
{own}
.dc Vown 0 1 0.05
"""
    din, line = node(design, "U5.11"), node(design, "J3.3")
    dd3, s3 = node(design, "U1.PA6"), node(design, "U1.PC15")
    mode, flash, io2 = node(design, "U2.IO26"), node(design, "U2.IO12"), node(design, "U2.IO2")
    vih = PARTS["BLUEPILL"].facts["vih_v"]
    return Deck(
        name="boot", title="Boot: nothing drives the ESP32's pins yet, mode jumper fitted", circuit=text,
        measures=(f"dc din_free find v({din}) at=0", f"dc din_down find v({din}) at=1", f"dc mark max v({line})",
                  f"dc dd3_low min v({dd3})", f"dc s3_low min v({s3})", f"dc mode_low min v({mode})",
                  f"dc io12_high max v({flash})", f"dc io2_high max v({io2})"),
        limits=limits(("din_free", 2.0, 3.4, "V", "driver's input, IO17 high-impedance: above VIH"),
                      ("din_down", 2.0, 3.4, "V", "the same against the ESP32's pull-down"),
                      ("mark", -15, -3.7, "V", "TX to the robot stays at mark"),
                      ("dd3_low", vih, 3.4, "V", "DD3 at PA6: idle 1, as the pin-out says"),
                      ("s3_low", vih, 3.4, "V", "encoder2_s3 at PC15: idle 1, as the pin-out says"),
                      ("mode_low", esp["vih_v"], 3.4, "V", "mode jumper at IO26, against both pull-downs"),
                      ("io12_high", -0.1, esp["vil_v"], "V", "IO12: a low selects 3.3 V flash"),
                      ("io2_high", -0.1, esp["vil_v"], "V", "IO2: low, as the boot wants")),
        traces=((f"v({din})", "driver's input"), (f"v({dd3})", "DD3 at PA6"), (f"v({s3})", "encoder2_s3 at PC15"),
                (f"v({mode})", "IO26, jumper fitted")),
        x_label="the ESP32's own pull-downs, 0: off, 1: 45 kohm", y_label="V",
        cannot_say="The ESP32's pulls are its sheet's typical 45 kohm; a chip has 30 to 80 kohm.",
    )  # fmt: skip


#: One wire after the other is high for a slot.
_SLOT_S = 1e-3


def _ends(wire: Wire) -> tuple[str, str]:
    """Return driver and receiver of a wire as pins."""
    pads = f"U1.{wire.bluepill}", f"U2.{wire.esp32_pin('rev-b')}"
    return pads if wire.direction is WireDirection.TO_ADAPTER else (pads[1], pads[0])


def _wires(design: BoardDesign) -> Deck:
    wires = series_wires(load_pinout())
    drivers, receivers = [], []
    for slot, wire in enumerate(wires):
        near, far = (node(design, pin) for pin in _ends(wire))
        drivers.append(
            f"Vd{slot} d{slot} 0 PULSE(0 3.3 {slot * _SLOT_S:g} 1u 1u {0.9 * _SLOT_S:g} 1)\nRd{slot} d{slot} {near} 30"
        )
        receivers.append(far)
    text = f"""
{_board(design, "MAX3232")}
{_rail(design)}
{chr(10).join(drivers)}
Ball all 0 V = {" + ".join(f"V({far})" for far in receivers)}
.tran 20u {len(wires) * _SLOT_S:g}
"""
    low = {
        WireDirection.TO_ADAPTER: PARTS["ESP32"].facts["vih_v"],
        WireDirection.TO_BLUEPILL: PARTS["BLUEPILL"].facts["vih_v"],
    }
    rows = [
        (wire.name.lower(), low[wire.direction], 3.4, "V", f"{_ends(wire)[0]} high, at {_ends(wire)[1]}")
        for wire in wires
    ]
    return Deck(
        name="wires", title="Each wire in turn, from its driver's pad to its receiver's", circuit=text,
        measures=(*(f"tran {wire.name.lower()} find v({far}) at={(slot + 0.5) * _SLOT_S:g}"
                    for slot, (wire, far) in enumerate(zip(wires, receivers, strict=True))),
                  "tran most max v(all)"),
        limits=limits(*rows, ("most", 0, 3.4, "V", "all receivers together: never two high at once")),
        traces=(("v(all)", "sum of all receivers"), (f"v({receivers[0]})", "DD1"),
                (f"v({receivers[-1]})", "p2dx_con")),
        x_label="time, ms", y_label="V", x_scale=1e3,
        cannot_say="Pins are 30 ohm sources and open inputs; the LED at PC13 is in the arithmetic, not here.",
    )  # fmt: skip


def _serial(design: BoardDesign, vcc: float) -> str:
    pump, minus = node(design, "U5.2"), node(design, "U5.6")
    return f"""
{_board(design)}
{_rail(design, vcc)}
Vtx tx 0 PULSE(0 {vcc:g} 0.2m 1u 1u 104u 208u)
Rtxpin tx {node(design, "U2.IO17")} 30
* the robot: 3 kohm at our drivers, its own driver at pin 2
Rtx {node(design, "J3.3")} 0 3k
Ctx {node(design, "J3.3")} 0 1n
Rdtr {node(design, "J3.4")} 0 3k
Vrobot robot 0 PULSE(-6 6 0.2m 1u 1u 104u 208u)
Rrobot robot {node(design, "J3.2")} 300
.ic v({pump})=5.4 v({minus})=-5.4
.options method=gear
.tran 0.2u 2m uic
"""


_SERIAL_CANNOT = "The averaged pump is fitted to the sheet's typical 5.4 V (5.0 V guaranteed); no ripple, no spread."


def _serial_deck(design: BoardDesign, name: str, title: str, vcc: float, swing: float) -> Deck:
    tx, dtr, rx = node(design, "J3.3"), node(design, "J3.4"), node(design, "U2.IO16")
    return Deck(
        name=name, title=title, circuit=_serial(design, vcc),
        # In the middle of bits: IO17 and the robot's pin 2 are high at 0.65 ms, low at 0.75 ms.
        measures=(f"tran mark find v({tx}) at=0.67m", f"tran space find v({tx}) at=0.77m",
                  f"tran dtr_low min v({dtr}) from=0.5m to=2m",
                  f"tran rx_low find v({rx}) at=0.67m", f"tran rx_high find v({rx}) at=0.77m"),
        limits=limits(("space", swing, 15, "V", "space at plug pin 3, IO17 low"),
                      ("mark", -15, -swing, "V", "mark at plug pin 3, IO17 high"),
                      ("dtr_low", swing, 15, "V", "DTR at plug pin 4, at its lowest"),
                      ("rx_low", -0.1, PARTS["ESP32"].facts["vil_v"], "V", "IO16 while the robot sends a space"),
                      ("rx_high", 0.75 * vcc, vcc + 0.1, "V", "IO16 while the robot sends a mark")),
        traces=((f"v({tx})", "TX (DE-9 pin 3)"), (f"v({dtr})", "DTR (DE-9 pin 4)"), ("v(tx)", "IO17"),
                (f"v({rx})", "IO16")),
        x_label="time, ms", y_label="V", x_scale=1e3, cannot_say=_SERIAL_CANNOT,
    )  # fmt: skip


def _rs232(design: BoardDesign) -> Deck:
    return _serial_deck(design, "rs232", "RS-232 both ways at 3.3 V, 3 kohm at TX and DTR, 9600 baud", 3.3, 5.0)


def _rs232_low(design: BoardDesign) -> Deck:
    return _serial_deck(design, "rs232-low", "RS-232 at 3.0 V: a receiver needs 3 V", 3.0, 3.7)


#: The unpowered rail as a swept source: what enters it, and what a load of 100 ohm would take, both in mA.
_RAIL = """
Vrail rail 0 0
Btotal total 0 V = 1000*I(Vrail)
Bload load 0 V = 1000*V(rail)/100
Bmeet meet 0 V = V(total) - V(load)
.dc Vrail 0 3 0.02
"""


def _fed(design: BoardDesign, direction: WireDirection) -> str:
    """Drive the wires of a direction high at the module that is on; clamp them at the one that is off."""
    lines = [CLAMP, _board(design, "MAX3232")]
    for number, wire in enumerate(load_pinout().wires):
        if wire.direction is not direction or wire.role is WireRole.RESET:
            continue
        near, far = (node(design, pin) for pin in _ends(wire))
        lines.append(f"Vd{number} d{number} 0 3.3\nRo{number} d{number} {near} 30")
        if direction is WireDirection.TO_ADAPTER or wire.bluepill in NOT_5V_TOLERANT:
            lines.append(f"Vm{wire.bluepill} {far} c{number} 0\nDc{number} c{number} rail CLAMP")
    if direction is WireDirection.TO_BLUEPILL:
        lines.append(_rail(design))
    return "\n".join([*lines, _RAIL])


def _back_power(design: BoardDesign) -> Deck:
    return Deck(
        name="back-power", title="ESP32 on, BluePill off: current through the series resistors",
        circuit=_fed(design, WireDirection.TO_BLUEPILL),
        measures=("dc all_pins find v(total) at=0", "dc pin find i(vmpc13) at=0",
                  "dc rail100 find v(rail) when v(meet)=0"),
        limits=limits(("all_pins", 0, 25, "mA", "into the BluePill in all, its rail held at 0 V"),
                      ("pin", 0, 5e-3, "A", "into PC13, the pin with the smallest resistor"),
                      ("rail100", 0, 2.0, "V", "rail with a load of 100 ohm: below where an STM32F103 runs")),
        traces=(("v(total)", "into the BluePill, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered BluePill, V", y_label="mA",
        cannot_say=(
            "What an unpowered chip does with it: its rail is a voltage here; 5 V tolerant pins are taken to "
            "have no clamp."
        ),
    )  # fmt: skip


def _back_power_esp(design: BoardDesign) -> Deck:
    return Deck(
        name="back-power-esp32", title="BluePill on, ESP32 off: current through the series resistors",
        circuit=_fed(design, WireDirection.TO_ADAPTER),
        measures=("dc all_pins find v(total) at=0", "dc rail100 find v(rail) when v(meet)=0"),
        limits=limits(("all_pins", 0, 25, "mA", "into the ESP32 in all, its rail held at 0 V"),
                      ("rail100", 0, 2.3, "V", "rail with a load of 100 ohm: below the ESP32's brown-out level")),
        traces=(("v(total)", "into the ESP32, mA"), ("v(load)", "what 100 ohm would take, mA")),
        x_label="rail of the unpowered ESP32, V", y_label="mA",
        cannot_say="The ESP32's sheet gives no injection limit; the STM32's is borrowed.",
    )  # fmt: skip
