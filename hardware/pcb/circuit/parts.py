"""What can be bought: one row a part, with its footprint, maker's number and the facts that the checks use.

Facts marked `seen` were read in the named data sheet or public drawing; `memory` means that nobody
here had it at hand: then the part has a question, which is printed beside the order. Prices and stock are not kept.
What the order number itself says is held against each row by part_numbers.py.

Invariant: every part that is bought has a manufacturer and a part number.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A thing that can be placed on the board."""

    key: str
    value: str
    #: Name in symbols.py and in footprints.py.
    symbol: str
    footprint: str
    description: str
    manufacturer: str = ""
    mpn: str = ""
    #: Where the facts come from.
    source: str = ""
    #: What could not be proven here, as a question to the distributor or of a part in hand.
    ask: str = ""
    #: Data-sheet figures; the unit is in the name.
    facts: Mapping[str, float] = field(default_factory=dict)
    #: False for what is drawn in copper only (test points, holes): not in the bill of materials.
    bought: bool = True

    def __post_init__(self) -> None:
        """Freeze the facts, and refuse a bought part without a number to order it by."""
        object.__setattr__(self, "facts", MappingProxyType(dict(self.facts)))
        if self.bought and not (self.manufacturer and self.mpn):
            raise ValueError(f"part {self.key!r} is bought but has no manufacturer or no part number")


_LED_ASK = "this colour, 0805, cathode at the mark, light enough at 0.5 mA?"
_PINS_ASK = "pins x rows as the value says, 2.54 mm, square 0.64 mm, gold or tin?"


def _resistor(value: str, ohm: float, mpn: str) -> Part:
    return Part(
        key=value, value=value, symbol="R", footprint="R_0805",
        description=f"Resistor {value} 1 % 0.125 W", manufacturer="Yageo", mpn=mpn,
        source="Yageo RC_L V.9: ordering code, seen; 1/8 W, memory", ask="is RC0805 rated 1/8 W at 70 C?",
        facts={"ohm": ohm, "tolerance": 0.01, "power_w": 0.125},
    )  # fmt: skip


PARTS: Mapping[str, Part] = MappingProxyType({
    part.key: part
    for part in (
        # --- modules
        Part(
            key="BLUEPILL", value="BluePill", symbol="BLUEPILL", footprint="MODULE_BLUEPILL",
            description="STM32F103C8 BluePill, with its pin rows soldered downwards", manufacturer="generic",
            mpn="BluePill STM32F103C8T6",
            source="ST DS5319 I/O tables, seen; pin rows: two public pin-outs (docs/board.md), seen",
            ask="rows 15.24 mm apart, 20 pins each, named as on the print? LED at PC13? clones differ",
            facts={"supply_v": 5.0, "current_max_ma": 80.0, "injection_pin_ma": 5.0, "injection_total_ma": 25.0,
                   "vil_v": 1.164, "vih_v": 1.833, "vil_ft_v": 1.166, "vih_ft_v": 1.546},
        ),
        Part(
            key="ESP32", value="ESP32 D1 mini", symbol="ESP32_D1_MINI", footprint="MODULE_ESP32_D1_MINI",
            description="ESP32 D1 mini (40 pins), with its pin rows soldered downwards", manufacturer="generic",
            mpn="MH-ET LIVE MiniKit ESP32",
            source="pin rows: three public pin-outs (docs/board.md), seen; Espressif ESP32 data sheet, memory",
            ask="4 rows of 10, the inner ones 22.86 mm apart, named as on the print? pull-up and capacitor at EN?",
            facts={"supply_v": 5.0, "current_max_ma": 500.0, "rail_out_ma": 150.0, "vil_v": 0.825, "vih_v": 2.475,
                   "en_low_v": 0.6, "en_pull_ohm": 10_000.0, "en_farad": 1e-6, "pull_ohm": 45_000.0},
        ),
        # --- supply
        Part(
            key="BUCK", value="TSR 1-2450", symbol="REGULATOR3", footprint="SIP3_BUCK",
            description="Step-down module 6.5-36 V to 5 V, 1 A, pin-compatible with R-78E5.0-1.0 and K7805-1000R3",
            manufacturer="Traco Power", mpn="TSR 1-2450", source="Traco TSR 1 series sheet, seen",
            facts={"input_min_v": 6.5, "input_max_v": 36.0, "output_v": 5.0, "accuracy": 0.02, "output_max_ma": 1000.0,
                   "efficiency": 0.90, "step_peak_max_v": 0.2, "load_farad_max": 470e-6, "full_load_c": 60.0},
        ),
        Part(
            key="LM317", value="LM317DCY", symbol="LM317", footprint="SOT223",
            description="Adjustable linear regulator, SOT-223", manufacturer="Texas Instruments", mpn="LM317DCYR",
            source="TI LM317 and LM317M sheets: 53 K/W on a high-K board, seen; minimum load, DCY = SOT-223, memory",
            ask="LM317DCYR: SOT-223? minimum load at most 10 mA?",
            facts={"reference_v": 1.25, "reference_tolerance": 0.04, "adjust_a": 50e-6, "minimum_load_ma": 10.0,
                   "dropout_v": 2.0, "junction_max_c": 125.0, "kelvin_per_watt": 53.0, "output_max_ma": 1500.0},
        ),
        Part(
            key="PTC", value="1.1 A 24 V", symbol="FUSE", footprint="F_1812",
            description="Resettable fuse, holds 1.1 A, trips at 2.2 A", manufacturer="Bourns",
            mpn="MF-MSMF110/24X-2", source="Bourns MF-MSMF table, seen",
            facts={"hold_a": 1.1, "trip_a": 2.2, "voltage_max_v": 24.0, "ohm_min": 0.06, "ohm_max": 0.18},
        ),
        Part(
            key="PTC 0.5", value="0.5 A 30 V", symbol="FUSE", footprint="F_1812",
            description="Resettable fuse, holds 0.5 A, trips at 1 A", manufacturer="Littelfuse",
            mpn="1812L050/30PR", source="Littelfuse 1812L (2019), seen",
            facts={"hold_a": 0.5, "trip_a": 1.0, "voltage_max_v": 30.0, "ohm_min": 0.15, "ohm_max": 1.0},
        ),
        Part(
            key="SCHOTTKY", value="B340A", symbol="SCHOTTKY", footprint="D_SMA",
            description="Schottky diode 40 V 3 A", manufacturer="Diodes Incorporated", mpn="B340A-13-F",
            source="Diodes B320A - B360A, seen", facts={"reverse_v": 40.0, "forward_v": 0.5, "current_a": 3.0},
        ),
        Part(
            key="SCHOTTKY 5V", value="MBRA210L", symbol="SCHOTTKY", footprint="D_SMA",
            description="Schottky diode 10 V 2 A, low drop", manufacturer="onsemi", mpn="MBRA210LT3G",
            source="onsemi MBRA210LT3/D: 10 V, 2 A, SMA, seen; the drop at 0.6 A, memory",
            ask="forward drop at 0.6 A, 25 C: 0.28 V or less?",
            facts={"reverse_v": 10.0, "forward_v": 0.28, "current_a": 2.0},
        ),
        Part(
            key="TVS12", value="SMBJ15A", symbol="TVS", footprint="D_SMB",
            description="Transient suppressor, 15 V stand-off", manufacturer="Littelfuse", mpn="SMBJ15A",
            source="Littelfuse TVS catalogue (SMBJ: DO-214AA), AVX SMBJ: A = one way, SMAJ15A's voltages, seen",
            facts={"standoff_v": 15.0, "clamp_v": 24.4, "breakdown_min_v": 16.7},
        ),
        Part(
            key="C 100u", value="100uF 35V", symbol="CP", footprint="CP_RADIAL_D6",
            description="Electrolytic capacitor 100 uF 35 V, low impedance, 6.3 x 11.2 mm, pitch 2.5 mm",
            manufacturer="Panasonic",
            mpn="EEU-FR1V101",
            source="Panasonic part numbers (FR, 1V = 35 V, 101 = 100 uF), seen; case and impedance, memory",
            ask="case 6.3 x 11.2 mm, pitch 2.5 mm, 0.15 ohm or less at 100 kHz?",
            facts={"farad": 100e-6, "voltage_v": 35.0, "esr_ohm": 0.15},
        ),
        Part(
            key="C 22u", value="22uF 16V", symbol="C", footprint="C_1206",
            description="Ceramic capacitor 22 uF 16 V X5R 1206", manufacturer="Murata", mpn="GRM31CR61C226KE15L",
            source="Murata C02E part numbering; GRM31C is 3.2 x 1.6 x 1.6 mm, seen; left of it at 5 V, memory",
            ask="what is left of 22 uF at 5 V?", facts={"farad": 22e-6, "voltage_v": 16.0, "esr_ohm": 0.005},
        ),
        Part(
            key="C 100n", value="100nF 50V", symbol="C", footprint="C_0805",
            description="Ceramic capacitor 100 nF 50 V X7R 0805", manufacturer="Yageo", mpn="CC0805KRX7R9BB104",
            source="Yageo CC X7R V.10, seen", facts={"farad": 100e-9, "voltage_v": 50.0},
        ),
        # --- resistors
        _resistor("1k", 1e3, "RC0805FR-071KL"),
        _resistor("1k2", 1.2e3, "RC0805FR-071K2L"),
        _resistor("680R", 680.0, "RC0805FR-07680RL"),
        _resistor("20k", 20e3, "RC0805FR-0720KL"),
        _resistor("4k7", 4.7e3, "RC0805FR-074K7L"),
        _resistor("10k", 10e3, "RC0805FR-0710KL"),
        _resistor("47k", 47e3, "RC0805FR-0747KL"),
        _resistor("2k2", 2.2e3, "RC0805FR-072K2L"),
        _resistor("120R", 120.0, "RC0805FR-07120RL"),
        _resistor("360R", 360.0, "RC0805FR-07360RL"),
        _resistor("200R", 200.0, "RC0805FR-07200RL"),
        # --- logic
        Part(
            key="MAX3232", value="MAX3232E", symbol="MAX3232", footprint="SOIC16",
            description="RS-232 transceiver 3-5.5 V, 15 kV ESD", manufacturer="Texas Instruments", mpn="MAX3232EIDR",
            source="TI SLLS410: thresholds, 4 x 100 nF, D = SOIC 9.9 x 3.9 mm, seen; driver swing, memory",
            ask="MAX3232EIDR (not MAX232): 3.3 V supply, swing of 5 V or more into 3 kohm?",
            facts={"supply_min_v": 3.0, "supply_max_v": 5.5, "swing_min_v": 5.0, "swing_typ_v": 5.4, "load_ohm": 3e3,
                   "pump_farad": 100e-9, "supply_ma": 1.0},
        ),
        Part(
            key="BC817", value="BC817-40", symbol="NPN", footprint="SOT23",
            description="NPN transistor 45 V 0.5 A", manufacturer="Nexperia", mpn="BC817-40,215",
            source="Nexperia BC817; pins as KiCad's symbol; gain, memory", ask="-40: gain 250 or more at 100 mA?",
            facts={"hfe_min": 250.0, "saturation_v": 0.7, "current_ma": 500.0},
        ),
        Part(
            key="BC807", value="BC807-40", symbol="PNP", footprint="SOT23",
            description="PNP transistor 45 V 0.5 A", manufacturer="Nexperia", mpn="BC807-40,215",
            source="Nexperia BC807; pins as KiCad's symbol; gain, memory", ask="PNP, -40: gain 250 or more?",
            facts={"hfe_min": 250.0, "saturation_v": 0.7, "current_ma": 500.0},
        ),
        Part(
            key="HC595", value="74HC595", symbol="HC595", footprint="SOIC16",
            description="8-bit shift register with output latch", manufacturer="Nexperia", mpn="74HC595D,118",
            source="Nexperia 74HC595; pins as KiCad's symbol; D,118 = SO16, memory",
            ask="D,118: SO16, 3.9 mm wide? HC, not HCT?", facts={"supply_min_v": 2.0, "supply_max_v": 6.0},
        ),
        Part(key="LED green", value="green", symbol="LED", footprint="LED_0805", description="LED green 0805",
             manufacturer="Kingbright", mpn="KP-2012SGC", source="memory", ask=_LED_ASK, facts={"forward_v": 2.2}),
        Part(key="LED yellow", value="yellow", symbol="LED", footprint="LED_0805", description="LED yellow 0805",
             manufacturer="Kingbright", mpn="KP-2012SYC", source="memory", ask=_LED_ASK, facts={"forward_v": 2.0}),
        Part(key="LED red", value="red", symbol="LED", footprint="LED_0805", description="LED red 0805",
             manufacturer="Kingbright", mpn="KP-2012SRC-PRV", source="memory", ask=_LED_ASK, facts={"forward_v": 1.85}),
        Part(key="PUSH BUTTON", value="6x6", symbol="SWITCH", footprint="SW_PUSH_6MM",
             description="Push button 6 x 6 mm, 4.3 mm high, through hole", manufacturer="Omron", mpn="B3F-1000",
             source="KiCad's B3F-100x and SW_PUSH_6mm, seen; height, memory",
             ask="4.3 mm high? contact 1-2 closes when pressed?"),
        # --- connectors
        Part(key="TERMINAL", value="2 x 5.08", symbol="CONN2", footprint="TERMINAL_5.08",
             description="Screw terminal 2 poles 5.08 mm", manufacturer="Phoenix Contact", mpn="1729128",
             source="pads and pin as KiCad's MKDS-1,5-2-5.08, seen; the article number, memory",
             ask="1729128: 2 poles, 5.08 mm, pins 1.3 mm or less, 10 mm high?"),
        Part(key="VH2", value="VH 2", symbol="CONN2", footprint="JST_VH_2",
             description="Header JST VH, 2 poles, 3.96 mm, keyed", manufacturer="JST", mpn="B2P-VH",
             source="pads as KiCad's JST_VH_B2P-VH, seen"),
        Part(key="DE9", value="DE-9 male", symbol="DE9", footprint="DE9_MALE",
             description="DE-9 plug, right angle, board locks, 2.77 x 2.84 mm", manufacturer="TE Connectivity",
             mpn="5747840-3",
             source="two public footprints (proof/footprints.toml): flange's face 8.10 mm off the second row, seen"),
        Part(key="HEADER2", value="1x2", symbol="CONN2", footprint="HEADER_1X2",
             description="Pin header 1x2 2.54 mm", manufacturer="Wuerth", mpn="61300211121",
             source="Wuerth WR-PHD numbers, memory", ask=_PINS_ASK),
        Part(key="HEADER3", value="1x3", symbol="CONN3", footprint="HEADER_1X3",
             description="Pin header 1x3 2.54 mm, with one jumper", manufacturer="Wuerth", mpn="61300311121",
             source="Wuerth WR-PHD numbers, memory", ask=_PINS_ASK),
        Part(key="HEADER24", value="2x12", symbol="CONN24", footprint="HEADER_2X12",
             description="Pin header 2x12 2.54 mm", manufacturer="Wuerth", mpn="61302421121",
             source="Wuerth WR-PHD numbers, memory", ask=_PINS_ASK),
        Part(key="BOX10", value="2x5 box", symbol="CONN10", footprint="IDC_2X5",
             description="Box header 2x5 2.54 mm, keyed", manufacturer="Wuerth", mpn="61201021621",
             source="pads and outline as KiCad's IDC-Header_2x05_P2.54mm_Vertical, seen; the number, memory",
             ask="61201021621: box, 2x5, upright, the gap at pin 1's side?"),
        # --- copper only
        Part(key="TP", value="TP", symbol="TESTPOINT", footprint="TESTPOINT", description="Test point 1.5 mm",
             bought=False),
        Part(key="HOLE", value="M3", symbol="HOLE", footprint="HOLE_M3", description="Mounting hole 3.2 mm",
             bought=False),
    )
})  # fmt: skip


def _accessory(value: str, mpn: str, description: str) -> Part:
    return Part(key=value, value=value, symbol="", footprint="", description=description, manufacturer="Wuerth",
                mpn=mpn, source="Wuerth numbers, memory", ask="as described?")  # fmt: skip


#: What is bought with a board but is no component of its circuit: quantity, where it goes, the part.
ACCESSORIES: tuple[tuple[int, str, Part], ...] = (
    (2, "U1", _accessory("socket 1x20", "61302011821", "Socket 1x20 2.54 mm, 8.5 mm high, for the BluePill")),
    (4, "U2", _accessory("socket 1x10", "61301011821", "Socket 1x10 2.54 mm, 8.5 mm high, for the ESP32 module")),
    (4, "JP1 JP2 J5 J7", _accessory("jumper", "60900213421", "Jumper 2.54 mm: source, DTR, mode, stop loop")),
    (
        1,
        "J2",
        Part(
            key="VH housing",
            value="VH housing",
            symbol="",
            footprint="",
            manufacturer="JST",
            mpn="VHR-2N",
            description="Housing for the power bank's lead, with two contacts BVH-21T-P1.1",
            source="JST VH, memory",
            ask="takes BVH-21T-P1.1, fits B2P-VH?",
        ),
    ),
)
